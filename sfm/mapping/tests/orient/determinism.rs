//! The same input gives the same bits.

use crate::support::{baseline, input, made, noisy, rig_poses, scale_bar};
use mapping::{MapInput, Mapper, OrientOptions, RigMode, orient};
use nalgebra::Vector3;
use synthetic::Random;
use synthetic::survey::{SurveyOptions, survey};

/// Everything that comes out, to the last bit: floats print so that they read back the same, and -0 differs from 0.
fn bits(input: &MapInput, mapper: Mapper) -> String {
    format!("{:?}", orient(input, &OrientOptions { mapper, ..OrientOptions::default() }).expect("a sound survey"))
}

const MAPPERS: [Mapper; 2] = [Mapper::Incremental, Mapper::Global];

/// One of each kind: a camera of guessed interior, a known rig, a rig to be solved, and baselines with a bar.
fn inputs() -> Vec<MapInput> {
    let wrong = |cameras| SurveyOptions { outlier_share: 0.2, exposures: 8, points: 1500, ..noisy(cameras) };
    let (_, mut guessed) = made(&wrong(1));
    guessed.cameras[0].fixed = false;
    let (stereo, mut known) = made(&wrong(2));
    known.rig.mode = RigMode::Rigid;
    known.rig.poses = rig_poses(&stereo.truth, None);
    let (_, mut solved) = made(&wrong(3));
    solved.rig.mode = RigMode::Rigid;
    solved.rig.baselines = vec![baseline(0.5, 0.001)];
    let loose = survey(&SurveyOptions { mount_play_m: 0.005, ..wrong(2) });
    let mut weighted = input(&loose);
    weighted.rig.mode = RigMode::Baselines;
    weighted.rig.baselines = vec![baseline(0.5, 0.005)];
    let ends = [Vector3::new(1.5, -0.6, 0.2), Vector3::new(2.7, 0.3, 0.1)];
    weighted.scale_bars = vec![scale_bar(&loose.truth, ends, (ends[0] - ends[1]).norm(), 0.001, false)];
    vec![guessed, known, solved, weighted]
}

#[test]
fn the_number_of_threads_does_not_matter() {
    for (i, input) in inputs().iter().enumerate() {
        for mapper in MAPPERS {
            let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let with = |threads| pool(threads).install(|| bits(input, mapper));
            assert!(with(1) == with(2), "input {i}, {mapper:?}");
        }
    }
}

#[test]
fn the_order_of_pairs_does_not_matter() {
    for (i, input) in inputs().into_iter().enumerate() {
        let mut random = Random::new(i as u64);
        let mut shuffled = input.clone();
        for place in (1..shuffled.pairs.len()).rev() {
            shuffled.pairs.swap(place, random.index(place + 1));
        }
        assert!(shuffled.pairs != input.pairs);
        for mapper in MAPPERS {
            assert!(bits(&shuffled, mapper) == bits(&input, mapper), "input {i}, {mapper:?}");
        }
    }
}
