//! Outliers, points behind cameras, degenerate geometry.

use super::scene::{Options, distance_to_truth, perturb, truth};
use crate::adjust::*;
use crate::testing::Random;
use nalgebra::{Vector2, Vector3};

#[test]
fn losses_resist_outliers() {
    let truth = truth(&Options { frames: 8, points: 150, track: 8, noise_px: 0.2, ..Options::default() });
    let mut start = truth.clone();
    let mut random = Random::new(4);
    for o in start.observations.iter_mut().step_by(20) {
        o.pixel += Vector2::new(random.uniform(-60.0, 60.0), random.uniform(-60.0, 60.0));
    }
    perturb(&mut start, 0.005, 4);
    let run = |loss| {
        let mut problem = start.clone();
        let summary = adjust(&mut problem, &AdjustOptions { loss, max_iterations: 100, ..AdjustOptions::default() }).expect("valid");
        assert!(summary.final_cost <= summary.initial_cost && summary.termination.is_converged(), "{summary:?}");
        (distance_to_truth(&problem, &truth, false), summary)
    };
    let (plain, _) = run(Loss::Trivial);
    let (huber, _) = run(Loss::Huber { scale_px: 1.0 });
    let (soft, _) = run(Loss::SoftL1 { scale_px: 1.0 });
    let (cauchy, summary) = run(Loss::Cauchy { scale_px: 1.0 });
    assert!(huber < 0.5 * plain && soft < 0.5 * plain && cauchy < 0.2 * plain, "{plain} {huber} {soft} {cauchy}");
    // A few times what 0.2 px mean at 3 m with a focal length of 900 px.
    assert!(cauchy < 0.01, "{cauchy}");
    assert!(summary.reprojection.median_px < 0.5 && summary.reprojection.max_px > 10.0);
}

#[test]
fn observations_from_behind_are_left_out() {
    let truth = truth(&Options::default());
    let mut problem = truth.clone();
    // Behind all six cameras.
    problem.points[7].xyz = Vector3::new(0.0, 0.0, -50.0);
    let summary = adjust(&mut problem, &AdjustOptions::default()).expect("valid");
    assert_eq!((summary.observations_left_out, summary.observations), (6, 6 * 59));
    assert_eq!(problem.points[7].xyz, Vector3::new(0.0, 0.0, -50.0));
    assert!(summary.final_cost < 1e-12);
}

#[test]
fn a_point_that_a_step_takes_behind_the_camera_does_not_stop_the_others() {
    let truth = truth(&Options { noise_px: 0.2, ..Options::default() });
    let mut problem = truth.clone();
    problem.frames.iter_mut().for_each(|f| f.free = false);
    perturb(&mut problem, 0.02, 5);
    // Two observations along diverging rays: the best point lies behind both cameras, and a Gauss-Newton step goes there.
    problem.observations.retain(|o| o.point != 11 || o.frame < 2);
    for o in problem.observations.iter_mut().filter(|o| o.point == 11) {
        o.pixel = Vector2::new(if o.frame == 0 { 1240.0 } else { 40.0 }, 360.0);
    }
    let summary = adjust(&mut problem, &AdjustOptions { max_iterations: 100, ..AdjustOptions::default() }).expect("valid");
    assert!(summary.final_cost.is_finite() && summary.final_cost < summary.initial_cost);
    assert!(problem.points.iter().all(|p| p.xyz.iter().all(|x| x.is_finite())));
    assert_eq!(summary.observations_left_out, 0);
    // All the others are explained to the noise.
    assert!(summary.reprojection.median_px < 0.4, "{summary:?}");
    for o in problem.observations.iter().filter(|o| o.point == 11) {
        let x = problem.frames[o.frame as usize].pose.apply(&problem.points[11].xyz);
        assert!(x.z > 0.0);
    }
}

#[test]
fn points_and_frames_that_are_not_determined_stay_finite() {
    let mut problem = truth(&Options { noise_px: 0.3, ..Options::default() });
    // A point with one observation, one with two from the same place, and a frame with a single observation.
    problem.observations.retain(|o| (o.point != 3 || o.frame == 0) && (o.frame != 5 || o.point == 8));
    let twin = *problem.observations.iter().find(|o| o.point == 3).expect("kept");
    problem.observations.push(twin);
    perturb(&mut problem, 0.01, 6);
    let summary = adjust(&mut problem, &AdjustOptions { function_tolerance: 1e-12, ..AdjustOptions::default() }).expect("valid");
    assert!(summary.final_cost < 0.01 * summary.initial_cost, "{summary:?}");
    assert!(problem.points.iter().all(|p| p.xyz.norm() < 100.0));
}

#[test]
fn a_focal_length_never_becomes_negative() {
    let mut problem = truth(&Options { noise_px: 0.5, ..Options::default() });
    problem.cameras[0].free[0] = true;
    // 900 px seen as 90: far away.
    problem.cameras[0].camera.params_mut()[0] = 90.0;
    let summary = adjust(&mut problem, &AdjustOptions { max_iterations: 200, ..AdjustOptions::default() }).expect("valid");
    assert!(problem.cameras[0].camera.params()[0] > 0.0);
    assert!(summary.final_cost.is_finite() && summary.final_cost <= summary.initial_cost);
}
