//! Lengths and priors.

use super::scene::{Options, centres, perturb, truth};
use crate::adjust::*;
use crate::testing::Random;
use ::scene::camera::MAX_CAMERA_PARAMS;
use ::scene::{Camera, CameraModel, Rigid3};
use nalgebra::{UnitQuaternion, Vector3};

#[test]
fn a_wrong_baseline_shows_in_its_residual() {
    let mut problem = truth(&Options { frames: 8, points: 100, track: 8, noise_px: 0.1, ..Options::default() });
    problem.observations.iter_mut().for_each(|o| o.sigma_px = 0.1);
    let centres = centres(&problem);
    let between = |a: usize, b: usize, error: f64| {
        let length = (centres[a] - centres[b]).norm() + error;
        Baseline { a: (a as u32, 0), b: (b as u32, 0), length, sigma: 0.001 }
    };
    problem.baselines = vec![between(0, 4, 0.0), between(1, 5, 0.0), between(2, 6, 0.03), between(3, 7, 0.0), between(0, 7, 0.0)];
    perturb(&mut problem, 0.01, 2);
    let summary = adjust(&mut problem, &AdjustOptions::default()).expect("valid");
    let residuals: Vec<f64> = summary.baselines.iter().map(|b| b.normalised_residual).collect();
    // Found is shorter than the wrong length, by much more than three sigma and than any other's error.
    assert!(residuals[2] < -10.0, "{residuals:?}");
    assert!(residuals.iter().enumerate().all(|(i, r)| i == 2 || r.abs() < 0.7 * residuals[2].abs()), "{residuals:?}");
    for (b, given) in summary.baselines.iter().zip(&problem.baselines) {
        assert_eq!((b.given, b.sigma), (given.length, given.sigma));
        assert_eq!(b.normalised_residual, (b.found - b.given) / b.sigma);
    }
}

#[test]
fn scale_bars_set_the_scale() {
    let mut problem = truth(&Options { noise_px: 0.0, ..Options::default() });
    let true_length = (problem.points[0].xyz - problem.points[9].xyz).norm();
    problem.scale_bars = vec![ScaleBar { a: 0, b: 9, length: 2.0 * true_length, sigma: 0.001 }];
    let other = (problem.points[20].xyz - problem.points[30].xyz).norm();
    let options = AdjustOptions { function_tolerance: 1e-14, parameter_tolerance: 1e-14, ..AdjustOptions::default() };
    let summary = adjust(&mut problem, &options).expect("valid");
    assert!(summary.final_cost < 1e-12, "{summary:?}");
    assert!((summary.scale_bars[0].found - 2.0 * true_length).abs() < 1e-8);
    assert!(((problem.points[20].xyz - problem.points[30].xyz).norm() - 2.0 * other).abs() < 1e-7);
}

#[test]
fn alone_a_prior_is_met() {
    let mut random = Random::new(3);
    for _ in 0..20 {
        let prior = Rigid3::new(random.rotation(3.0), random.vector(5.0));
        let start = Rigid3::new(random.rotation(1.0) * prior.rotation, random.vector(5.0));
        let block =
            PoseBlock { pose: start, free: true, prior: Some(PosePrior { pose: prior, sigma_rotation_rad: 0.1, sigma_translation: 2.0 }) };
        let camera = Camera::from_focal(CameraModel::Pinhole, 100, 100, 80.0).expect("valid");
        let mut cameras = CameraBlock { free: [true; MAX_CAMERA_PARAMS], ..CameraBlock::fixed(camera) };
        cameras.priors[1] = Some(ParamPrior { value: 95.0, sigma: 3.0 });
        let mut problem = Problem { frames: vec![block], sensors: vec![block], cameras: vec![cameras], ..Problem::default() };
        let summary = adjust(&mut problem, &AdjustOptions { gradient_tolerance: 1e-9, ..AdjustOptions::default() }).expect("valid");
        assert!(summary.final_cost < 1e-16, "{summary:?}");
        assert_eq!(summary.residuals, 13);
        for pose in [problem.frames[0].pose, problem.sensors[0].pose] {
            assert!(pose.rotation.angle_to(&prior.rotation) < 1e-7 && (pose.translation - prior.translation).norm() < 1e-6);
        }
        // Only what has a prior is adjusted.
        assert_eq!(problem.cameras[0].camera.params()[0], 80.0);
        assert!((problem.cameras[0].camera.params()[1] - 95.0).abs() < 1e-6);
    }
}

#[test]
fn priors_and_a_baseline_share_a_contradiction_by_their_weights() {
    // Two rigs expected 1 m apart to sigma s each, measured 1.2 m apart to sigma b. Each moves outwards by m with
    // 2 m^2 / s^2 + (2 m - 0.2)^2 / b^2 minimal: m = 0.2 s^2 / (2 s^2 + b^2).
    let (s, b) = (0.03, 0.05);
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5));
    let frames = [0.0, 1.0].map(|x| {
        let pose = Rigid3::new(rotation, -(rotation * Vector3::new(x, 2.0, -1.0)));
        PoseBlock { pose, free: true, prior: Some(PosePrior { pose, sigma_rotation_rad: 0.01, sigma_translation: s }) }
    });
    let mut problem = Problem {
        frames: frames.to_vec(),
        sensors: vec![PoseBlock::fixed(Rigid3::identity())],
        baselines: vec![Baseline { a: (0, 0), b: (1, 0), length: 1.2, sigma: b }],
        ..Problem::default()
    };
    let options = AdjustOptions { function_tolerance: 0.0, parameter_tolerance: 1e-13, ..AdjustOptions::default() };
    let summary = adjust(&mut problem, &options).expect("valid");
    let m = 0.2 * s * s / (2.0 * s * s + b * b);
    assert!((summary.baselines[0].found - (1.0 + 2.0 * m)).abs() < 1e-9, "{summary:?}");
    let expected = 0.5 * (2.0 * m * m / (s * s) + (0.2 - 2.0 * m).powi(2) / (b * b));
    assert!((summary.final_cost - expected).abs() < 1e-9 * expected);
    assert!((problem.frames[0].pose.centre() - Vector3::new(-m, 2.0, -1.0)).norm() < 1e-7);
}
