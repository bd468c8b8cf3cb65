//! How the rig moves: an arc around the reef that rises, with the unrest of a vehicle.

use crate::random::Random;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use scene::Rigid3;

const RADIUS_M: f64 = 4.2;
/// The arc in front of the reef, radians to each side.
const HALF_ARC_RAD: f64 = 0.9;

/// Poses `rig_from_world` of all exposures. World: z up, the reef at the origin.
pub(super) fn path(exposures: usize, seed: u64) -> Vec<Rigid3> {
    let mut random = Random::new(seed ^ 0xA5A5);
    (0..exposures)
        .map(|e| {
            let t = if exposures > 1 { e as f64 / (exposures - 1) as f64 } else { 0.5 };
            let angle = HALF_ARC_RAD * (2.0 * t - 1.0);
            let radius = RADIUS_M + 0.1 * random.normal();
            let centre = Vector3::new(radius * angle.sin(), -radius * angle.cos(), 1.2 + 1.6 * t + 0.05 * random.normal());
            let target = Vector3::new(0.1 * random.normal(), 0.1 * random.normal(), 0.8 + 0.05 * random.normal());
            look_at(&centre, &target, 0.03 * random.normal())
        })
        .collect()
}

/// The pose at `centre` that looks at `target`, rolled about its axis.
fn look_at(centre: &Vector3<f64>, target: &Vector3<f64>, roll_rad: f64) -> Rigid3 {
    let z = (target - centre).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let y = z.cross(&x);
    let upright = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::z() * roll_rad) * Rigid3::from_matrix(&upright, Vector3::zeros()).rotation;
    Rigid3::new(rotation, -(rotation * centre))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_is_on_the_axis_and_up_is_up() {
        let (centre, target) = (Vector3::new(1.0, -4.0, 2.0), Vector3::new(0.0, 0.0, 1.0));
        let pose = look_at(&centre, &target, 0.0);
        assert!((pose.centre() - centre).norm() < 1e-12);
        let seen = pose.apply(&target);
        assert!(seen.x.abs() < 1e-12 && seen.y.abs() < 1e-12 && seen.z > 0.0);
        assert!(pose.apply(&(target + Vector3::z())).y < 0.0, "what is higher lies further up in the image");
    }
}
