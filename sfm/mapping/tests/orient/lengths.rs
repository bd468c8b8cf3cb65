//! Baselines and scale bars as weighted residuals.

use crate::exact::adjusted_truth;
use crate::support::{assert_near_optimum, baseline, complete, made, noisy, oriented, scale_bar, true_baseline};
use mapping::{MapInput, RigInput, RigMode};
use nalgebra::Vector3;
use scene::{CameraId, Scale};
use synthetic::Alignment;
use synthetic::survey::{Survey, SurveyOptions};

/// Play of the mount, and the standard deviation given with the baseline.
const PLAY_M: f64 = 0.005;
const PAIR: (CameraId, CameraId) = (CameraId(0), CameraId(1));

/// Cameras that are not quite rigid, and the length that their drawing gives.
fn loose_stereo() -> (Survey, MapInput, f64) {
    let (made, mut input) = made(&SurveyOptions { mount_play_m: PLAY_M, ..noisy(2) });
    // Where the mount is at rest: 0.5 m to the side, 0.01 m and 0.02 m off.
    let length = Vector3::new(0.5, 0.01, 0.02).norm();
    input.rig = RigInput { mode: RigMode::Baselines, poses: Vec::new(), baselines: vec![baseline(length, PLAY_M)] };
    (made, input, length)
}

#[test]
fn baselines_of_a_loose_mount_give_metres() {
    let (made, input, length) = loose_stereo();
    let out = oriented(&input);
    let model = &out.models[0];
    // Every image has its own pose.
    assert_eq!((model.scale, model.frames.len()), (Scale::Metric, 24));
    let d = assert_near_optimum(model, &adjusted_truth(&made.truth, &input, false, false), &made.truth, Alignment::Se3);
    // The scale rests on the mean of 12 distances, each with its play: three standard deviations of that mean.
    let sigma_scale = PLAY_M / length / 12f64.sqrt();
    assert!((d.scale - 1.0).abs() < 3.0 * sigma_scale, "{d:?}");
    // What the report says of each exposure is there in the model.
    let found: Vec<f64> = (0..12).filter_map(|e| true_baseline(model, PAIR, e)).collect();
    let mean = found.iter().sum::<f64>() / 12.0;
    let normalised = (found.iter().map(|f| ((f - length) / PLAY_M).powi(2)).sum::<f64>() / 12.0).sqrt();
    let [report] = &out.summary.baselines[..] else { panic!("{:?}", out.summary.baselines) };
    assert_eq!((report.exposures, report.given_m, report.sigma_m), (12, length, PLAY_M));
    assert!((report.found_m - mean).abs() < 1e-12 && (report.normalised_residual - normalised).abs() < 1e-9, "{report:?}");
    // The play is real, and the images see it better than the weight holds it: the residuals are those of the truth.
    let play = (0..12).filter_map(|e| true_baseline(&made.truth, PAIR, e)).map(|t| ((t - length) / PLAY_M).powi(2)).sum::<f64>() / 12.0;
    assert!((report.normalised_residual / play.sqrt() - 1.0).abs() < 0.25, "{report:?}, true {}", play.sqrt());
}

#[test]
fn a_wrong_baseline_shows_in_its_residual_against_a_bar() {
    let (made, mut input, length) = loose_stereo();
    // Measured 5 cm too long; a bar of 2 m known to a tenth of a millimetre contradicts it.
    input.rig.baselines = vec![baseline(length + 0.05, PLAY_M)];
    let ends = [Vector3::new(2.0, -0.8, 0.2), Vector3::new(2.0 + 1.6, 0.4, 0.2)];
    let true_length = (ends[0] - ends[1]).norm();
    input.scale_bars = vec![scale_bar(&made.truth, ends, true_length, 0.0001, false)];
    let out = complete(&input);
    // Two lengths contradict each other: which is wrong is not decided.
    assert!(out.summary.rejected.is_empty() && out.summary.notes.len() == 1, "{:?}", out.summary.notes);
    assert!(out.summary.notes[0].contains("the baseline of camera and camera (0.55"), "{:?}", out.summary.notes);
    let report = out.summary.baselines[0];
    // The bar weighs (2.0 / 0.0001)^2, the baselines 12 (0.55 / 0.005)^2: the bar has the last word, but for what the
    // noise of its picks (4 mm each, in 5 images) takes from it.
    assert!(report.normalised_residual > 5.0, "{report:?}");
    let d = synthetic::deviation(&out.models[0], &made.truth, Alignment::Se3).expect("all oriented");
    assert!((d.scale - 1.0).abs() < 0.03, "{d:?}");
    assert_eq!(out.summary.adjustment.baselines.len(), 12);
}

/// Bars of 1.5 m and 1 m on the sea bed, the second a check.
fn with_bars(cameras: usize) -> (Survey, MapInput, [f64; 2]) {
    let (made, mut input) = made(&noisy(cameras));
    let ends = [[Vector3::new(1.5, -0.6, 0.2), Vector3::new(2.7, 0.3, 0.1)], [Vector3::new(5.0, 0.6, -0.2), Vector3::new(5.8, 0.0, 0.0)]];
    let lengths = ends.map(|[a, b]| (a - b).norm());
    input.scale_bars = (0..2).map(|i| scale_bar(&made.truth, ends[i], lengths[i], 0.001, i == 1)).collect();
    (made, input, lengths)
}

#[test]
fn one_bar_scales_and_the_other_checks() {
    let (made, input, lengths) = with_bars(1);
    let out = oriented(&input);
    assert_eq!(out.models[0].scale, Scale::Metric);
    let optimum = adjusted_truth(&made.truth, &input, false, false);
    let d = assert_near_optimum(&out.models[0], &optimum, &made.truth, Alignment::Se3);
    println!("{d:?} {:?}", out.summary.scale_bars);
    let [used, check] = &out.summary.scale_bars[..] else { panic!("{:?}", out.summary.scale_bars) };
    assert_eq!(
        (used.index, used.given_m, used.check, check.index, check.given_m, check.check),
        (0, lengths[0], false, 1, lengths[1], true)
    );
    // Only one bar took part.
    assert_eq!(out.summary.adjustment.scale_bars.len(), 1);
    // The ends are known to noise * height / focal length = 1.9 mm an image, with depth twice that; with four images and
    // two ends, 2 mm: three of these. The adjusted bar agrees with its length to the share of its weight.
    let picked = 0.002;
    assert!((used.found_m.expect("in view") - lengths[0]).abs() < 3.0 * picked, "{used:?}");
    let scale = (d.scale - 1.0).abs() * lengths[1];
    assert!((check.found_m.expect("in view") - lengths[1]).abs() < 3.0 * picked + scale, "{check:?}");
}

#[test]
fn a_check_bar_changes_nothing_but_the_report() {
    let (_, input, _) = with_bars(1);
    let (mut without, mut wrong) = (input.clone(), input.clone());
    without.scale_bars.pop();
    wrong.scale_bars[1].length_m += 0.1;
    let (with, without, wrong) = (oriented(&input), oriented(&without), oriented(&wrong));
    assert_eq!(with.models, without.models);
    assert_eq!(with.models, wrong.models);
    // A check that is 10 cm too long is found 10 cm too short: its error is reported as it is.
    let error = |o: &mapping::Orientation| o.summary.scale_bars[1].found_m.expect("in view") - o.summary.scale_bars[1].given_m;
    assert!((error(&with) - error(&wrong) - 0.1).abs() < 1e-12);
}

#[test]
fn a_check_alone_gives_no_scale_and_no_length_in_metres() {
    let (_, mut input, _) = with_bars(1);
    input.scale_bars.remove(0);
    let out = oriented(&input);
    assert_eq!(out.models[0].scale, Scale::Arbitrary);
    assert_eq!(out.summary.scale_bars[0].found_m, None);
}

#[test]
fn a_baseline_without_a_rig_mode_is_not_reported_in_units_that_are_not_metres() {
    let (_, mut input, _) = loose_stereo();
    input.rig.mode = RigMode::None;
    let out = oriented(&input);
    assert_eq!(out.models[0].scale, Scale::Arbitrary);
    assert_eq!(out.summary.baselines, []);
}

#[test]
fn a_bar_picked_in_one_image_is_no_length() {
    let (_, mut input, _) = with_bars(1);
    input.scale_bars.truncate(1);
    input.scale_bars[0].ends[1].truncate(1);
    let out = oriented(&input);
    assert_eq!((out.models[0].scale, out.summary.scale_bars[0].found_m), (Scale::Arbitrary, None));
}

/// A pick that is said to be poor does not spoil those that were measured well.
#[test]
fn picks_weigh_by_their_deviations() {
    let (made, mut input, _) = loose_stereo();
    let ends = [Vector3::new(2.0, -0.8, 0.2), Vector3::new(3.6, 0.4, 0.2)];
    let length_m = (ends[0] - ends[1]).norm();
    let mut bar = scale_bar(&made.truth, ends, length_m, 0.001, true);
    bar.ends.iter_mut().flatten().for_each(|pick| pick.sigma_px = 0.2);
    let found = |bar: &mapping::ScaleBarInput| {
        let out = oriented(&MapInput { scale_bars: vec![bar.clone()], ..input.clone() });
        out.summary.scale_bars[0].found_m.expect("picked")
    };
    let mut without = bar.clone();
    without.ends[0].remove(0);
    bar.ends[0][0].pixel[0] += 20.0;
    let (without, spoilt) = (found(&without), found(&bar));
    bar.ends[0][0].sigma_px = 100.0;
    let weighed = found(&bar);
    // One of many picks with a weight of 4e-6 is as good as left out.
    assert!((weighed - without).abs() < 0.05 * (spoilt - without).abs(), "{without} {spoilt} {weighed}");
    input.scale_bars = vec![bar];
    input.scale_bars[0].ends[0][0].sigma_px = 0.0;
    assert!(matches!(mapping::orient(&input, &mapping::OrientOptions::default()), Err(mapping::MapError::Inconsistent(_))));
}
