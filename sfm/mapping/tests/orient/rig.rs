//! Cameras on a rig.

use crate::exact::adjusted_truth;
use crate::support::{assert_near_optimum, baseline, complete, made, noisy, oriented, rig_poses, true_baseline};
use mapping::{MapInput, OrientOptions, RigInput, RigMode, orient};
use scene::{CameraId, Scale};
use synthetic::Alignment;
use synthetic::survey::{Survey, SurveyOptions};

fn with_known_rig(options: &SurveyOptions) -> (Survey, MapInput) {
    let (made, mut input) = made(options);
    input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
    (made, input)
}

#[test]
fn a_known_stereo_rig_is_metric_without_a_reference() {
    let (made, input) = with_known_rig(&noisy(2));
    let out = oriented(&input);
    let model = &out.models[0];
    assert_eq!(model.scale, Scale::Metric);
    // One pose a frame, and the rig as given, to the bit.
    assert_eq!(model.frames.len(), 12);
    assert_eq!(model.rigs, made.truth.rigs);
    let d = assert_near_optimum(model, &adjusted_truth(&made.truth, &input, false, false), &made.truth, Alignment::Se3);
    println!("{d:?}");
    assert!((d.scale - 1.0).abs() < 0.002, "{d:?}");
}

#[test]
fn a_rig_given_with_a_deviation_is_refined() {
    let (made, mut input) = with_known_rig(&noisy(2));
    // Given a centimetre and half a degree off, with these as standard deviations.
    let (rotation, translation) = (0.5f64.to_radians(), 0.01);
    let mut pose = input.rig.poses[1].expect("given");
    pose.cam_from_rig.translation.y += translation;
    pose.cam_from_rig.rotation = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::x() * rotation) * pose.cam_from_rig.rotation;
    pose.sigma = Some((rotation, translation));
    input.rig.poses[1] = Some(pose);
    let out = oriented(&input);
    assert_eq!(out.models[0].scale, Scale::Metric);
    let (found, truth) = (&out.models[0].rigs[0].sensors[1].cam_from_rig, &made.truth.rigs[0].sensors[1].cam_from_rig);
    println!("{:?} {:?}", found.rotation.angle_to(&truth.rotation), (found.translation - truth.translation).norm());
    // The images see the rotation far better than half a degree; the scale stays the prior's.
    assert!(found.rotation.angle_to(&truth.rotation) < 0.1 * rotation);
    assert!((found.translation.norm() - truth.translation.norm()).abs() < translation);
    // The images see half a degree, one standard deviation, and leave the place along the baseline.
    let [report] = out.summary.rig_poses[..] else { panic!("{:?}", out.summary.rig_poses) };
    assert_eq!(report.camera, CameraId(1));
    assert!((report.turned_rad / rotation - 1.0).abs() < 0.1, "{report:?}");
    assert!((report.normalised_residual - 1.0).abs() < 0.5 && out.summary.notes.is_empty(), "{report:?} {:?}", out.summary.notes);
    // The same with a tenth of the standard deviations is a contradiction.
    pose.sigma = Some((0.1 * rotation, 0.1 * translation));
    input.rig.poses[1] = Some(pose);
    let out = complete(&input);
    let [report] = out.summary.rig_poses[..] else { panic!("{:?}", out.summary.rig_poses) };
    assert!(report.normalised_residual > 5.0, "{report:?}");
    assert!(out.summary.notes.iter().any(|n| n.contains("contradict the given pose of camera in the rig")), "{:?}", out.summary.notes);
}

#[test]
fn an_unknown_rig_with_a_baseline_is_solved_and_metric() {
    let (made, mut input) = made(&noisy(2));
    let length = true_baseline(&made.truth, (CameraId(0), CameraId(1)), 0).expect("both took it");
    input.rig = RigInput { mode: RigMode::Rigid, poses: Vec::new(), baselines: vec![baseline(length, 0.001)] };
    let out = oriented(&input);
    let model = &out.models[0];
    assert_eq!((model.scale, model.frames.len(), model.rigs.len()), (Scale::Metric, 12, 1));
    let optimum = adjusted_truth(&made.truth, &input, false, true);
    let d = assert_near_optimum(model, &optimum, &made.truth, Alignment::Se3);
    println!("{d:?}");
    let (found, best, truth) = (model.rigs[0].sensors[1], optimum.rigs[0].sensors[1], made.truth.rigs[0].sensors[1]);
    let off = |s: &scene::RigSensor| (s.cam_from_rig.translation - truth.cam_from_rig.translation).norm();
    assert!(off(&found) <= 1.5 * off(&best) + 1e-4, "{} {}", off(&found), off(&best));
    // The images know nothing of the scale, so that the only length is met.
    let [report] = &out.summary.baselines[..] else { panic!("{:?}", out.summary.baselines) };
    assert_eq!((report.cameras, report.exposures, report.given_m, report.sigma_m), ((CameraId(0), CameraId(1)), 12, length, 0.001));
    assert!((report.found_m - length).abs() < 1e-6 && report.normalised_residual < 1e-3, "{report:?}");
}

#[test]
fn an_unknown_rig_without_lengths_is_rigid_and_not_metric() {
    let (made, mut input) = made(&noisy(2));
    input.rig.mode = RigMode::Rigid;
    let out = oriented(&input);
    assert_eq!((out.models[0].scale, out.models[0].frames.len()), (Scale::Arbitrary, 12));
    assert_near_optimum(&out.models[0], &adjusted_truth(&made.truth, &input, false, true), &made.truth, Alignment::Sim3);
}

#[test]
fn three_cameras_of_which_one_missed_exposures() {
    let (made, input) = with_known_rig(&SurveyOptions { missed: vec![(2, 1), (5, 1), (6, 1), (9, 0), (11, 2)], ..noisy(3) });
    assert_eq!(input.images.len(), 31);
    let out = oriented(&input);
    assert_eq!((out.models[0].scale, out.models[0].frames.len()), (Scale::Metric, 12));
    assert_near_optimum(&out.models[0], &adjusted_truth(&made.truth, &input, false, false), &made.truth, Alignment::Se3);
}

#[test]
fn three_cameras_of_unknown_mounting_with_missed_exposures() {
    let (made, mut input) = made(&SurveyOptions { missed: vec![(2, 1), (5, 1), (6, 1), (9, 0), (11, 2)], ..noisy(3) });
    let length = true_baseline(&made.truth, (CameraId(0), CameraId(1)), 0).expect("both took it");
    input.rig = RigInput { mode: RigMode::Rigid, poses: Vec::new(), baselines: vec![baseline(length, 0.001)] };
    let out = oriented(&input);
    assert_eq!((out.models[0].scale, out.models[0].frames.len()), (Scale::Metric, 12));
    assert_near_optimum(&out.models[0], &adjusted_truth(&made.truth, &input, false, true), &made.truth, Alignment::Se3);
    assert_eq!(out.summary.baselines[0].exposures, 8);
}

#[test]
fn a_rig_of_which_one_pose_is_given_keeps_it() {
    let (made, mut input) = made(&noisy(3));
    let mut poses = rig_poses(&made.truth, None);
    poses[2] = None;
    input.rig = RigInput { mode: RigMode::Rigid, poses, baselines: Vec::new() };
    let out = oriented(&input);
    assert_eq!(out.models[0].scale, Scale::Metric);
    assert_eq!(out.models[0].rigs[0].sensors[1], made.truth.rigs[0].sensors[1]);
    assert_near_optimum(&out.models[0], &adjusted_truth(&made.truth, &input, false, true), &made.truth, Alignment::Se3);
}

#[test]
fn a_rig_that_cannot_be_solved_still_uses_the_baseline_of_every_exposure() {
    let (made, mut input) = made(&noisy(3));
    // The third camera was dark.
    let dark = |image: scene::ImageId| made.truth.images[image.index()].camera == CameraId(2);
    input.pairs.retain(|pair| !dark(pair.images.0) && !dark(pair.images.1));
    let length = true_baseline(&made.truth, (CameraId(0), CameraId(1)), 0).expect("both took it");
    let residual = |mode| {
        let rig = RigInput { mode, poses: Vec::new(), baselines: vec![baseline(length, 0.001)] };
        let out = orient(&MapInput { rig, ..input.clone() }, &OrientOptions::default()).expect("two cameras overlap");
        assert_eq!((out.models[0].scale, out.models[0].oriented_images().count()), (Scale::Metric, 24));
        (out.summary.baselines[0].normalised_residual, out.summary.notes)
    };
    let ((as_rig, notes), (as_baselines, none)) = (residual(RigMode::Rigid), residual(RigMode::Baselines));
    assert!(notes.len() == 1 && notes[0].contains("the rig stays unknown") && none.is_empty(), "{notes:?} {none:?}");
    // The same observations: the same adjustment, but for where it stopped.
    assert!((as_rig - as_baselines).abs() < 0.01 * as_baselines, "{as_rig} {as_baselines}");
}
