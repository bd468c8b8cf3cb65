//! All frames at once, beside one after the other.

use crate::support::{NOISE_PX, assert_consistent, input, made, noisy, rig_poses};
use mapping::{MapInput, Mapper, OrientOptions, Orientation, RigInput, RigMode, orient};
use scene::Scale;
use synthetic::Alignment;
use synthetic::survey::{SurveyOptions, survey};

fn by(mapper: Mapper, input: &MapInput) -> Orientation {
    let out = orient(input, &OrientOptions { mapper, ..OrientOptions::default() }).expect("a sound survey");
    assert_consistent(&out, input);
    out
}

/// Both ways end in the same optimum: what is left are a few tracks that one way split and the other did not, a tenth of the errors
/// that the noise makes.
#[track_caller]
fn assert_same(input: &MapInput, alignment: Alignment, share: f64) {
    let (global, incremental) = (by(Mapper::Global, input), by(Mapper::Incremental, input));
    assert!(global.summary.made.as_ref().is_some_and(|m| m.global), "{:?}", global.summary.made);
    assert!(incremental.summary.made.as_ref().is_some_and(|m| !m.global), "{:?}", incremental.summary.made);
    let (a, b) = (&global.models[0], &incremental.models[0]);
    assert_eq!(a.oriented_images().count(), b.oriented_images().count());
    assert_eq!(a.scale, b.scale);
    let d = synthetic::deviation(a, b, alignment).expect("all oriented");
    let sigma =
        incremental.summary.quality.as_ref().expect("determined").images.iter().flatten().flat_map(|s| s.centre).fold(0.0, f64::max);
    println!("{} images: {:?} of {sigma}, {} and {} points", a.oriented_images().count(), d.max_centre, a.points.len(), b.points.len());
    assert!(d.max_centre.0 < share * sigma, "{d:?}, sigma {sigma}");
    assert!((a.points.len() as f64 / b.points.len() as f64 - 1.0).abs() < 0.02);
}

#[test]
fn one_camera() {
    let (_, input) = made(&SurveyOptions { exposures: 30, points: 5000, noise_px: NOISE_PX, ..SurveyOptions::default() });
    assert_same(&input, Alignment::Sim3, 0.5);
}

#[test]
fn a_known_rig() {
    let (made, mut input) = made(&noisy(2));
    input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
    assert_same(&input, Alignment::Se3, 0.5);
}

#[test]
fn wrong_matches() {
    let (_, input) = made(&SurveyOptions { outlier_share: 0.3, ..noisy(3) });
    // Wrong matches that fit by chance go to one track here and to another there: within one standard deviation.
    assert_same(&input, Alignment::Sim3, 1.0);
}

#[test]
fn exact_observations_give_the_truth() {
    let made = survey(&SurveyOptions { cameras: 2, exposures: 15, ..SurveyOptions::default() });
    let mut input = input(&made);
    input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
    let out = by(Mapper::Global, &input);
    let d = synthetic::deviation(&out.models[0], &made.truth, Alignment::Se3).expect("all oriented");
    assert_eq!(out.models[0].scale, Scale::Metric);
    // Keypoints are stored as f32: 6e-5 px at most, a ten-thousandth of the usual noise.
    assert!(d.max_centre.0 < 1e-5, "{d:?}");
}

#[test]
fn the_program_picks_and_says_why() {
    let short = made(&noisy(1)).1;
    let made_by = |input: &MapInput| by(Mapper::Auto, input).summary.made.expect("made");
    assert_eq!((made_by(&short).global, made_by(&short).reason), (false, "12 frames are few".to_owned()));
    let (_, mut long) = made(&SurveyOptions { exposures: 32, points: 5000, noise_px: NOISE_PX, ..SurveyOptions::default() });
    assert_eq!(made_by(&long).reason, "32 frames, interior orientation known");
    assert!(made_by(&long).global);
    long.cameras[0].alternatives = vec![long.cameras[0].camera];
    assert_eq!(made_by(&long).reason, "nothing is known of the interior orientation of camera");
}
