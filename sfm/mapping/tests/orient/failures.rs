//! What surveys fail at, both ways: the result is right, or refused with the reason.

use crate::support::{assert_consistent, input, made, noisy, rig_poses};
use mapping::{MapError, MapInput, Mapper, OrientOptions, Orientation, RigInput, RigMode, orient};
use scene::{Camera, CameraModel, ImageId, Reconstruction};
use synthetic::survey::{Survey, SurveyOptions, survey};
use synthetic::{Alignment, deviation};

/// What the noise leaves of a path of a dozen frames: 7 mm, and less than three times that where it is seen less well.
const RIGHT_M: f64 = 0.02;

/// Runs both ways.
fn both(input: &MapInput) -> [Result<Orientation, MapError>; 2] {
    [Mapper::Global, Mapper::Incremental].map(|mapper| {
        let out = orient(input, &OrientOptions { mapper, ..OrientOptions::default() });
        out.inspect(|out| assert_consistent(out, input))
    })
}

#[track_caller]
fn off(model: &Reconstruction, made: &Survey, alignment: Alignment) -> f64 {
    deviation(model, &made.truth, alignment).expect("enough images").max_centre.0
}

#[test]
fn disjoint_parts_are_models_of_their_own() {
    let (made, mut input) = made(&SurveyOptions { exposures: 13, ..noisy(1) });
    input.pairs.retain(|p| (p.images.0.0 < 7) == (p.images.1.0 < 7));
    for out in both(&input) {
        let out = out.expect("two sound parts");
        assert_eq!(out.models.iter().map(|m| m.oriented_images().count()).collect::<Vec<_>>(), [7, 6]);
        assert!(out.models.iter().all(|m| off(m, &made, Alignment::Sim3) < RIGHT_M));
    }
}

#[test]
fn a_frame_without_overlap_is_left_out_and_says_so() {
    let (made, mut input) = made(&noisy(1));
    input.pairs.retain(|p| p.images.0.0 != 11 && p.images.1.0 != 11);
    for out in both(&input) {
        let out = out.expect("eleven are sound");
        let [left] = &out.summary.left_out[..] else { panic!("{:?}", out.summary.left_out) };
        assert_eq!((left.image, left.reason.as_str()), (ImageId(11), "no verified match with any other image"));
        assert!(off(&out.models[0], &made, Alignment::Sim3) < RIGHT_M);
    }
}

#[test]
fn a_plane_is_no_trap() {
    let (made, input) = made(&SurveyOptions { relief: 0.0, ..noisy(1) });
    for out in both(&input) {
        // Less firm than with relief; the two solutions of a plane are decimetres apart.
        assert!(off(&out.expect("sound").models[0], &made, Alignment::Sim3) < 1.5 * RIGHT_M);
    }
}

#[test]
fn a_turning_camera_is_refused() {
    let made = survey(&SurveyOptions { step_m: 0.0, exposures: 5, ..noisy(1) });
    for out in both(&input(&made)) {
        assert!(matches!(out, Err(MapError::NoInitialPair { .. })), "{:?}", out.map(|o| o.models[0].points.len()));
    }
}

#[test]
fn motion_along_the_axis_is_oriented() {
    // From 3 m down to 1.2 m, hardly to the side.
    let made = survey(&SurveyOptions { step_m: 0.02, descent_m: 0.2, exposures: 10, points: 6000, ..noisy(1) });
    for out in both(&input(&made)) {
        let out = out.expect("sound");
        assert_eq!(out.models[0].oriented_images().count(), 10);
        assert!(off(&out.models[0], &made, Alignment::Sim3) < RIGHT_M, "{}", off(&out.models[0], &made, Alignment::Sim3));
    }
}

#[test]
fn three_of_five_matches_may_be_wrong() {
    // One and a half wrong ones to each right one.
    let (made, input) = made(&SurveyOptions { outlier_share: 1.5, points: 3000, ..noisy(1) });
    for out in both(&input) {
        let out = out.expect("sound");
        assert_eq!(out.models[0].oriented_images().count(), 12);
        assert!(off(&out.models[0], &made, Alignment::Sim3) < 1.5 * RIGHT_M, "{}", off(&out.models[0], &made, Alignment::Sim3));
    }
}

#[test]
fn tiles_are_told_apart_or_told() {
    for way in [4.0, 6.0] {
        let made = survey(&SurveyOptions { exposures: 14, look_alike_m: Some(way), seed: 4, ..noisy(1) });
        for out in both(&input(&made)) {
            let out = out.expect("most of it is sound");
            // A place taken for another is metres off.
            let right = out.models.iter().all(|m| off(m, &made, Alignment::Sim3) < 0.1);
            let told = out.summary.notes.iter().any(|n| n.contains("contradict the model"));
            assert!(right || told, "{way} m");
        }
    }
}

#[test]
fn a_wrong_interior_orientation_does_not_pass_for_a_right_one() {
    let (made, mut input) = made(&noisy(2));
    input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
    let right: Vec<_> = both(&input).into_iter().map(|out| out.expect("sound").models[0].observation_count()).collect();
    // The second camera's principal distance is 8 % too long, and held.
    let p = made.truth.cameras[1].params();
    input.cameras[1].camera = Camera::new(CameraModel::SimpleRadial, 960, 600, &[1.08 * p[0], p[1], p[2], p[3]]).expect("valid");
    input.cameras[1].name = "the second".into();
    for (out, right) in both(&input).into_iter().zip(right) {
        let out = out.expect("half of it is sound");
        assert!(out.models[0].observation_count() < right * 3 / 4, "{} of {right}", out.models[0].observation_count());
        let [note] = &out.summary.notes[..] else { panic!("{:?}", out.summary.notes) };
        assert!(
            note.ends_with(
                "most between camera and the second do not: the interior orientation of one of them, or their place in the rig, is wrong"
            ),
            "{note}"
        );
    }
}
