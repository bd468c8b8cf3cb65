//! Nonlinear refinement of an absolute pose on pixel errors.

use super::estimator::{Correspondence, Sensor};
use crate::numeric::minimise::{FINE, Normal, levenberg_marquardt};
use nalgebra::{Matrix2x3, SVector, UnitQuaternion, Vector3};
use scene::Rigid3;

/// Scale of the Cauchy loss in [`refine_absolute_pose`], pixels: the size of usual keypoint errors.
const CAUCHY_SCALE_PX: f64 = 1.0;
/// Trials of one refinement.
const MAX_STEPS: usize = 30;

/// Refines `rig_from_world` on the true pixel errors of the given correspondences, with the robust loss of Cauchy (`s^2 log(1 + e^2 / s^2)`, s = 1 px).
///
/// Levenberg-Marquardt on six parameters with analytic derivatives through [`scene::Camera::project_with_jacobians`]. Interior
/// orientation, points and poses in the rig stay. Correspondences that do not project from the initial pose do not count, nor do bad indices; a
/// step that takes another one behind its camera is refused. Gives `initial` back where nothing improves it; with fewer than three
/// points, or points in line, the free directions stay where they were (damping).
#[must_use]
pub fn refine_absolute_pose(sensors: &[Sensor], correspondences: &[Correspondence], inliers: &[usize], initial: &Rigid3) -> Rigid3 {
    let scale = CAUCHY_SCALE_PX * CAUCHY_SCALE_PX;
    refine_with_loss(sensors, correspondences, inliers, initial, |squared| {
        (scale * (squared / scale).ln_1p(), 1.0 / (1.0 + squared / scale))
    })
}

/// As [`refine_absolute_pose`] for any loss: of a squared error, its cost and its weight.
pub(super) fn refine_with_loss(
    sensors: &[Sensor],
    correspondences: &[Correspondence],
    inliers: &[usize],
    initial: &Rigid3,
    loss: impl Fn(f64) -> (f64, f64),
) -> Rigid3 {
    let used: Vec<(&Sensor, &Correspondence)> = inliers
        .iter()
        .filter_map(|&i| {
            let c = correspondences.get(i)?;
            let sensor = sensors.get(c.sensor)?;
            let pixel = sensor.camera.project(&sensor.cam_from_rig.apply(&initial.apply(&c.x_in_world)))?;
            (pixel - c.pixel).norm().is_finite().then_some((sensor, c))
        })
        .collect();
    let rotations: Vec<_> = sensors.iter().map(|s| s.cam_from_rig.rotation_matrix()).collect();
    let linearise = |rig_from_world: &Rigid3| {
        let mut normal = Normal::zero();
        for (sensor, c) in &used {
            let x_in_rig = rig_from_world.apply(&c.x_in_world);
            let rotation = &rotations[c.sensor];
            let projected = sensor.camera.project_with_jacobians(&(rotation * x_in_rig + sensor.cam_from_rig.translation))?;
            let r = projected.pixel - c.pixel;
            let (cost, weight) = loss(r.norm_squared());
            normal.cost += cost;
            if weight > 0.0 {
                let [row_x, row_y] = rig_from_world.pose_rows(&(projected.d_point * rotation), &x_in_rig);
                normal.add(r.x, &row_x, weight);
                normal.add(r.y, &row_y, weight);
            }
        }
        Some(normal)
    };
    levenberg_marquardt(initial, MAX_STEPS, FINE, linearise, Movable::moved)
}

/// Small motions of a pose: `x_in_rig` becomes `exp(w) x_in_rig + v` for the step (w, v).
pub(super) trait Movable {
    fn moved(&self, step: &SVector<f64, 6>) -> Self;

    /// Rows of the derivative by (w, v) of what has the derivative `d_point` by `x_in_rig`.
    fn pose_rows(&self, d_point: &Matrix2x3<f64>, x_in_rig: &Vector3<f64>) -> [[f64; 6]; 2];
}

impl Movable for Rigid3 {
    fn moved(&self, step: &SVector<f64, 6>) -> Self {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
        let rotation = UnitQuaternion::new_normalize((turn * self.rotation).into_inner());
        Rigid3::new(rotation, turn * self.translation + Vector3::new(step[3], step[4], step[5]))
    }

    #[inline]
    fn pose_rows(&self, d_point: &Matrix2x3<f64>, x: &Vector3<f64>) -> [[f64; 6]; 2] {
        // d (exp(w) x) = w x x, and g . (w x x) = w . (x x g).
        [0, 1].map(|i| {
            let g = d_point.row(i).transpose();
            let w = x.cross(&g);
            [w.x, w.y, w.z, g.x, g.y, g.z]
        })
    }
}
