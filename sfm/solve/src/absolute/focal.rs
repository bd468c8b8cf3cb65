//! Absolute pose of a camera whose focal length is a guess.

use super::estimator::{Correspondence, Sensor, estimate_absolute_pose, true_inliers};
use super::refinement::Movable;
use crate::numeric::minimise::{FINE, Normal, levenberg_marquardt};
use crate::ransac::{Msac, Ransac, RansacOptions, Scoring};
use nalgebra::{SVector, Vector2, Vector3};
use scene::camera::ParamKind;
use scene::{Camera, Rigid3};

/// Trials of the last refinement.
const MAX_STEPS: usize = 30;

/// Pose `cam_from_world` and mean focal length in pixels of one camera, robustly; `o.max_error` in pixels.
///
/// [`estimate_absolute_pose`] with each focal length of `focals_px`, the one of least MSAC cost wins (the first on a tie); pose and focal length
/// are then refined together on its inliers by Levenberg-Marquardt on true pixel errors, truncated. Where a model has two focal lengths
/// their ratio stays; principal point and distortion stay. Needs at least four inliers. Degenerate: points of one plane
/// parallel to the image, where depth and focal length cannot be told apart. `None` when no candidate leads to a pose.
#[must_use]
pub fn estimate_absolute_pose_and_focal(
    camera: &Camera,
    pixels: &[Vector2<f64>],
    points: &[Vector3<f64>],
    o: &RansacOptions,
    focals_px: &[f64],
) -> Option<Ransac<(Rigid3, f64)>> {
    let correspondences: Vec<Correspondence> =
        pixels.iter().zip(points).map(|(&pixel, &x_in_world)| Correspondence { sensor: 0, pixel, x_in_world }).collect();
    let limit = o.max_error * o.max_error;
    let sensor = |focal_px: f64| Sensor { camera: with_focal(camera, focal_px), cam_from_rig: Rigid3::identity() };
    let mut best: Option<(f64, f64, Ransac<Rigid3>)> = None;
    for &focal_px in focals_px.iter().filter(|f| f.is_finite() && **f > 0.0) {
        let Some(found) = estimate_absolute_pose(&[sensor(focal_px)], &correspondences, o) else {
            continue;
        };
        let cost = msac(&sensor(focal_px).camera, &correspondences, &found.model, limit);
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, focal_px, found));
        }
    }
    let (_, focal_px, found) = best?;
    let start = (found.model, focal_px);
    let linearise = |(pose, focal_px): &(Rigid3, f64)| linearised(&with_focal(camera, *focal_px), pose, &correspondences, limit);
    let retract = |(pose, focal_px): &(Rigid3, f64), step: &SVector<f64, 7>| {
        (pose.moved(&step.fixed_rows::<6>(0).into_owned()), focal_px * step[6].clamp(-1.0, 1.0).exp())
    };
    let model = levenberg_marquardt(&start, MAX_STEPS, FINE, linearise, retract);
    let inliers = true_inliers(&[sensor(model.1)], &correspondences, &model.0, o.max_error);
    (inliers.len() >= 4).then_some(Ransac { model, inliers, iterations: found.iterations })
}

/// The camera with all focal lengths scaled so that their mean is `focal_px`.
fn with_focal(camera: &Camera, focal_px: f64) -> Camera {
    let mut out = *camera;
    let factor = focal_px / camera.mean_focal();
    let kinds = camera.model().param_kinds();
    out.params_mut().iter_mut().zip(kinds).filter(|(_, kind)| **kind == ParamKind::Focal).for_each(|(p, _)| *p *= factor);
    out
}

fn msac(camera: &Camera, correspondences: &[Correspondence], pose: &Rigid3, limit: f64) -> f64 {
    let scoring = Msac { max_squared_error: limit };
    let error = |c: &Correspondence| camera.project(&pose.apply(&c.x_in_world)).map_or(f64::INFINITY, |p| (p - c.pixel).norm_squared());
    correspondences.iter().map(|c| scoring.cost(error(c))).sum()
}

/// Truncated normal equations in the six of the pose and the logarithm of the focal length.
fn linearised(camera: &Camera, pose: &Rigid3, correspondences: &[Correspondence], limit: f64) -> Option<Normal<7>> {
    let mut normal = Normal::zero();
    for c in correspondences {
        let x_in_cam = pose.apply(&c.x_in_world);
        let projected = camera.project_with_jacobians(&x_in_cam).map(|p| (p.pixel - c.pixel, p));
        let Some((r, projected)) = projected.filter(|(r, _)| r.norm_squared() < limit) else {
            normal.cost += limit;
            continue;
        };
        let rows = pose.pose_rows(&projected.d_point, &x_in_cam);
        for axis in 0..2 {
            let params = camera.params().iter().zip(camera.model().param_kinds()).enumerate();
            let d_log_focal: f64 =
                params.filter(|(_, (_, kind))| **kind == ParamKind::Focal).map(|(k, (p, _))| p * projected.d_params[(axis, k)]).sum();
            let mut row = [0.0; 7];
            row[..6].copy_from_slice(&rows[axis]);
            row[6] = d_log_focal;
            normal.add(r[axis], &row, 1.0);
        }
        normal.cost += r.norm_squared();
    }
    normal.cost.is_finite().then_some(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use scene::CameraModel;

    #[test]
    fn gradient_is_half_the_slope_of_the_cost() {
        let params = [1100.0, 1150.0, 955.0, 610.0, -0.2, 0.05, 0.001, -0.002];
        let camera = Camera::new(CameraModel::OpenCv, 1920, 1200, &params).unwrap();
        let pose = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.3)), Vector3::new(0.2, 0.1, 0.5));
        let correspondences: Vec<Correspondence> = [(0.5, -0.4, 3.0), (-0.6, 0.2, 4.0), (0.1, 0.5, 2.0)]
            .into_iter()
            .map(|(x, y, z)| Correspondence { sensor: 0, pixel: Vector2::new(900.0, 700.0), x_in_world: Vector3::new(x, y, z) })
            .collect();
        let at = |step: &SVector<f64, 7>| {
            let focal_px = 1125.0 * step[6].exp();
            let moved = pose.moved(&step.fixed_rows::<6>(0).into_owned());
            linearised(&with_focal(&camera, focal_px), &moved, &correspondences, 1e9).unwrap()
        };
        let gradient = at(&SVector::zeros()).gradient;
        for k in 0..7 {
            let mut step = SVector::<f64, 7>::zeros();
            step[k] = 1e-6;
            let slope = (at(&step).cost - at(&-step).cost) / 2e-6;
            // The cost is of size 1e6 px^2: differences keep five digits.
            assert!((slope / 2.0 - gradient[k]).abs() < 1e-5 * gradient.norm(), "{k}: {slope} {}", gradient[k]);
        }
    }
}
