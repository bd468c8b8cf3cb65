//! How good an orientation is: standard deviations, and whether the given ones are plausible.

use crate::adjustment::{ProblemMap, SENSOR_LOSS, sensor_of, whole_problem};
use crate::lengths::{Known, LengthId};
use crate::model::Model;
use crate::options::OrientOptions;
use nalgebra::{Matrix3, Matrix3x6};
use scene::{ImageId, Scale};
use solve::adjust::{AdjustSummary, Baseline, Covariance, CovarianceError, CovarianceOptions, ImageObservation, Problem, covariance};
use solve::lie::skew;

/// A length whose normalised residual is larger contradicts the others: one right length in a thousand does by chance (Baarda, *A testing
/// procedure for use in geodetic networks*, 1968).
pub(crate) const CRITICAL: f64 = 3.29;

/// Standard deviations of a model. They hold in the datum of [`Quality::datum`]: errors of its pose are not in them.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// The image whose frame is held; deviations grow away from it.
    pub datum: ImageId,
    /// How well instruments and control points place that image in the world; `None` where they leave something of its place open.
    pub datum_in_world: Option<PoseSigma>,
    /// Number of residuals minus number of unknowns.
    pub redundancy: f64,
    /// Estimated over given standard deviation of the image observations; all standard deviations here are stated with the estimated one.
    pub sigma0_image: f64,
    /// The same of the baselines, where they are redundant.
    pub sigma0_baselines: Option<f64>,
    /// The same of the scale bars, where they are redundant.
    pub sigma0_scale_bars: Option<f64>,
    /// Of each image: projection centre along the axes of the world, and rotation about the axes of the camera.
    pub images: Vec<Option<PoseSigma>>,
    /// Of the interior orientation of each camera.
    pub cameras: Vec<InteriorSigma>,
    /// Standard deviation of each point, the root of the sum of the variances along the axes, in the order of the reconstruction; unit of
    /// the world.
    pub points: Vec<Option<f64>>,
    /// Normalised residual v / (sigma sqrt(r)), with the redundancy r, of each length that takes part, a baseline's exposures together;
    /// `None` where nothing checks it.
    pub lengths: Vec<(LengthId, Option<f64>)>,
    /// By how many of these standard deviations the model may be displaced because distances between cameras are not linear within what
    /// is left undetermined: the norm of [`Covariance::baseline_bends`]. Above a half they state too little.
    pub baseline_bend: f64,
}

/// Standard deviations of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSigma {
    /// Of the projection centre along each axis of the world, in its unit.
    pub centre: [f64; 3],
    /// Of the rotation about each axis of the camera, radians.
    pub rotation_rad: [f64; 3],
}

/// Standard deviations of the refined parameters of a camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InteriorSigma {
    /// Positions among the parameters of the camera model.
    pub parameters: Vec<usize>,
    /// Standard deviation of each.
    pub sigmas: Vec<f64>,
    /// Correlations, row by row.
    pub correlations: Vec<Vec<f64>>,
}

/// As good as exact, and far from where rounding begins.
const EXACTLY: f64 = 1e-6;

/// Standard deviations of a model after its last adjustment.
///
/// The image observations are weighed by what their residuals say (variance component estimation, one step), lengths as given. Outliers
/// are gone by now, so that no loss is applied to them; readings of instruments count with the weights that they had in the adjustment.
pub(crate) fn quality(
    model: &Model,
    known: &Known,
    scale: Scale,
    adjustment: &AdjustSummary,
    options: &OrientOptions,
) -> Result<Quality, CovarianceError> {
    let (mut problem, places) = whole_problem(model, Some(known), options);
    let held = hold(&mut problem);
    if scale == Scale::Arbitrary {
        hold_scale(&mut problem, held);
    }
    let sigma0_image = image_sigma(&problem, adjustment.free.total);
    problem.observations.iter_mut().for_each(|o| o.sigma_px *= sigma0_image);
    let weights = CovarianceOptions { sensor_loss: SENSOR_LOSS, ..CovarianceOptions::default() };
    let found = covariance(&problem, &weights)?;
    let datum = model.frame_images.iter().enumerate().find(|(f, _)| places.frame(*f) == Some(held));
    let datum = datum.and_then(|(_, images)| images.first().copied()).unwrap_or(ImageId(0));
    let datum_in_world = if known.ties.fix_world {
        problem.frames[held as usize].free = true;
        let found = covariance(&problem, &weights)?;
        pose_sigma(model, datum, &problem, &places, &found)
    } else {
        None
    };
    let (baseline_count, bar_count) = (adjustment.baselines.len(), adjustment.scale_bars.len());
    let (baselines, bars) = (&found.redundancy[..baseline_count], &found.redundancy[problem.baselines.len()..][..bar_count]);
    let residuals = |all: &[solve::adjust::LengthResidual]| all.iter().map(|l| l.normalised_residual).collect::<Vec<_>>();
    let (v_baselines, v_bars) = (residuals(&adjustment.baselines), residuals(&adjustment.scale_bars));
    let groups = known.baseline_groups();
    let of_groups = groups.iter().map(|(given, group)| (LengthId::Baseline(*given), grouped(group, &v_baselines, baselines)));
    let of_bars = known.bars_given().into_iter().enumerate();
    let of_bars = of_bars.map(|(i, given)| (LengthId::ScaleBar(given), grouped(&[i], &v_bars, bars)));
    Ok(Quality {
        datum,
        datum_in_world,
        redundancy: found.total_redundancy,
        sigma0_image,
        sigma0_baselines: component(&v_baselines, baselines),
        sigma0_scale_bars: component(&v_bars, bars),
        images: (0..model.images.len()).map(|i| pose_sigma(model, ImageId::new(i), &problem, &places, &found)).collect(),
        cameras: (0..model.cameras.len()).map(|c| interior_sigma(&problem, c, &found)).collect(),
        points: points(model, &found),
        lengths: of_groups.chain(of_bars).collect(),
        baseline_bend: found.baseline_bends[..baseline_count].iter().map(|b| b * b).sum::<f64>().sqrt(),
    })
}

/// Holds the frame in the middle: what else fixes where the world is, is less precise than the images are among each other.
fn hold(problem: &mut Problem) -> u32 {
    let middle = problem.frames.len() / 2;
    problem.frames[middle].free = false;
    middle as u32
}

/// Fixes the distance of the frame that is furthest from the one held.
fn hold_scale(problem: &mut Problem, held: u32) {
    let centre = |f: u32| problem.frames[f as usize].pose.centre();
    let distance = |f: u32| (centre(f) - centre(held)).norm();
    let furthest = (0..problem.frames.len() as u32).max_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    let observed = |frame: u32| problem.observations.iter().find(|o| o.frame == frame).map(|o| (frame, o.sensor));
    if let Some((a, b)) = furthest.filter(|&f| f != held).and_then(|f| Some((observed(held)?, observed(f)?))) {
        let length = distance(b.0);
        problem.baselines.push(Baseline { a, b, length, sigma: EXACTLY * length });
    }
}

/// Estimated over given standard deviation of the image observations.
fn image_sigma(problem: &Problem, unknowns: usize) -> f64 {
    let square = |o: &ImageObservation| {
        let cam_from_world = problem.sensors[o.sensor as usize].pose * problem.frames[o.frame as usize].pose;
        let projected = problem.cameras[o.camera as usize].camera.project(&cam_from_world.apply(&problem.points[o.point as usize].xyz))?;
        Some((projected - o.pixel).norm_squared() / (o.sigma_px * o.sigma_px))
    };
    let squares: f64 = problem.observations.iter().filter_map(square).sum();
    // Seven of the unknowns, pose and unit of the world, show in no image.
    let redundancy = 2.0 * problem.observations.len() as f64 - unknowns as f64 + 7.0;
    if redundancy > 0.0 && squares > 0.0 { (squares / redundancy).sqrt() } else { 1.0 }
}

/// sqrt(sum v^2 / sum r).
fn component(normalised: &[f64], redundancy: &[f64]) -> Option<f64> {
    let sum: f64 = redundancy.iter().sum();
    let squares: f64 = normalised.iter().map(|v| v * v).sum();
    (sum > 0.1).then(|| (squares / sum).sqrt())
}

/// Residuals of one length that was observed several times: their sum over the square root of the sum of their redundancies.
fn grouped(group: &[usize], normalised: &[f64], redundancy: &[f64]) -> Option<f64> {
    let sum: f64 = group.iter().map(|&i| redundancy[i]).sum();
    // Below a hundredth nothing but rounding is left of the residual.
    (sum > 0.01 * group.len() as f64).then(|| group.iter().map(|&i| normalised[i]).sum::<f64>() / sum.sqrt())
}

fn pose_sigma(model: &Model, image: ImageId, problem: &Problem, places: &ProblemMap, found: &Covariance) -> Option<PoseSigma> {
    let (frame, sensor) = sensor_of(model, places, image)?;
    let of_frame = found.frames[frame as usize].unwrap_or_default();
    let (pose, cam_from_rig) = (problem.frames[frame as usize].pose, problem.sensors[sensor as usize].pose);
    // A step (w, d) of the rig moves the centre c of the camera, in the rig, by R^T ((c - t) x w - d) in the world.
    let mut j = Matrix3x6::zeros();
    j.fixed_view_mut::<3, 3>(0, 0).copy_from(&skew(&(cam_from_rig.centre() - pose.translation)));
    j.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
    let (r, r_cam) = (pose.rotation_matrix(), cam_from_rig.rotation_matrix());
    let centre = r.transpose() * (j * of_frame * j.transpose()) * r;
    let turn = r_cam * of_frame.fixed_view::<3, 3>(0, 0) * r_cam.transpose();
    let roots = |m: Matrix3<f64>| [m[(0, 0)], m[(1, 1)], m[(2, 2)]].map(|v| v.max(0.0).sqrt());
    Some(PoseSigma { centre: roots(centre), rotation_rad: roots(turn) })
}

fn interior_sigma(problem: &Problem, camera: usize, found: &Covariance) -> InteriorSigma {
    let Some(square) = &found.cameras[camera] else { return InteriorSigma::default() };
    let block = &problem.cameras[camera];
    let parameters: Vec<usize> = (0..block.camera.params().len()).filter(|&k| block.free[k]).collect();
    let sigmas: Vec<f64> = square.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
    let n = sigmas.len();
    let correlation = |i: usize, j: usize| if i == j { 1.0 } else { square[(i, j)] / (sigmas[i] * sigmas[j]) };
    let correlations = (0..n).map(|i| (0..n).map(|j| correlation(i, j)).collect()).collect();
    InteriorSigma { parameters, sigmas, correlations }
}

/// Points stand first in the problem, in the order of their ids, which is that of the reconstruction.
fn points(model: &Model, found: &Covariance) -> Vec<Option<f64>> {
    (0..model.point_count()).map(|i| found.points[i].map(|m| m.trace().max(0.0).sqrt())).collect()
}
