//! Interior orientation and rig from views of a target, with their precision.

use crate::error::CalibrateError;
use crate::start::{Start, start};
use nalgebra::{DMatrix, Matrix6, Vector2, Vector3};
use scene::camera::{MAX_CAMERA_PARAMS, ParamKind};
use scene::{Camera, CameraModel, Rigid3};
use solve::adjust::{
    AdjustOptions, AdjustSummary, Baseline, CameraBlock, Covariance, CovarianceOptions, ImageObservation, PointBlock, PoseBlock, Problem,
    adjust, covariance,
};

/// An observation is left out when its residual is larger than this many robust standard deviations: a mistake, not noise.
const OUTLIER_SIGMAS: f64 = 6.0;
/// A parameter is significant when it is at least this many standard deviations from 0: 99 % of a normal distribution.
const SIGNIFICANT_SIGMAS: f64 = 2.576;
/// A weight that lets a distance be looked at without changing it.
const WEAK: f64 = 1e3;

/// A camera to be calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSetup {
    /// Columns of its photographs.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// How it is described.
    pub model: CameraModel,
    /// Whether each parameter of the model keeps its start value: of distortion 0, of the principal point the middle.
    pub held: [bool; MAX_CAMERA_PARAMS],
}

/// The target as one photograph shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Index of the camera.
    pub camera: usize,
    /// Number of the exposure, from 0 without large gaps: what cameras saw at one instant has one number.
    pub exposure: usize,
    /// Index of a point of the target, and where it was seen, pixels.
    pub points: Vec<(usize, Vector2<f64>)>,
}

/// What a calibration starts from.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Points of the target, in the plane z = 0, metres: x right and y down when it is seen from its front. They are taken as exact.
    pub target: Vec<Vector3<f64>>,
    /// The cameras; the first one is the frame of the rig.
    pub cameras: Vec<CameraSetup>,
    /// What they saw.
    pub views: Vec<View>,
}

/// A parameter of the interior orientation.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, as [`CameraModel::param_names`] has it.
    pub name: &'static str,
    /// Its value, pixels or none.
    pub value: f64,
    /// Its standard deviation; 0 for one that is held.
    pub sigma: f64,
    /// Of distortion parameters that are not held: whether it differs from 0 at 99 %.
    pub significant: Option<bool>,
}

/// A calibrated camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedCamera {
    /// The interior orientation.
    pub camera: Camera,
    /// Its parameters with their precision.
    pub parameters: Vec<Parameter>,
    /// Their correlations, in the same order; 0 with one that is held.
    pub correlations: DMatrix<f64>,
    /// Their covariance, in the same order; 0 with one that is held.
    pub covariance: DMatrix<f64>,
    /// `cam_from_rig`.
    pub cam_from_rig: Rigid3,
    /// Standard deviations of the rotation about the axes of the camera, radians, and of the translation, metres; 0 for the first camera.
    pub sigma_pose: [f64; 6],
    /// Their covariance; `None` for the first camera.
    pub pose_covariance: Option<Matrix6<f64>>,
    /// Root mean square of the distances between points seen and projected, pixels.
    pub rms_px: f64,
    /// Number of points seen.
    pub observations: usize,
}

/// A distance of projection centres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibratedBaseline {
    /// Indices of the cameras.
    pub cameras: (usize, usize),
    /// The distance, metres.
    pub length_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
}

/// A calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The cameras, in the order of the setup.
    pub cameras: Vec<CalibratedCamera>,
    /// Every pair of cameras.
    pub baselines: Vec<CalibratedBaseline>,
    /// `rig_from_target` of each exposure; `None` where nothing was seen.
    pub exposures: Vec<Option<Rigid3>>,
    /// Root mean square of the distances between points seen and projected, over all cameras, pixels.
    pub rms_px: f64,
    /// Standard deviation of a coordinate of a point seen, from the residuals and the redundancy, pixels.
    pub sigma0_px: f64,
    /// Observations used.
    pub observations: usize,
    /// Observations left out as mistakes: view and place in its list of points.
    pub outliers: Vec<(usize, usize)>,
}

impl Calibration {
    /// What was seen less what is projected, pixels, of each point of each view of the setup that it was made from; `None` where a point does
    /// not project.
    #[must_use]
    pub fn residuals(&self, setup: &Setup) -> Vec<Vec<Option<Vector2<f64>>>> {
        let of_view = |view: &View| {
            let pose = self.exposures[view.exposure].map(|e| self.cameras[view.camera].cam_from_rig * e);
            let project = |p: usize| self.cameras[view.camera].camera.project(&pose?.apply(&setup.target[p]));
            view.points.iter().map(|(p, seen)| project(*p).map(|at| seen - at)).collect()
        };
        setup.views.iter().map(of_view).collect()
    }
}

/// Calibrates cameras, and the rig that they form, from three or more views each of a flat target.
///
/// Start values by Zhang's constraints (PAMI 2000), then bundle adjustment of interior orientation, rig and the pose of the target at each
/// exposure. Residuals beyond 6 robust standard deviations are left out, and the rest is adjusted again. Standard deviations are those of
/// least squares, times the standard deviation of unit weight.
///
/// # Errors
/// [`CalibrateError`] where the views do not determine the calibration, or contradict the description of the target.
pub fn calibrate(setup: &Setup) -> Result<Calibration, CalibrateError> {
    let start = start(setup)?;
    let (mut problem, mut source) = problem(setup, &start);
    let options = AdjustOptions { max_iterations: 200, function_tolerance: 1e-12, ..AdjustOptions::default() };
    // Strong distortion before what correlates with it: principal point, higher terms.
    let first_distortion = |model: CameraModel| model.param_kinds().iter().position(|k| *k == ParamKind::Distortion);
    for (block, camera) in problem.cameras.iter_mut().zip(&setup.cameras) {
        let kinds = block.camera.model().param_kinds();
        let first = first_distortion(block.camera.model());
        block.free = std::array::from_fn(|k| !camera.held[k] && (kinds.get(k) == Some(&ParamKind::Focal) || first == Some(k)));
    }
    adjust(&mut problem, &options)?;
    for (block, camera) in problem.cameras.iter_mut().zip(&setup.cameras) {
        block.free = camera.held.map(|held| !held);
    }
    let mut summary = adjust(&mut problem, &options)?;
    let outliers = remove_outliers(&mut problem, &mut source);
    if !outliers.is_empty() {
        summary = adjust(&mut problem, &options)?;
    }
    if !summary.termination.is_converged() {
        return Err(CalibrateError::NotConverged);
    }
    finish(setup, problem, &summary, outliers)
}

/// The adjustment, and the view and place of each observation.
fn problem(setup: &Setup, start: &Start) -> (Problem, Vec<(usize, usize)>) {
    let mut problem = Problem {
        cameras: start.cameras.iter().map(|camera| CameraBlock::fixed(*camera)).collect(),
        sensors: start.sensors.iter().map(|pose| PoseBlock::free(*pose)).collect(),
        frames: start.exposures.iter().map(|pose| pose.map_or(PoseBlock::fixed(Rigid3::identity()), PoseBlock::free)).collect(),
        points: setup.target.iter().map(|xyz| PointBlock { xyz: *xyz, free: false }).collect(),
        ..Problem::default()
    };
    problem.sensors[0].free = false;
    let mut source = Vec::new();
    for (v, view) in setup.views.iter().enumerate() {
        for (k, (point, pixel)) in view.points.iter().enumerate() {
            let (frame, camera) = (view.exposure as u32, view.camera as u32);
            problem.observations.push(ImageObservation {
                frame,
                sensor: camera,
                camera,
                point: *point as u32,
                pixel: *pixel,
                sigma_px: 1.0,
            });
            source.push((v, k));
        }
    }
    (problem, source)
}

/// Residual of each observation, pixels; infinite where it does not project.
pub(crate) fn residuals(problem: &Problem) -> Vec<f64> {
    let residual = |o: &ImageObservation| {
        let cam_from_world = problem.sensors[o.sensor as usize].pose * problem.frames[o.frame as usize].pose;
        let pixel = problem.cameras[o.camera as usize].camera.project(&cam_from_world.apply(&problem.points[o.point as usize].xyz));
        pixel.map_or(f64::INFINITY, |p| (p - o.pixel).norm())
    };
    problem.observations.iter().map(residual).collect()
}

fn remove_outliers(problem: &mut Problem, source: &mut Vec<(usize, usize)>) -> Vec<(usize, usize)> {
    let errors = residuals(problem);
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    // The median of a Rayleigh distribution is 1.1774 standard deviations of a coordinate. Exact data has no outliers.
    let limit = (OUTLIER_SIGMAS * sorted[sorted.len() / 2] / 1.1774).max(1e-6);
    let kept = |k: &usize| errors[*k] <= limit;
    let outliers = (0..errors.len()).filter(|k| !kept(k)).map(|k| source[k]).collect();
    problem.observations = (0..errors.len()).filter(kept).map(|k| problem.observations[k]).collect();
    *source = (0..errors.len()).filter(kept).map(|k| source[k]).collect();
    outliers
}

fn finish(
    setup: &Setup,
    mut problem: Problem,
    summary: &AdjustSummary,
    outliers: Vec<(usize, usize)>,
) -> Result<Calibration, CalibrateError> {
    let errors = residuals(&problem);
    let redundancy = (summary.residuals as f64 - summary.free.total as f64).max(1.0);
    let square: f64 = errors.iter().map(|e| e * e).sum();
    // Exact observations have a standard deviation, if a small one.
    let sigma0_px = (square / redundancy).sqrt().max(1e-9);
    problem.observations.iter_mut().for_each(|o| o.sigma_px = sigma0_px);
    let found = covariance(&problem, &CovarianceOptions::default())?;
    let rms = |camera: Option<usize>| {
        let of = || problem.observations.iter().zip(&errors).filter(|(o, _)| camera.is_none_or(|c| o.camera as usize == c));
        let count = of().count();
        ((of().map(|(_, e)| e * e).sum::<f64>() / count as f64).sqrt(), count)
    };
    let cameras = (0..setup.cameras.len()).map(|c| calibrated_camera(&problem, &found, c, rms(Some(c)))).collect();
    let baselines = baselines(&problem)?;
    let seen = |e: usize| problem.observations.iter().any(|o| o.frame as usize == e);
    let exposures = problem.frames.iter().enumerate().map(|(e, f)| seen(e).then_some(f.pose)).collect();
    let (rms_px, observations) = rms(None);
    Ok(Calibration { cameras, baselines, exposures, rms_px, sigma0_px, observations, outliers })
}

fn calibrated_camera(problem: &Problem, found: &Covariance, c: usize, (rms_px, observations): (f64, usize)) -> CalibratedCamera {
    let camera = problem.cameras[c].camera;
    let n = camera.params().len();
    let free: Vec<usize> = (0..n).filter(|&k| problem.cameras[c].free[k]).collect();
    let mut matrix = DMatrix::zeros(n, n);
    if let Some(found) = &found.cameras[c] {
        for (i, &a) in free.iter().enumerate() {
            free.iter().enumerate().for_each(|(j, &b)| matrix[(a, b)] = found[(i, j)]);
        }
    }
    let sigma: Vec<f64> = (0..n).map(|k| matrix[(k, k)].sqrt()).collect();
    let correlation = |i: usize, j: usize| match sigma[i] * sigma[j] {
        0.0 => f64::from(u8::from(i == j)),
        product => matrix[(i, j)] / product,
    };
    let model = camera.model();
    let parameters = (0..n).map(|k| Parameter {
        name: model.param_names()[k],
        value: camera.params()[k],
        sigma: sigma[k],
        significant: (model.param_kinds()[k] == ParamKind::Distortion && sigma[k] > 0.0)
            .then(|| camera.params()[k].abs() >= SIGNIFICANT_SIGMAS * sigma[k]),
    });
    CalibratedCamera {
        camera,
        parameters: parameters.collect(),
        correlations: DMatrix::from_fn(n, n, correlation),
        covariance: matrix,
        cam_from_rig: problem.sensors[c].pose,
        pose_covariance: found.sensors[c],
        sigma_pose: found.sensors[c].map_or([0.0; 6], |m| std::array::from_fn(|k| m[(k, k)].sqrt())),
        rms_px,
        observations,
    }
}

/// The distance of every pair of cameras, with its standard deviation.
///
/// A distance that is observed with the standard deviation s takes the share v / (v + s2) of its redundancy, where v is its variance without
/// that observation: so v is read off a weak observation that changes nothing.
fn baselines(problem: &Problem) -> Result<Vec<CalibratedBaseline>, CalibrateError> {
    let mut problem = problem.clone();
    let Some(frame) = problem.observations.first().map(|o| o.frame) else { return Ok(Vec::new()) };
    let n = problem.sensors.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    let centre = |c: usize| problem.sensors[c].pose.centre();
    let lengths: Vec<f64> = pairs.iter().map(|&(i, j)| (centre(i) - centre(j)).norm()).collect();
    let sigmas = |problem: &mut Problem, weights: &[f64]| -> Result<Vec<f64>, CalibrateError> {
        let observed = pairs.iter().zip(&lengths).zip(weights);
        problem.baselines =
            observed.map(|((&(i, j), &length), &sigma)| Baseline { a: (frame, i as u32), b: (frame, j as u32), length, sigma }).collect();
        let found = covariance(problem, &CovarianceOptions::default())?;
        let variance = |(redundancy, s): (&f64, &f64)| s * s * (1.0 - redundancy) / redundancy;
        Ok(found.redundancy.iter().zip(weights).map(variance).map(|v| v.max(0.0).sqrt()).collect())
    };
    if lengths.is_empty() || lengths.iter().any(|l| *l <= 0.0) {
        return Ok(Vec::new());
    }
    // First with the length as its weight, for the size of the result.
    let rough = sigmas(&mut problem, &lengths)?;
    let weak: Vec<f64> = rough.iter().zip(&lengths).map(|(s, l)| (WEAK * s).clamp(1e-9 * l, *l)).collect();
    let fine = sigmas(&mut problem, &weak)?;
    let all = pairs.into_iter().zip(lengths).zip(fine);
    Ok(all.map(|((cameras, length_m), sigma_m)| CalibratedBaseline { cameras, length_m, sigma_m }).collect())
}
