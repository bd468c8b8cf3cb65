//! Whole adjustments of scenes with known truth.

use super::scene::{Options, distance_to_truth, free_camera, perturb, truth};
use crate::adjust::*;
use ::scene::CameraModel;

fn tight() -> AdjustOptions {
    AdjustOptions {
        function_tolerance: 1e-15,
        parameter_tolerance: 1e-14,
        gradient_tolerance: 1e-12,
        max_iterations: 100,
        ..AdjustOptions::default()
    }
}

#[test]
fn exact_observations_give_the_truth() {
    for model in CameraModel::ALL {
        let truth = truth(&Options { model, ..Options::default() });
        let mut problem = truth.clone();
        perturb(&mut problem, 0.03, 2);
        let summary = adjust(&mut problem, &tight()).expect("valid");
        assert!(summary.termination.is_converged() || summary.final_cost < 1e-18, "{summary:?}");
        assert!(summary.final_cost < 1e-16 && summary.initial_cost > 100.0, "{summary:?}");
        // Lengths are about 1: 1e-9 px of a focal length of 900 px, magnified by weak directions.
        assert!(distance_to_truth(&problem, &truth, false) < 1e-8, "{model:?}");
    }
}

#[test]
fn a_rig_with_baselines_is_metric() {
    let mut truth = truth(&Options { sensors: 3, frames: 5, points: 50, track: 5, ..Options::default() });
    let centre = |i: usize| truth.sensors[i].pose.centre();
    let lengths = [(0, 1, (centre(0) - centre(1)).norm()), (0, 2, (centre(0) - centre(2)).norm())];
    truth.baselines = lengths.map(|(a, b, length)| Baseline { a: (0, a), b: (0, b), length, sigma: 0.001 }).to_vec();
    truth.cameras.iter_mut().for_each(free_camera);
    let mut problem = truth.clone();
    perturb(&mut problem, 0.02, 5);
    let summary = adjust(&mut problem, &tight()).expect("valid");
    assert!(summary.final_cost < 1e-14, "{summary:?}");
    assert!(distance_to_truth(&problem, &truth, true) < 1e-6, "{}", distance_to_truth(&problem, &truth, true));
    for (found, truth) in problem.cameras.iter().zip(&truth.cameras) {
        for (p, q) in found.camera.params().iter().zip(truth.camera.params()) {
            assert!((p - q).abs() < 1e-5 * (1.0 + q.abs()), "{p} {q}");
        }
    }
    assert_eq!(summary.free, ParameterCounts { frames: 5, sensors: 2, camera_parameters: 15, points: 50, total: 30 + 12 + 15 + 150 });
    assert_eq!(summary.residuals, 2 * 750 + 2);
}

#[test]
fn noise_is_explained_as_the_degrees_of_freedom_say() {
    let truth = truth(&Options { frames: 8, points: 300, track: 8, noise_px: 0.5, ..Options::default() });
    let mut problem = truth.clone();
    perturb(&mut problem, 0.02, 6);
    let summary = adjust(&mut problem, &tight()).expect("valid");
    // Twice the cost over the variance is chi-square distributed with as many degrees of freedom as residuals minus
    // parameters, of which 7 are gauge.
    let freedom = (summary.residuals - summary.free.total + 7) as f64;
    let chi_square = 2.0 * summary.final_cost / 0.25;
    assert!((chi_square - freedom).abs() < 4.0 * (2.0 * freedom).sqrt(), "{chi_square} {freedom}");
    assert!(
        (summary.reprojection.rms_px.powi(2) * summary.observations as f64 - 2.0 * summary.final_cost).abs() < 1e-9 * summary.final_cost
    );
}

/// Largest change of a parameter, relative to its size.
fn largest_change(a: &Problem, b: &Problem) -> f64 {
    let values = |p: &Problem| {
        let poses = p
            .frames
            .iter()
            .chain(&p.sensors)
            .flat_map(|f| f.pose.rotation.coords.iter().chain(f.pose.translation.iter()).copied().collect::<Vec<_>>());
        let points = p.points.iter().flat_map(|x| x.xyz.iter().copied().collect::<Vec<_>>());
        let cameras = p.cameras.iter().flat_map(|c| c.camera.params().to_vec());
        poses.chain(points).chain(cameras).collect::<Vec<_>>()
    };
    values(a).iter().zip(values(b)).map(|(x, y)| (x - y).abs() / (1.0 + x.abs())).fold(0.0, f64::max)
}

#[test]
fn a_second_call_changes_nothing() {
    let mut problem = truth(&Options { sensors: 2, frames: 6, points: 80, track: 6, noise_px: 0.4, ..Options::default() });
    // Two fixed frames and a baseline: nothing is left undetermined.
    problem.frames[0].free = false;
    problem.frames[5].free = false;
    problem.cameras.iter_mut().for_each(free_camera);
    perturb(&mut problem, 0.01, 7);
    let first = adjust(&mut problem, &tight()).expect("valid");
    let before = problem.clone();
    let second = adjust(&mut problem, &tight()).expect("valid");
    assert!(largest_change(&before, &problem) < 1e-8, "{} {first:?} {second:?}", largest_change(&before, &problem));
    assert!((first.final_cost - second.final_cost).abs() <= 1e-12 * first.final_cost);
}

#[test]
fn sparse_and_dense_systems_lead_to_one_minimum() {
    // 80 frames, 480 unknowns, of which a frame meets 8 others: sparse.
    let mut sparse = truth(&Options { frames: 80, points: 900, track: 5, arc: 0.02, noise_px: 0.5, ..Options::default() });
    sparse.frames[0].free = false;
    sparse.frames[79].free = false;
    let mut dense = sparse.clone();
    // One baseline from each frame to the next but one, so weak that it changes nothing, does not change the pattern much;
    // a camera that all share does not either. What makes it dense is every frame meeting every other.
    for a in 1..79 {
        dense.baselines.extend((0..a).map(|b| Baseline { a: (a, 0), b: (b, 0), length: 1.0, sigma: 1e9 }));
    }
    perturb(&mut sparse, 0.005, 8);
    perturb(&mut dense, 0.005, 8);
    let [a, b] = [&mut sparse, &mut dense].map(|p| adjust(p, &tight()).expect("valid"));
    assert!((a.final_cost - b.final_cost).abs() < 1e-9 * a.final_cost, "{} {}", a.final_cost, b.final_cost);
    assert!(largest_change(&sparse, &dense) < 1e-6, "{}", largest_change(&sparse, &dense));
}

#[test]
fn bits_do_not_depend_on_threads() {
    for track in [4, 60] {
        let mut start = truth(&Options {
            sensors: 2,
            frames: 60,
            points: if track == 4 { 900 } else { 60 },
            track,
            arc: 0.02,
            noise_px: 0.5,
            ..Options::default()
        });
        start.cameras.iter_mut().for_each(free_camera);
        perturb(&mut start, 0.005, 9);
        assert!(start.observations.len() > 4000);
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let mut problem = start.clone();
            let options = AdjustOptions { loss: Loss::Cauchy { scale_px: 1.0 }, max_iterations: 8, ..AdjustOptions::default() };
            let summary = pool.install(|| adjust(&mut problem, &options)).expect("valid");
            (problem, summary)
        };
        let [one, two, three] = [1, 2, 3].map(run);
        assert_eq!(one, two);
        assert_eq!(one, three);
    }
}

/// The paper behind this project saw its tool give other and better results the more often it was called.
#[test]
fn an_adjusted_problem_stays_as_it_is() {
    let converged = AdjustOptions { function_tolerance: 0.0, parameter_tolerance: 1e-9, max_iterations: 200, ..AdjustOptions::default() };
    for loss in [Loss::Trivial, Loss::Cauchy { scale_px: 1.0 }, Loss::SoftL1 { scale_px: 1.0 }] {
        for metric in [false, true] {
            let mut problem = truth(&Options { sensors: 2, frames: 8, points: 200, track: 5, noise_px: 0.5, ..Options::default() });
            if metric {
                problem.baselines = vec![Baseline { a: (0, 0), b: (0, 1), length: 0.3, sigma: 0.001 }];
            }
            problem.cameras.iter_mut().for_each(free_camera);
            perturb(&mut problem, 0.01, 7);
            for o in problem.observations.iter_mut().step_by(40) {
                o.pixel.x += 25.0;
            }
            let options = AdjustOptions { loss, ..converged };
            let first = adjust(&mut problem, &options).expect("valid");
            assert_eq!(first.termination, Termination::ParameterTolerance, "{loss:?} {metric}: {first:?}");
            let once = problem.clone();
            let second = adjust(&mut problem, &options).expect("valid");
            assert_eq!((second.termination, second.steps_taken), (Termination::ParameterTolerance, 0), "{loss:?} {metric}: {second:?}");
            assert!(problem == once);
            // From elsewhere to the same place, where the world has one.
            if metric {
                let mut other = once.clone();
                other.frames[0].free = false;
                perturb(&mut other, 1e-3, 8);
                adjust(&mut other, &options).expect("valid");
                assert!((other.cameras[0].camera.params()[0] / once.cameras[0].camera.params()[0] - 1.0).abs() < 1e-8);
            }
        }
    }
}
