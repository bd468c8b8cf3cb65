//! Standard deviations, wrong lengths, and adjusting again.

use crate::support::{NOISE_PX, complete, made, noisy, oriented, rig_poses, true_baseline};
use mapping::{BaselineInput, LengthId, MapInput, OrientOptions, RigInput, RigMode, readjust};
use scene::{CameraId, ImageId, Reconstruction, Scale};
use synthetic::Alignment;
use synthetic::survey::{Survey, SurveyOptions};

/// Three cameras with the distances of all three, in either mode.
fn triplet(mode: RigMode) -> (Survey, MapInput) {
    let (made, mut input) = made(&noisy(3));
    let pairs = [(0, 1), (0, 2), (1, 2)].map(|(a, b)| (CameraId(a), CameraId(b)));
    let known = |cameras| BaselineInput { cameras, length_m: true_baseline(&made.truth, cameras, 0).expect("seen"), sigma_m: 0.001 };
    input.rig = RigInput { mode, poses: Vec::new(), baselines: pairs.map(known).to_vec() };
    (made, input)
}

#[test]
fn a_wrong_baseline_is_named_and_not_absorbed() {
    for mode in [RigMode::Rigid, RigMode::Baselines] {
        let (made, right) = triplet(mode);
        let out = oriented(&right);
        assert!(out.summary.rejected.is_empty(), "{:?}", out.summary.rejected);
        let mut input = right.clone();
        input.rig.baselines[1].length_m *= 1.05;
        let out = complete(&input);
        let [(id, w)] = out.summary.rejected[..] else { panic!("{mode:?}: {:?} {:?}", out.summary.rejected, out.summary.notes) };
        assert_eq!(id, LengthId::Baseline(1));
        assert!(w.abs() > 5.0, "{w}");
        assert!(out.summary.notes[0].contains("contradicts the other lengths"), "{:?}", out.summary.notes);
        // The model is that of the two right ones: nothing of 5 % is left in the scale.
        let d = synthetic::deviation(&out.models[0], &made.truth, Alignment::Se3).expect("all oriented");
        assert!((d.scale - 1.0).abs() < 0.003, "{mode:?} {d:?}");
    }
}

/// Errors of projection centres relative to that of the datum, over their standard deviations.
fn normalised_errors(model: &Reconstruction, truth: &Reconstruction, summary: &mapping::OrientSummary) -> Vec<f64> {
    let quality = summary.quality.as_ref().expect("determined");
    let pose = |m: &Reconstruction, i: ImageId| m.cam_from_world(i).expect("oriented");
    let datum = quality.datum;
    // The truth in the world of the model: that in which both agree on the datum.
    let world = pose(model, datum).inverse() * pose(truth, datum);
    let frame = |i: ImageId| model.images[i.index()].frame;
    let images = model.oriented_images().filter(|&i| frame(i) != frame(datum));
    images
        .flat_map(|i| {
            let error = pose(model, i).centre() - world.apply(&pose(truth, i).centre());
            let sigma = quality.images[i.index()].expect("oriented").centre;
            [0, 1, 2].map(|k| error[k] / sigma[k])
        })
        .collect()
}

#[test]
fn errors_are_as_large_as_stated() {
    // Errors of one model are correlated: several, and a wide band.
    let mut squares = Vec::new();
    for seed in 1..=6 {
        let options = SurveyOptions { cameras: 2, noise_px: NOISE_PX, seed, ..SurveyOptions::default() };
        let (made, mut input) = made(&options);
        input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
        let out = oriented(&input);
        let quality = out.summary.quality.as_ref().expect("determined");
        assert!((quality.sigma0_image / NOISE_PX - 1.0).abs() < 0.05, "{}", quality.sigma0_image);
        squares.extend(normalised_errors(&out.models[0], &made.truth, &out.summary).into_iter().map(|e| e * e));
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    println!("{mean} of {}", squares.len());
    // Some 6 models with about 10 independent directions each: chi-square of 60, its 95 % band is 0.67 to 1.39 of it.
    assert!((0.67..1.39).contains(&mean), "{mean}");
}

#[test]
fn adjusting_again_changes_nothing() {
    for mode in [RigMode::Rigid, RigMode::Baselines, RigMode::None] {
        let (_, mut input) = triplet(mode);
        input.cameras.iter_mut().for_each(|c| c.fixed = false);
        if mode == RigMode::None {
            input.rig.baselines.clear();
        }
        let first = oriented(&input).models.remove(0);
        input.cameras.iter_mut().zip(&first.cameras).for_each(|(c, found)| c.camera = *found);
        let second = readjust(&input, &first, &OrientOptions::default()).expect("a sound model").models.remove(0);
        assert_eq!(first.points.len(), second.points.len());
        let share = |a: f64, b: f64, size: f64| (a - b).abs() / size;
        let mut most = 0.0f64;
        for (p, q) in first.points.iter().zip(&second.points) {
            most = most.max((p.xyz - q.xyz).norm() / p.xyz.norm());
        }
        for i in first.oriented_images() {
            let (a, b) = (first.cam_from_world(i).expect("oriented"), second.cam_from_world(i).expect("oriented"));
            most = most.max(a.rotation.angle_to(&b.rotation)).max((a.translation - b.translation).norm() / a.translation.norm().max(1.0));
        }
        for (a, b) in first.cameras.iter().zip(&second.cameras) {
            a.params().iter().zip(b.params()).for_each(|(x, y)| most = most.max(share(*x, *y, x.abs().max(1.0))));
        }
        assert!(most < 1e-8, "{mode:?}: {most}");
    }
}

#[test]
fn somebody_elses_model_gets_metres() {
    let (made, input) = triplet(RigMode::Rigid);
    // Their model: right, in a unit of 0.37 m, its cameras one by one.
    let mut theirs = input.clone();
    theirs.rig = RigInput::default();
    let mut start = oriented(&theirs).models.remove(0);
    assert_eq!(start.scale, Scale::Arbitrary);
    start.rigs.clone_from(&made.truth.rigs);
    let mut ours = input;
    ours.rig.poses = rig_poses(&made.truth, Some((0.01, 0.01)));
    let frames: Vec<_> = start.frames.iter().map(|f| f.rig_from_world).collect();
    // Frames of one camera each, in the new list of rigs.
    start.rigs = (0..3).map(|c| scene::Rig::single(CameraId(c))).collect();
    assert!(frames.iter().all(Option::is_some));
    ours.rig.mode = RigMode::Baselines;
    let out = readjust(&ours, &start, &OrientOptions::default()).expect("sound");
    assert_eq!(out.models[0].scale, Scale::Metric);
    let d = synthetic::deviation(&out.models[0], &made.truth, Alignment::Se3).expect("all oriented");
    assert!((d.scale - 1.0).abs() < 0.003, "{d:?}");
}

#[test]
fn residuals_tell_where_a_camera_model_is_wrong() {
    let (made, _) = triplet(RigMode::Rigid);
    let mut model = made.truth;
    let right = mapping::camera_residuals(&model);
    assert_eq!((right.len(), right[0].regions.len()), (3, 16));
    let count: usize = right.iter().map(|c| c.all.observations).sum();
    assert_eq!(count, model.observation_count());
    // Noise along two axes.
    let mut squares = 0.0;
    for c in &right {
        assert!(
            (c.all.rms_px / (NOISE_PX * 2f64.sqrt()) - 1.0).abs() < 0.05 && c.all.mean_px.iter().all(|m| m.abs() < 0.05),
            "{:?}",
            c.all
        );
        assert_eq!(c.regions.iter().map(|r| r.observations).sum::<usize>(), c.all.observations);
        squares += c.regions.iter().map(|r| r.observations as f64 * r.rms_px * r.rms_px).sum::<f64>();
    }
    let rms = (squares / count as f64).sqrt();
    assert!((rms - model.reprojection_rms()).abs() < 1e-9, "{rms} {}", model.reprojection_rms());
    // A principal distance 1 % too long pushes everything outward, and the principal point 2 px aside everything there.
    model.cameras[1].params_mut()[0] *= 1.01;
    model.cameras[1].params_mut()[1] += 2.0;
    let wrong = mapping::camera_residuals(&model);
    assert_eq!(wrong[0], right[0]);
    let (left, right) = (wrong[1].regions[4].mean_px[0], wrong[1].regions[7].mean_px[0]);
    assert!(left < 0.0 && right > 4.0 && (wrong[1].all.mean_px[0] - 2.0).abs() < 1.0, "{left} {right} {:?}", wrong[1].all);
}
