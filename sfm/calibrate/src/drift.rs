//! Whether a calibration is still true: two calibrations against each other, with significance.

use crate::calibration::{Calibration, Setup};
use crate::chi_square::chi_square_above;
use crate::error::CalibrateError;
use crate::plane::{homography, pose};
use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, Matrix6, Vector2, Vector3, Vector6};
use scene::{Camera, Rigid3};
use solve::adjust::{AdjustOptions, CameraBlock, ImageObservation, PointBlock, PoseBlock, Problem, adjust};

/// Rows and columns of the grid on which shifts of image points are looked at.
const GRID: usize = 15;

/// A camera as an earlier calibration left it.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownCamera {
    /// Its interior orientation.
    pub camera: Camera,
    /// Covariance of the parameters, in their order; 0 for what was held.
    pub covariance: DMatrix<f64>,
    /// `cam_from_rig`, metres.
    pub cam_from_rig: Rigid3,
    /// Covariance of that: rotation about the axes of the camera, radians, then translation; `None` for the first camera.
    pub pose_covariance: Option<Matrix6<f64>>,
}

/// A difference of several values at once, against its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftTest {
    /// d^T (C1 + C2)^-1 d.
    pub chi_square: f64,
    /// Number of values.
    pub freedom: usize,
    /// Probability that chance alone makes the difference as large.
    pub probability: f64,
}

/// A parameter in two calibrations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterDrift {
    /// Its name.
    pub name: &'static str,
    /// Its value then.
    pub before: f64,
    /// Its value now.
    pub after: f64,
    /// Standard deviation of the difference; 0 where it was held both times.
    pub sigma: f64,
}

/// A camera in two calibrations.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraDrift {
    /// Its parameters.
    pub parameters: Vec<ParameterDrift>,
    /// All of them at once; `None` where covariances are singular.
    pub interior: Option<DriftTest>,
    /// By how much image points move, that no turn of the camera takes up: root mean square over the image, pixels.
    pub shift_rms_px: f64,
    /// The largest.
    pub shift_max_px: f64,
    /// Angle between both orientations in the rig, radians.
    pub turned_rad: f64,
    /// Distance of both projection centres in the rig, metres.
    pub moved_m: f64,
    /// Rotation and translation in the rig at once; `None` for the first camera.
    pub pose: Option<DriftTest>,
}

/// Compares a calibration with an earlier one of the same cameras, in the same order; the errors of both are independent.
///
/// `None` where numbers or models of the cameras differ.
#[must_use]
pub fn drift(before: &[KnownCamera], after: &Calibration) -> Option<Vec<CameraDrift>> {
    let same = |(a, b): (&KnownCamera, &crate::CalibratedCamera)| {
        (a.camera.model(), a.camera.width(), a.camera.height()) == (b.camera.model(), b.camera.width(), b.camera.height())
    };
    if before.len() != after.cameras.len() || !before.iter().zip(&after.cameras).all(same) {
        return None;
    }
    Some(before.iter().zip(&after.cameras).map(|(a, b)| of_camera(a, b)).collect())
}

fn of_camera(before: &KnownCamera, after: &crate::CalibratedCamera) -> CameraDrift {
    let covariance = &before.covariance + &after.covariance;
    let values = before.camera.params().iter().zip(after.camera.params());
    let difference: Vec<f64> = values.map(|(a, b)| b - a).collect();
    let parameters = after.parameters.iter().enumerate().map(|(k, p)| ParameterDrift {
        name: p.name,
        before: before.camera.params()[k],
        after: p.value,
        sigma: covariance[(k, k)].sqrt(),
    });
    let (shift_rms_px, shift_max_px) = shift(&before.camera, &after.camera);
    let turn = (after.cam_from_rig.rotation * before.cam_from_rig.rotation.inverse()).scaled_axis();
    let step = after.cam_from_rig.translation - before.cam_from_rig.translation;
    let pose = before.pose_covariance.zip(after.pose_covariance).and_then(|(a, b)| {
        let sum = a + b;
        let difference = Vector6::new(turn.x, turn.y, turn.z, step.x, step.y, step.z);
        test(difference.as_slice(), &DMatrix::from_fn(6, 6, |i, j| sum[(i, j)]))
    });
    CameraDrift {
        parameters: parameters.collect(),
        interior: test(&difference, &covariance),
        shift_rms_px,
        shift_max_px,
        turned_rad: turn.norm(),
        moved_m: (after.cam_from_rig.centre() - before.cam_from_rig.centre()).norm(),
        pose,
    }
}

/// Values whose variance is 0 do not take part.
fn test(difference: &[f64], covariance: &DMatrix<f64>) -> Option<DriftTest> {
    let free: Vec<usize> = (0..difference.len()).filter(|&k| covariance[(k, k)] > 0.0).collect();
    let sigma: Vec<f64> = free.iter().map(|&k| covariance[(k, k)].sqrt()).collect();
    // In standard deviations: the units of the parameters lie many powers of ten apart.
    let n = free.len();
    let correlation = DMatrix::from_fn(n, n, |i, j| covariance[(free[i], free[j])] / (sigma[i] * sigma[j]));
    let d = DVector::from_fn(n, |i, _| difference[free[i]] / sigma[i]);
    let chi_square = d.dot(&correlation.cholesky()?.solve(&d));
    Some(DriftTest { chi_square, freedom: n, probability: chi_square_above(chi_square, n) })
}

/// Shift of image points from one interior orientation to another, after the turn of the camera that makes it least: RMS and largest.
fn shift(before: &Camera, after: &Camera) -> (f64, f64) {
    let (w, h) = (f64::from(before.width()), f64::from(before.height()));
    let at = |k: usize, size: f64| (k as f64 + 0.5) / GRID as f64 * size;
    let pixels = (0..GRID * GRID).map(|k| Vector2::new(at(k % GRID, w), at(k / GRID, h)));
    let rays: Vec<(Vector2<f64>, Vector3<f64>)> = pixels.filter_map(|p| Some((p, before.ray(&p)?))).collect();
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let mut moved = Vec::with_capacity(rays.len());
    for (pixel, ray) in &rays {
        let Some(found) = after.project_with_jacobians(ray) else { continue };
        let derivative: Matrix2x3<f64> = -found.d_point * ray.cross_matrix();
        let shift = found.pixel - pixel;
        normal += derivative.transpose() * derivative;
        right -= derivative.transpose() * shift;
        moved.push((shift, derivative));
    }
    let turn = normal.cholesky().map_or_else(Vector3::zeros, |c| c.solve(&right));
    let lengths: Vec<f64> = moved.iter().map(|(shift, derivative)| (shift + derivative * turn).norm()).collect();
    let rms = (lengths.iter().map(|l| l * l).sum::<f64>() / lengths.len().max(1) as f64).sqrt();
    (rms, lengths.into_iter().fold(0.0, f64::max))
}

/// How well views of the target fit cameras that are held.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldFit {
    /// Standard deviation of a coordinate of a point seen, from the residuals and the redundancy, pixels.
    pub sigma0_px: f64,
    /// Root mean square of the distances between points seen and projected, of each camera, pixels; `None` where it saw nothing.
    pub rms_px: Vec<Option<f64>>,
    /// Observations.
    pub observations: usize,
}

/// Finds the pose of the target at each exposure of a setup with cameras and rig held as they are known; no observation is left out.
///
/// # Errors
/// [`CalibrateError`] where views are wrong in themselves, or there are none.
pub fn fit_held(setup: &Setup, known: &[KnownCamera]) -> Result<HeldFit, CalibrateError> {
    let mut problem = Problem {
        cameras: known.iter().map(|k| CameraBlock::fixed(k.camera)).collect(),
        sensors: known.iter().map(|k| PoseBlock::fixed(k.cam_from_rig)).collect(),
        points: setup.target.iter().map(|xyz| PointBlock { xyz: *xyz, free: false }).collect(),
        ..Problem::default()
    };
    let exposures = setup.views.iter().map(|v| v.exposure + 1).max().unwrap_or(0);
    problem.frames = vec![PoseBlock::fixed(Rigid3::identity()); exposures];
    for (v, view) in setup.views.iter().enumerate() {
        let camera = known.get(view.camera).ok_or(CalibrateError::BadIndex { view: v })?;
        if view.points.iter().any(|(p, _)| *p >= setup.target.len()) {
            return Err(CalibrateError::BadIndex { view: v });
        }
        let seen = view.points.iter().filter_map(|(p, pixel)| Some((setup.target[*p].xy(), camera.camera.unproject(pixel)?)));
        let (plane, directions): (Vec<_>, Vec<_>) = seen.unzip();
        let h = homography(&plane, &directions).ok_or(CalibrateError::Degenerate { view: v })?;
        if h.determinant() < 0.0 {
            return Err(CalibrateError::Mirrored { view: v });
        }
        let frame = &mut problem.frames[view.exposure];
        if !frame.free {
            let cam_from_target = pose(&h, 1.0, Vector2::zeros()).ok_or(CalibrateError::Degenerate { view: v })?;
            *frame = PoseBlock::free(camera.cam_from_rig.inverse() * cam_from_target);
        }
        let (exposure, c) = (view.exposure as u32, view.camera as u32);
        problem.observations.extend(view.points.iter().map(|(p, pixel)| ImageObservation {
            frame: exposure,
            sensor: c,
            camera: c,
            point: *p as u32,
            pixel: *pixel,
            sigma_px: 1.0,
        }));
    }
    if problem.observations.is_empty() {
        return Err(CalibrateError::TooFewViews { camera: 0, found: 0, needed: 1 });
    }
    let summary = adjust(&mut problem, &AdjustOptions { max_iterations: 100, function_tolerance: 1e-10, ..AdjustOptions::default() })?;
    let errors = crate::calibration::residuals(&problem);
    let square = |c: Option<u32>| {
        let of = problem.observations.iter().zip(&errors).filter(move |(o, _)| c.is_none_or(|c| o.camera == c));
        of.fold((0.0, 0usize), |(sum, n), (_, e)| (sum + e * e, n + 1))
    };
    let redundancy = (summary.residuals as f64 - summary.free.total as f64).max(1.0);
    Ok(HeldFit {
        sigma0_px: (square(None).0 / redundancy).sqrt(),
        rms_px: (0..known.len() as u32).map(|c| square(Some(c))).map(|(sum, n)| (n > 0).then(|| (sum / n as f64).sqrt())).collect(),
        observations: problem.observations.len(),
    })
}
