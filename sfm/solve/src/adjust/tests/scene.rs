//! Synthetic problems with known answers.

use crate::adjust::*;
use crate::testing::Random;
use ::scene::camera::MAX_CAMERA_PARAMS;
use ::scene::{Camera, CameraModel, Rigid3, Similarity3};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// What to make: a rig that moves along an arc of 2 m radius about a cloud of points within 1 m.
#[derive(Clone, Copy)]
pub struct Options {
    pub frames: usize,
    pub sensors: usize,
    pub points: usize,
    /// Radians between consecutive frames.
    pub arc: f64,
    /// Each point is seen by every sensor of that many consecutive frames.
    pub track: usize,
    pub noise_px: f64,
    pub model: CameraModel,
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { frames: 6, sensors: 1, points: 60, arc: 0.15, track: 6, noise_px: 0.0, model: CameraModel::Radial, seed: 1 }
    }
}

fn camera(model: CameraModel) -> Camera {
    let params: &[f64] = match model {
        CameraModel::Pinhole => &[900.0, 905.0, 640.0, 360.0],
        CameraModel::SimpleRadial => &[900.0, 640.0, 360.0, -0.05],
        CameraModel::Radial => &[900.0, 640.0, 360.0, -0.05, 0.02],
        CameraModel::OpenCv => &[900.0, 905.0, 640.0, 360.0, -0.05, 0.02, 0.001, -0.002],
        CameraModel::Fisheye => &[600.0, 605.0, 640.0, 360.0, 0.02, -0.01, 0.003, -0.001],
        CameraModel::Brown => &[900.0, 640.0, 360.0, -0.05, 0.02, -0.003, 0.001, -0.002, 0.003, -0.001],
    };
    Camera::new(model, 1280, 720, params).expect("valid")
}

/// The true problem, with observations of the true scene (plus noise). Everything is free but the first sensor, which
/// is the identity, and the cameras.
pub fn truth(o: &Options) -> Problem {
    let mut random = Random::new(o.seed);
    let mut problem = Problem::default();
    for s in 0..o.sensors {
        let offset = Vector3::new(-0.3 * s as f64, 0.02 * s as f64, 0.0);
        let pose = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::new(0.01, 0.06, -0.02) * s as f64), offset);
        problem.sensors.push(PoseBlock { free: s > 0, ..PoseBlock::fixed(pose) });
        problem.cameras.push(CameraBlock::fixed(camera(o.model)));
    }
    for f in 0..o.frames {
        let angle = o.arc * f as f64;
        // At (sin, 0, -cos) * 3, looking at the origin.
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, angle, 0.0));
        let centre = Vector3::new(-3.0 * angle.sin(), 0.1 * (f as f64).sin(), -3.0 * angle.cos());
        let rotation = random.rotation(0.05) * rotation.inverse();
        problem.frames.push(PoseBlock::free(Rigid3::new(rotation, -(rotation * centre))));
    }
    for p in 0..o.points {
        let xyz = random.vector(0.6);
        problem.points.push(PointBlock { xyz, free: true });
        let first = if o.track >= o.frames { 0 } else { p * (o.frames - o.track + 1) / o.points };
        for f in first..(first + o.track).min(o.frames) {
            for s in 0..o.sensors {
                let x_in_cam = (problem.sensors[s].pose * problem.frames[f].pose).apply(&xyz);
                let exact = problem.cameras[s].camera.project(&x_in_cam).expect("the scene is in front");
                let noise = Vector2::new(random.normal(), random.normal()) * o.noise_px;
                let (frame, sensor, camera, point) = (f as u32, s as u32, s as u32, p as u32);
                problem.observations.push(ImageObservation { frame, sensor, camera, point, pixel: exact + noise, sigma_px: 1.0 });
            }
        }
    }
    problem
}

pub fn free_camera(block: &mut CameraBlock) {
    block.free = [true; MAX_CAMERA_PARAMS];
}

/// Moves everything that is free: angles and lengths by about `size`, camera parameters by `size` of themselves.
pub fn perturb(problem: &mut Problem, size: f64, seed: u64) {
    let mut random = Random::new(seed);
    for block in problem.sensors.iter_mut().chain(&mut problem.frames).filter(|b| b.free) {
        let turn = crate::lie::so3_exp(&random.vector(size));
        block.pose = Rigid3::new(turn * block.pose.rotation, block.pose.translation + random.vector(size));
    }
    for point in problem.points.iter_mut().filter(|p| p.free) {
        point.xyz += random.vector(size);
    }
    for block in &mut problem.cameras {
        let free = block.free;
        for (p, _) in block.camera.params_mut().iter_mut().zip(free).filter(|(_, f)| *f) {
            *p *= 1.0 + random.uniform(-size, size);
        }
    }
}

/// Projection centres of the frames.
pub fn centres(problem: &Problem) -> Vec<Vector3<f64>> {
    problem.frames.iter().map(|f| f.pose.centre()).collect()
}

/// Largest distance of points and centres to the truth, after a similarity on the points (a rigid motion where `metric`).
pub fn distance_to_truth(problem: &Problem, truth: &Problem, metric: bool) -> f64 {
    let all = |p: &Problem| p.points.iter().map(|p| p.xyz).chain(centres(p)).collect::<Vec<_>>();
    let (found, truth) = (all(problem), all(truth));
    let align = Similarity3::align(&found, &truth, !metric).expect("points span a volume");
    found.iter().zip(&truth).map(|(x, y)| (align.apply(x) - y).norm()).fold(0.0, f64::max)
}
