//! Wrong matches, wrong pairs, bad images: near the truth, or not oriented; never a wrong pose that looks right.

use crate::exact::adjusted_truth;
use crate::support::{FLYING_HEIGHT_M, assert_consistent, assert_near_optimum, complete, input, made, noisy, oriented};
use mapping::{MapInput, OrientOptions, Orientation, orient};
use scene::{ImageId, KeypointIndex, PairConfiguration, Reconstruction, VerifiedPair};
use synthetic::survey::{Survey, SurveyOptions, survey};
use synthetic::{Alignment, Random, deviation};

#[test]
fn a_third_of_wrong_matches_costs_next_to_nothing() {
    // 43 wrong ones for 100 right ones: 30 % of all.
    let (made, input) = made(&SurveyOptions { outlier_share: 0.43, ..noisy(1) });
    let out = oriented(&input);
    let optimum = adjusted_truth(&made.truth, &input, false, false);
    assert_near_optimum(&out.models[0], &optimum, &made.truth, Alignment::Sim3);
    // Wrong matches become points only where two rays happen to meet, and are no longer than two: nearly every point of
    // three observations is a true one, with no stray keypoint in it.
    let stray = wrong_observations(&out, &made.truth, |track| track.len() > 2);
    assert!(stray < 0.002, "{stray}");
}

/// Share of the observations in the chosen tracks that do not show the true point that most others of their track show.
fn wrong_observations(out: &Orientation, truth: &Reconstruction, choose: impl Fn(&[scene::Observation]) -> bool) -> f64 {
    let mut point_of: Vec<Vec<Option<usize>>> = truth.keypoints.iter().map(|k| vec![None; k.len()]).collect();
    for (p, point) in truth.points.iter().enumerate() {
        for o in &point.track {
            point_of[o.image.index()][o.keypoint.index()] = Some(p);
        }
    }
    let (mut wrong, mut all) = (0, 0);
    for point in out.models[0].points.iter().filter(|p| choose(&p.track)) {
        let shown: Vec<Option<usize>> = point.track.iter().map(|o| point_of[o.image.index()][o.keypoint.index()]).collect();
        let votes = |p: &Option<usize>| if p.is_some() { shown.iter().filter(|q| *q == p).count() } else { 0 };
        wrong += shown.len() - shown.iter().map(votes).max().unwrap_or(0);
        all += shown.len();
    }
    wrong as f64 / f64::from(all.max(1) as u32)
}

/// A pair whose matches follow no geometry.
fn random_pair(images: (u32, u32), count: usize, input: &MapInput, random: &mut Random) -> VerifiedPair {
    let mut draw = |image: u32| {
        let mut all: Vec<u32> = (0..input.keypoints[image as usize].len() as u32).collect();
        (1..all.len()).rev().for_each(|i| all.swap(i, random.index(i + 1)));
        all.truncate(count);
        all.into_iter().map(KeypointIndex).collect::<Vec<_>>()
    };
    let mut matches: Vec<_> = draw(images.0).into_iter().zip(draw(images.1)).collect();
    matches.sort_unstable();
    VerifiedPair {
        images: (ImageId(images.0), ImageId(images.1)),
        matches,
        configuration: PairConfiguration::Calibrated { essential: nalgebra::Matrix3::zeros() },
        homography_inliers: 0,
    }
}

#[test]
fn pairs_that_never_overlapped_do_not_bend_the_path() {
    let (made, mut input) = made(&noisy(1));
    let mut random = Random::new(5);
    for images in [(0, 11), (1, 9), (2, 10)] {
        let pair = random_pair(images, 120, &input, &mut random);
        input.pairs.push(pair);
    }
    let out = complete(&input);
    let [note] = &out.summary.notes[..] else { panic!("{:?}", out.summary.notes) };
    assert!(note.starts_with("3 of 29 matched pairs"), "{note}");
    let optimum = adjusted_truth(&made.truth, &input, false, false);
    assert_near_optimum(&out.models[0], &optimum, &made.truth, Alignment::Sim3);
}

/// Largest distance from the truth of the images that each model of a result orients, and how many these are.
fn worst_of_each_model(out: &Orientation, made: &Survey) -> Vec<(usize, f64)> {
    let of = |model: &Reconstruction| {
        let d = deviation(model, &made.truth, Alignment::Sim3).expect("more than two images");
        (model.oriented_images().count(), d.max_centre.0)
    };
    out.models.iter().map(of).collect()
}

#[test]
fn two_places_that_look_alike_do_not_become_one_in_silence() {
    for way in 4u8..=7 {
        let options = SurveyOptions { exposures: 14, look_alike_m: Some(f64::from(way)), seed: u64::from(way), ..noisy(1) };
        let made = survey(&options);
        let input = input(&made);
        assert!(input.pairs.iter().any(|p| p.images.1.0 - p.images.0.0 > 5), "the places are matched");
        let out = orient(&input, &OrientOptions::default()).expect("most of it is sound");
        assert_consistent(&out, &input);
        let worst = worst_of_each_model(&out, &made);
        println!("{way} {worst:?} {:?}", out.summary.notes);
        // Right to 10 cm, which a place taken for another (metres off) is far from; or said to be doubtful.
        let right = worst.iter().all(|&(_, centre)| centre < 0.1);
        let told = out.summary.notes.iter().any(|n| n.contains("contradict the model"));
        assert!(right || told, "{way} m: {worst:?}");
        assert!(worst[0].0 >= 10, "{way} m: {worst:?}");
    }
}

/// An image whose keypoints are this far off, as by a shutter that rolled: P3P may take it, the adjustment may not.
#[test]
fn an_image_that_is_hardly_right_comes_to_an_end() {
    for (seed, off_px) in [(1, 6.0), (2, 8.0), (3, 11.0)] {
        let (made, mut input) = made(&noisy(1));
        let mut random = Random::new(seed);
        for k in &mut input.keypoints[5] {
            *k = [k[0] + (off_px * random.normal()) as f32, k[1] + (off_px * random.normal()) as f32];
        }
        let out = orient(&input, &OrientOptions::default()).expect("eleven images are sound");
        assert_consistent(&out, &input);
        assert!(out.summary.left_out.len() <= 1, "{:?}", out.summary.left_out);
        // Where it is kept it is where its noise puts it: off_px * height / focal length over the root of the dozen
        // observations that a frame must have, tilt and shift being alike; its neighbours follow. The others are 7 mm off.
        let bound = 0.02 + 5.0 * off_px * FLYING_HEIGHT_M / 800.0 / 12f64.sqrt();
        let worst = worst_of_each_model(&out, &made);
        assert!(worst.iter().all(|&(_, centre)| centre < bound), "{worst:?} > {bound}");
    }
}
