//! One camera.

use crate::exact::adjusted_truth;
use crate::support::{FLYING_HEIGHT_M, NOISE_PX, assert_near_optimum, focal, input, made, noisy, oriented};
use mapping::MapInput;
use scene::{Camera, CameraModel, Scale};
use synthetic::survey::{SurveyOptions, survey};
use synthetic::{Alignment, Random, Tolerances, assert_near, deviation};

#[test]
fn a_known_camera_gives_the_path_up_to_a_similarity() {
    let (made, input) = made(&noisy(1));
    let out = oriented(&input);
    assert_eq!(out.models[0].scale, Scale::Arbitrary);
    let d = assert_near_optimum(&out.models[0], &adjusted_truth(&made.truth, &input, false, false), &made.truth, Alignment::Sim3);
    println!("{d:?}");
    // In closed form: one keypoint is worth noise * height / focal length = 1.9 mm on the ground. Some 100 of them shared
    // by neighbours leave a tenth of it a step, five-fold because tilt and shift look nearly alike from above; 12 steps
    // add up to sqrt 12 of that.
    let step = 5.0 * NOISE_PX * FLYING_HEIGHT_M / focal(&made.truth.cameras[0]) / 10.0;
    assert!(d.max_centre.0 < 3.0 * step * 12f64.sqrt(), "{d:?}");
    // Two coordinates with noise; each point takes 3 parameters from its 2 n measurements, with n near 4 on average.
    let expected =
        NOISE_PX * (2.0 * (1.0 - 3.0 * out.models[0].points.len() as f64 / (2.0 * out.models[0].observation_count() as f64))).sqrt();
    let rms = out.models[0].reprojection_rms();
    assert!((rms / expected - 1.0).abs() < 0.05, "{rms}, expected {expected}");
}

#[test]
fn without_noise_the_truth_comes_out() {
    let (made, input) = made(&SurveyOptions { noise_px: 0.0, ..noisy(1) });
    let out = oriented(&input);
    // Keypoints are f32: an error of at most 3e-5 px, a 16,000th of the noise elsewhere, and so of its effect (1 cm).
    let tolerances = Tolerances { missing_images: 0, centre: 1e-5, rotation_rad: 1e-5, ..Tolerances::default() };
    assert_near(&out.models[0], &made.truth, &tolerances, Alignment::Sim3);
}

#[test]
fn a_guessed_interior_is_recovered() {
    for (k, guess) in [(-0.05, 1.2), (-0.15, 0.8)] {
        let camera = Camera::new(CameraModel::SimpleRadial, 960, 600, &[800.0, 480.0, 300.0, k]).expect("valid");
        let made = survey(&SurveyOptions { camera, points: 4000, ..noisy(1) });
        let mut input = input(&made);
        input.cameras[0].camera = Camera::from_focal(CameraModel::SimpleRadial, 960, 600, guess * 800.0).expect("valid");
        input.cameras[0].fixed = false;
        let out = oriented(&input);
        let optimum = adjusted_truth(&made.truth, &input, true, false);
        let d = assert_near_optimum(&out.models[0], &optimum, &made.truth, Alignment::Sim3);
        let (found, best) = (out.models[0].cameras[0].params(), optimum.cameras[0].params());
        println!("{d:?} {found:?} {best:?}");
        // As good as the optimum does with the same noise, and that must be good: the focal length of a path seen from
        // one height rests on its relief, a quarter of the height, and on the tilt.
        assert!((found[0] - 800.0).abs() <= 1.5 * (best[0] - 800.0).abs() + 0.1, "{found:?}, optimum {best:?}");
        assert!((found[3] - k).abs() <= 1.5 * (best[3] - k).abs() + 1e-4, "{found:?}, optimum {best:?}");
        assert!((found[0] / 800.0 - 1.0).abs() < 0.005, "{found:?}");
        // The principal point is not refined.
        assert_eq!(found[1..3], [480.0, 300.0]);
    }
}

#[test]
fn a_guess_far_off_gives_way_to_an_alternative() {
    // An action camera under water, where 1.2 times the longer side is the guess.
    let camera = Camera::new(CameraModel::Radial, 960, 600, &[660.0, 480.0, 300.0, 0.3, 0.1]).expect("valid");
    let made = survey(&SurveyOptions { camera, points: 4000, ..noisy(1) });
    let mut input = input(&made);
    let guess = |over_width: f64| Camera::from_focal(CameraModel::Radial, 960, 600, over_width * 960.0).expect("valid");
    input.cameras[0].fixed = false;
    input.cameras[0].camera = guess(3.0);
    input.cameras[0].alternatives = vec![guess(1.9), guess(0.7)];
    let found = oriented(&input).models[0].cameras[0].mean_focal();
    let best = adjusted_truth(&made.truth, &input, true, false).cameras[0].mean_focal();
    // As in the test above: as good as the optimum.
    assert!((found - 660.0).abs() <= 1.5 * (best - 660.0).abs() + 0.1, "{found}, optimum {best}");
}

#[test]
fn precise_keypoints_weigh_more() {
    let (made, mut input) = made(&SurveyOptions { noise_px: 0.0, ..noisy(1) });
    let mut random = Random::new(5);
    // Half of the keypoints are five times as good as the others.
    let sigma = |k: usize| if k.is_multiple_of(2) { 0.2f32 } else { 1.0 };
    for keypoints in &mut input.keypoints {
        for (k, at) in keypoints.iter_mut().enumerate() {
            *at = at.map(|x| x + sigma(k) * random.normal() as f32);
        }
    }
    let centre_error =
        |input: &MapInput| deviation(&oriented(input).models[0], &made.truth, Alignment::Sim3).expect("oriented").max_centre.0;
    let equal = centre_error(&input);
    input.sigmas_px = input.keypoints.iter().map(|some| (0..some.len()).map(sigma).collect()).collect();
    let weighted = centre_error(&input);
    // Mean of the variances 0.52, of the weights 13: sqrt(1 / (13 * 0.52)) = 0.38 in the mean of many such surveys.
    assert!(weighted < 0.6 * equal, "{weighted} weighted, {equal} not");
}

#[test]
fn parameters_are_held_weighed_and_free_one_by_one() {
    let camera = Camera::new(CameraModel::SimpleRadial, 960, 600, &[800.0, 480.0, 300.0, -0.05]).expect("valid");
    let made = survey(&SurveyOptions { camera, points: 4000, ..noisy(1) });
    let mut input = input(&made);
    // The principal point is 6 px off in y, and known to a pixel; x is held.
    input.cameras[0].camera = Camera::new(CameraModel::SimpleRadial, 960, 600, &[790.0, 480.5, 306.0, 0.0]).expect("valid");
    input.cameras[0].fixed = false;
    input.cameras[0].held = vec![false, true, false, false];
    let with = |sigma: f64| {
        let mut input = input.clone();
        input.cameras[0].sigmas = vec![None, None, Some(sigma), None];
        let out = oriented(&input);
        (out.models[0].cameras[0].params().to_vec(), out.summary.quality.expect("regular").cameras[0].clone())
    };
    let (loose, sigma) = with(100.0);
    assert_eq!((loose[1], sigma.parameters.as_slice()), (480.5, [0, 2, 3].as_slice()));
    // Four standard deviations, of which the shift of x takes one more.
    for (k, truth) in [(0, 800.0), (2, 300.0), (3, -0.05)] {
        let s = sigma.sigmas[sigma.parameters.iter().position(|&p| p == k).expect("refined")];
        assert!((loose[k] - truth).abs() < 5.0 * s, "parameter {k}: {} of {truth}, sigma {s}", loose[k]);
    }
    // A weight far above that of the images keeps the value.
    let (tight, sigma) = with(0.001);
    assert!((tight[2] - 306.0).abs() < 0.01 && sigma.sigmas[1] < 0.0011, "{tight:?}");
}
