//! What measurements add to the truth: functions that change a reconstruction in place, each with its own seed.

use crate::random::{Random, mix};
use nalgebra::{UnitQuaternion, Vector3};
use scene::camera::ParamKind;
use scene::{ImageId, KeypointIndex, Observation, Reconstruction, Rigid3};
use serde::{Deserialize, Serialize};

/// Standard deviations of what [`perturb`] adds; zero leaves a part as it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseOptions {
    /// Keypoints, pixels.
    pub observations_px: f64,
    /// Share of the observations moved to a random place of their image.
    pub outlier_share: f64,
    /// Points, in the unit of the world.
    pub points: f64,
    /// Positions of the rig, in the unit of the world.
    pub positions: f64,
    /// Rotations of the rig, degrees about each axis.
    pub rotations_deg: f64,
    /// Positions of the cameras in the rig but the first, in the unit of the world.
    pub mounting: f64,
    /// Rotations of the cameras in the rig but the first, degrees.
    pub mounting_deg: f64,
    /// Principal distance, as a share of it.
    pub focal_share: f64,
    /// Principal point, pixels.
    pub principal_point_px: f64,
    /// Distortion coefficients.
    pub distortion: f64,
    /// Seed.
    pub seed: u64,
}

/// Adds noise to everything that the options name; returns the observations moved to wrong places, sorted.
pub fn perturb(reconstruction: &mut Reconstruction, options: &NoiseOptions) -> Vec<Observation> {
    let stream = |part: u64| Random::new(mix(options.seed ^ mix(0x0A15E + part)));
    move_keypoints(reconstruction, options.observations_px, &mut stream(0));
    let outliers = misplace(reconstruction, options.outlier_share, &mut stream(1));
    let mut random = stream(2);
    for point in &mut reconstruction.points {
        point.xyz += normal3(&mut random) * options.points;
    }
    let mut random = stream(3);
    for pose in reconstruction.frames.iter_mut().filter_map(|frame| frame.rig_from_world.as_mut()) {
        *pose = moved(pose, options.positions, options.rotations_deg, &mut random);
    }
    let mut random = stream(4);
    for sensor in reconstruction.rigs.iter_mut().flat_map(|rig| rig.sensors.iter_mut().skip(1)) {
        sensor.cam_from_rig = moved(&sensor.cam_from_rig, options.mounting, options.mounting_deg, &mut random);
    }
    move_interior(reconstruction, options, &mut stream(5));
    outliers
}

fn normal3(random: &mut Random) -> Vector3<f64> {
    Vector3::new(random.normal(), random.normal(), random.normal())
}

/// The centre moved by `position` and the rotation turned by `rotation_deg`, standard deviations of each axis.
fn moved(pose: &Rigid3, position: f64, rotation_deg: f64, random: &mut Random) -> Rigid3 {
    let turn = UnitQuaternion::from_scaled_axis(normal3(random) * rotation_deg.to_radians());
    let centre = pose.centre() + normal3(random) * position;
    let rotation = turn * pose.rotation;
    Rigid3::new(rotation, -(rotation * centre))
}

fn move_keypoints(reconstruction: &mut Reconstruction, sigma_px: f64, random: &mut Random) {
    if sigma_px > 0.0 {
        for value in reconstruction.keypoints.iter_mut().flatten().flatten() {
            *value += (sigma_px * random.normal()) as f32;
        }
    }
}

fn misplace(reconstruction: &mut Reconstruction, share: f64, random: &mut Random) -> Vec<Observation> {
    let mut outliers = Vec::new();
    if share <= 0.0 {
        return outliers;
    }
    for (i, keypoints) in reconstruction.keypoints.iter_mut().enumerate() {
        let camera = &reconstruction.cameras[reconstruction.images[i].camera.index()];
        for (k, keypoint) in keypoints.iter_mut().enumerate() {
            if random.unit() < share {
                *keypoint = [camera.width(), camera.height()].map(|size| random.range(0.0, f64::from(size)) as f32);
                outliers.push(Observation { image: ImageId::new(i), keypoint: KeypointIndex::new(k) });
            }
        }
    }
    outliers
}

fn move_interior(reconstruction: &mut Reconstruction, options: &NoiseOptions, random: &mut Random) {
    for camera in &mut reconstruction.cameras {
        let kinds = camera.model().param_kinds();
        for (param, kind) in camera.params_mut().iter_mut().zip(kinds) {
            let draw = random.normal();
            *param += draw
                * match kind {
                    ParamKind::Focal => options.focal_share * *param,
                    ParamKind::PrincipalPoint => options.principal_point_px,
                    ParamKind::Distortion => options.distortion,
                };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{GeometryOptions, geometry};

    fn truth() -> Reconstruction {
        let mut options = GeometryOptions::default();
        options.motion.frames = 100;
        geometry(&options).expect("possible").truth
    }

    #[test]
    fn nothing_asked_for_changes_nothing() {
        let truth = truth();
        let mut same = truth.clone();
        assert!(perturb(&mut same, &NoiseOptions { seed: 5, ..NoiseOptions::default() }).is_empty());
        // Poses go through their centres and back: the last digits may change.
        same.frames.iter_mut().zip(&truth.frames).for_each(|(a, b)| {
            let (x, y) = (a.rig_from_world.expect("posed"), b.rig_from_world.expect("posed"));
            assert!((x.centre() - y.centre()).norm() < 1e-12 && x.rotation.angle_to(&y.rotation) < 1e-7);
            a.rig_from_world = b.rig_from_world;
        });
        for (a, b) in same.rigs[0].sensors.iter_mut().zip(&truth.rigs[0].sensors) {
            assert!((a.cam_from_rig.centre() - b.cam_from_rig.centre()).norm() < 1e-12);
            a.cam_from_rig = b.cam_from_rig;
        }
        assert_eq!(same, truth);
    }

    #[test]
    fn each_part_moves_by_its_deviation_and_no_other_does() {
        let truth = truth();
        let noisy = |options: NoiseOptions| {
            let mut out = truth.clone();
            let outliers = perturb(&mut out, &NoiseOptions { seed: 9, ..options });
            (out, outliers)
        };
        let rms = |values: Vec<f64>| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        let (moved, _) = noisy(NoiseOptions { positions: 0.1, rotations_deg: 2.0, ..NoiseOptions::default() });
        let pairs = || moved.frames.iter().zip(&truth.frames).filter_map(|(a, b)| Some((a.rig_from_world?, b.rig_from_world?)));
        let way = rms(pairs().flat_map(|(a, b)| (a.centre() - b.centre()).iter().copied().collect::<Vec<_>>()).collect());
        let angle = rms(pairs().map(|(a, b)| a.rotation.angle_to(&b.rotation).to_degrees()).collect());
        // 300 coordinates: a standard error of 4 %; an angle about three axes is root 3 of one.
        assert!((way / 0.1 - 1.0).abs() < 0.16 && (angle / (2.0 * 3f64.sqrt()) - 1.0).abs() < 0.2, "{way} {angle}");
        assert_eq!((&moved.points, &moved.cameras), (&truth.points, &truth.cameras));

        let (moved, outliers) = noisy(NoiseOptions { outlier_share: 0.1, ..NoiseOptions::default() });
        let all = truth.keypoints.iter().map(Vec::len).sum::<usize>() as f64;
        assert!((outliers.len() as f64 / all - 0.1).abs() < 0.02);
        let changed = moved.keypoints.iter().flatten().zip(truth.keypoints.iter().flatten()).filter(|(a, b)| a != b).count();
        assert_eq!(changed, outliers.len());

        let (moved, _) = noisy(NoiseOptions { focal_share: 0.01, principal_point_px: 3.0, mounting: 0.01, ..NoiseOptions::default() });
        for (a, b) in moved.cameras.iter().zip(&truth.cameras) {
            assert!(a.params()[0] != b.params()[0] && (a.params()[0] / b.params()[0] - 1.0).abs() < 0.05);
            assert!(a.params()[1] != b.params()[1] && a.params()[3] == b.params()[3]);
        }
        assert_eq!(moved.rigs[0].sensors[0], truth.rigs[0].sensors[0], "the first camera is the frame of the rig");
        assert_ne!(moved.rigs[0].sensors[1], truth.rigs[0].sensors[1]);
    }
}
