//! Problems without something, and input that is refused.

use super::scene::{Options, distance_to_truth, perturb, truth};
use crate::adjust::*;
use nalgebra::Vector3;

#[test]
fn empty_problems_have_nothing_to_adjust() {
    let summary = adjust(&mut Problem::default(), &AdjustOptions::default()).expect("valid");
    assert_eq!((summary.termination, summary.final_cost, summary.residuals), (Termination::NothingToAdjust, 0.0, 0));
    let mut fixed = truth(&Options { noise_px: 1.0, ..Options::default() });
    fixed.frames.iter_mut().for_each(|f| f.free = false);
    fixed.points.iter_mut().for_each(|p| p.free = false);
    let before = fixed.clone();
    let summary = adjust(&mut fixed, &AdjustOptions::default()).expect("valid");
    assert_eq!((summary.termination, &fixed), (Termination::NothingToAdjust, &before));
    assert!(summary.final_cost > 0.0 && summary.reprojection.rms_px > 0.5);
}

#[test]
fn blocks_that_nothing_refers_to_stay() {
    let mut problem = truth(&Options::default());
    perturb(&mut problem, 0.01, 1);
    let (frame, point) = (problem.frames[0], problem.points[0]);
    problem.frames.push(frame);
    problem.points.push(PointBlock { xyz: Vector3::new(9.0, 9.0, 9.0), ..point });
    let summary = adjust(&mut problem, &AdjustOptions::default()).expect("valid");
    assert_eq!((summary.free.frames, summary.free.points), (6, 60));
    assert_eq!(problem.frames[6].pose, frame.pose);
    assert_eq!(problem.points[60].xyz, Vector3::new(9.0, 9.0, 9.0));
}

#[test]
fn poses_alone_and_points_alone_find_the_truth() {
    let truth = truth(&Options::default());
    let options = AdjustOptions { function_tolerance: 1e-14, ..AdjustOptions::default() };
    for fix_points in [true, false] {
        let mut problem = truth.clone();
        problem.points.iter_mut().for_each(|p| p.free = !fix_points);
        problem.frames.iter_mut().for_each(|f| f.free = fix_points);
        perturb(&mut problem, 0.05, 2);
        let summary = adjust(&mut problem, &options).expect("valid");
        assert!(summary.final_cost < 1e-14, "{summary:?}");
        assert!(distance_to_truth(&problem, &truth, true) < 1e-8);
        assert_eq!(summary.free.total, if fix_points { 36 } else { 180 });
    }
}

#[test]
fn two_observations_of_a_point_in_one_image_both_count() {
    let mut problem = truth(&Options::default());
    problem.frames.iter_mut().for_each(|f| f.free = false);
    problem.observations.truncate(1);
    let twin = problem.observations[0];
    problem.observations.push(ImageObservation { pixel: twin.pixel.add_scalar(1.0), ..twin });
    let summary = adjust(&mut problem, &AdjustOptions::default()).expect("valid");
    // They contradict each other by 1 px along both axes: half a pixel is left for each.
    assert!((summary.final_cost - 0.5 * 4.0 * 0.25).abs() < 1e-9, "{summary:?}");
}

#[test]
fn iterations_are_limited() {
    let mut problem = truth(&Options::default());
    perturb(&mut problem, 0.03, 3);
    let before = problem.clone();
    let summary = adjust(&mut problem, &AdjustOptions { max_iterations: 0, ..AdjustOptions::default() }).expect("valid");
    assert_eq!((summary.iterations, summary.termination, &problem), (0, Termination::MaxIterations, &before));
    let summary = adjust(&mut problem, &AdjustOptions { max_iterations: 1, ..AdjustOptions::default() }).expect("valid");
    assert_eq!((summary.iterations, summary.termination), (1, Termination::MaxIterations));
    assert!(summary.final_cost < summary.initial_cost);
}

#[test]
fn impossible_input_is_refused_by_name() {
    let sound = truth(&Options::default());
    let refused = |change: &dyn Fn(&mut Problem)| {
        let mut problem = sound.clone();
        change(&mut problem);
        let before = problem.clone();
        let error = adjust(&mut problem, &AdjustOptions::default()).expect_err("refused");
        // NaN is not equal to itself.
        assert_eq!(format!("{problem:?}"), format!("{before:?}"));
        error.to_string()
    };
    assert_eq!(refused(&|p| p.observations[3].frame = 6), "observation 3 refers to frame 6, but there are only 6");
    assert_eq!(refused(&|p| p.observations[0].sensor = 9), "observation 0 refers to sensor 9, but there are only 1");
    assert_eq!(refused(&|p| p.observations[0].camera = 1), "observation 0 refers to camera 1, but there are only 1");
    assert_eq!(refused(&|p| p.observations[0].point = u32::MAX), "observation 0 refers to point 4294967295, but there are only 60");
    assert_eq!(refused(&|p| p.observations[5].pixel.y = f64::NAN), "observation 5: pixel is not finite");
    assert_eq!(refused(&|p| p.observations[5].sigma_px = 0.0), "observation 5: sigma_px = 0 is not positive");
    assert_eq!(refused(&|p| p.points[2].xyz.x = f64::INFINITY), "point 2: position is not finite");
    assert_eq!(refused(&|p| p.frames[1].pose.translation.x = f64::NAN), "frame 1: pose is not finite");
    assert_eq!(refused(&|p| p.cameras[0].camera.params_mut()[0] = f64::NAN), "camera 0: parameter is not finite");
    assert_eq!(
        refused(&|p| p.cameras[0].priors[0] = Some(ParamPrior { value: 1.0, sigma: -1.0 })),
        "camera 0: sigma of a prior = -1 is not positive"
    );
    let baseline = Baseline { a: (0, 0), b: (1, 0), length: 1.0, sigma: 0.1 };
    assert_eq!(refused(&|p| p.baselines = vec![Baseline { length: -1.0, ..baseline }]), "baseline 0: length = -1 is not positive");
    assert_eq!(refused(&|p| p.baselines = vec![Baseline { b: (0, 0), ..baseline }]), "baseline 0: both ends are the same");
    assert_eq!(refused(&|p| p.baselines = vec![Baseline { b: (7, 0), ..baseline }]), "baseline 0 refers to frame 7, but there are only 6");
    let bar = ScaleBar { a: 0, b: 1, length: 1.0, sigma: f64::NAN };
    assert_eq!(refused(&|p| p.scale_bars = vec![bar]), "scale bar 0: sigma = NaN is not positive");
    for options in [
        AdjustOptions { function_tolerance: -1.0, ..AdjustOptions::default() },
        AdjustOptions { initial_radius: 0.0, ..AdjustOptions::default() },
        AdjustOptions { loss: Loss::Cauchy { scale_px: f64::NAN }, ..AdjustOptions::default() },
    ] {
        assert!(matches!(adjust(&mut sound.clone(), &options), Err(AdjustError::BadOption { .. })));
    }
}
