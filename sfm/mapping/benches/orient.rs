//! Time of whole orientations of synthetic surveys, from verified pairs to the last adjustment.

use criterion::{Criterion, criterion_group, criterion_main};
use mapping::{CameraInput, ImageInput, MapInput, OrientOptions, RigInput, RigMode, RigPoseInput, orient};
use std::hint::black_box;
use synthetic::survey::{SurveyOptions, survey};

/// 100 images by `cameras` cameras on a known rig, with noise and wrong matches; about 190 keypoints an image.
fn input(cameras: usize) -> MapInput {
    let exposures = 100 / cameras;
    let points = 23 * 6 * (exposures * 6 / 10 + 7);
    let made = survey(&SurveyOptions { exposures, cameras, points, noise_px: 0.5, outlier_share: 0.1, ..SurveyOptions::default() });
    let truth = made.truth;
    let poses = truth.rigs[0].sensors.iter().map(|s| Some(RigPoseInput { cam_from_rig: s.cam_from_rig, sigma: None })).collect();
    let images = truth.images.iter().map(|image| ImageInput {
        name: image.name.clone(),
        camera: image.camera,
        exposure: truth.frames[image.frame.index()].exposure,
    });
    MapInput {
        cameras: truth
            .cameras
            .iter()
            .map(|&camera| CameraInput {
                name: "camera".into(),
                camera,
                fixed: false,
                held: Vec::new(),
                sigmas: Vec::new(),
                alternatives: Vec::new(),
            })
            .collect(),
        images: images.collect(),
        keypoints: truth.keypoints,
        pairs: made.pairs,
        rig: RigInput { mode: if cameras > 1 { RigMode::Rigid } else { RigMode::None }, poses, baselines: Vec::new() },
        ..MapInput::default()
    }
}

fn orientation(c: &mut Criterion) {
    let mut group = c.benchmark_group("orient 100 images");
    group.sample_size(10);
    for (name, cameras) in [("one camera", 1), ("stereo rig", 2)] {
        let input = input(cameras);
        group.bench_function(name, |b| b.iter(|| orient(black_box(&input), &OrientOptions::default()).expect("the survey is sound")));
    }
    group.finish();
}

criterion_group!(benches, orientation);
criterion_main!(benches);
