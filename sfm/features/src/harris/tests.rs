//! Corners, patches and matches against what is known of made images.

use super::*;
use crate::random::SplitMix64;
use scene::{Keypoint, Mask, Raster};

/// Smooth random texture: a sum of waves, sampled at any place, so that images can be shifted by parts of a pixel.
fn texture(x: f64, y: f64) -> f64 {
    let mut random = SplitMix64(5);
    let mut unit = || random.below(1 << 20) as f64 / f64::from(1 << 20);
    (0..60)
        .map(|_| {
            let (angle, wavelength, phase) = (6.3 * unit(), 5.0 + 30.0 * unit(), 6.3 * unit());
            ((x * angle.cos() + y * angle.sin()) * std::f64::consts::TAU / wavelength + phase).sin()
        })
        .sum::<f64>()
        / 30.0
        + 0.5
}

fn image(width: usize, height: usize, shade: impl Fn(f64, f64) -> f64) -> Raster<f32> {
    let pixels = (0..width * height).map(|i| shade((i % width) as f64 + 0.5, (i / width) as f64 + 0.5) as f32);
    Raster::from_vec(width, height, pixels.collect()).expect("one value a pixel")
}

/// A chequerboard whose edges are spread over a pixel, as a camera does; inner corners at multiples of 20 from (13.3, 17.7).
fn chequer(x: f64, y: f64) -> f64 {
    let ramp = |v: f64| {
        let phase = (v / 20.0).rem_euclid(2.0);
        let to_edge = (phase - phase.round()) * 20.0;
        let side = if (phase.round() as i64).rem_euclid(2) == 0 { to_edge } else { -to_edge };
        side.clamp(-0.5, 0.5) * 2.0
    };
    0.5 + 0.4 * ramp(x - 13.3) * ramp(y - 17.7)
}

#[test]
fn corners_of_a_chequerboard_are_where_they_are() {
    let found =
        extract_harris(&image(200, 160, chequer), None, &HarrisOptions { min_share: 0.1, ..HarrisOptions::default() }).expect("valid");
    let mut near = 0;
    for k in &found.keypoints {
        let off = |v: f32, first: f64| {
            let cells = (f64::from(v) - first) / 20.0;
            (cells - cells.round()) * 20.0
        };
        let distance = off(k.x, 13.3).hypot(off(k.y, 17.7));
        // A parabola through three values of the response is not its form: a tenth of a pixel.
        assert!(distance < 0.1, "{k:?} is off by {distance}");
        near += 1;
    }
    // 9 x 7 inner corners lie 12 px and more from the border.
    assert!((60..=72).contains(&near), "{near}");
}

#[test]
fn brightness_and_contrast_do_not_matter() {
    let plain = extract_harris(&image(160, 120, texture), None, &HarrisOptions::default()).expect("valid");
    let dim = extract_harris(&image(160, 120, |x, y| 0.1 + 0.35 * texture(x, y)), None, &HarrisOptions::default()).expect("valid");
    let matches = match_guided(&plain, &dim, &NccOptions { min_correlation: 0.99, ..NccOptions::default() });
    assert!(plain.len() > 50 && matches.len() * 10 >= plain.len().min(dim.len()) * 9, "{} of {}", matches.len(), plain.len());
    for (i, j) in matches {
        let (a, b) = (plain.keypoints[i.index()], dim.keypoints[j.index()]);
        assert!((a.x - b.x).hypot(a.y - b.y) < 0.05);
    }
}

#[test]
fn a_shift_is_found_to_a_fraction_of_a_pixel() {
    let (dx, dy) = (17.4, -9.7);
    let first = extract_harris(&image(240, 180, texture), None, &HarrisOptions::default()).expect("valid");
    let second = extract_harris(&image(240, 180, |x, y| texture(x - dx, y - dy)), None, &HarrisOptions::default()).expect("valid");
    let matches = match_guided(&first, &second, &NccOptions::default());
    let right = matches.iter().filter(|(i, j)| {
        let (a, b) = (first.keypoints[i.index()], second.keypoints[j.index()]);
        (f64::from(b.x - a.x) - dx).hypot(f64::from(b.y - a.y) - dy) < 0.5
    });
    assert!(matches.len() > 80, "{}", matches.len());
    // The response of a texture of waves is broad: nine of ten lie within 0.3 px, nearly all within half a pixel.
    assert!(right.count() * 100 >= matches.len() * 97);
    assert!(matches.windows(2).all(|w| w[0].0 < w[1].0), "sorted, one to one");
    let mut seconds: Vec<u32> = matches.iter().map(|m| m.1.0).collect();
    seconds.sort_unstable();
    seconds.dedup();
    assert_eq!(seconds.len(), matches.len());
}

/// The guess of the motion changes who is compared, not who matches: nearly all matches of an unguided search are found along it.
#[test]
fn guided_matches_are_those_of_a_search_over_all() {
    let shifted = |dx: f64| extract_harris(&image(240, 180, |x, y| texture(x - dx, y)), None, &HarrisOptions::default()).expect("valid");
    let (first, second) = (shifted(0.0), shifted(6.3));
    let guided = match_guided(&first, &second, &NccOptions::default());
    let limit = crate::MatchOptions { max_ratio: 1.0, max_distance: (0.4f64.sqrt() / 2.0) as f32, mutual: true };
    let all = crate::match_descriptors(&first.descriptors, &second.descriptors, &limit);
    let common = guided.iter().filter(|m| all.contains(m)).count();
    assert!(common * 100 >= all.len() * 97 && common * 100 >= guided.len() * 97, "{common} of {} and {}", guided.len(), all.len());
}

/// Without a motion to guess from, all corners are compared: the right ones are found all the same.
#[test]
fn few_corners_are_matched_without_a_guess() {
    let options = HarrisOptions { max_features: 9, ..HarrisOptions::default() };
    let first = extract_harris(&image(120, 120, texture), None, &options).expect("valid");
    let matches = match_guided(&first, &first, &NccOptions::default());
    assert!(matches.len() >= 8 && matches.iter().all(|(i, j)| i.0 == j.0), "{matches:?}");
    let none = scene::Features::default();
    assert!(
        match_guided(&first, &none, &NccOptions::default()).is_empty() && match_guided(&none, &none, &NccOptions::default()).is_empty()
    );
}

#[test]
fn masked_and_bordering_corners_are_left_out() {
    let grey = image(160, 120, texture);
    let mut mask = Mask::filled(160, 120, 255);
    (0..120).for_each(|y| mask.row_mut(y)[..80].fill(0));
    let found = extract_harris(&grey, Some(&mask), &HarrisOptions::default()).expect("valid");
    assert!(found.len() > 20);
    // A refined corner may lie half a pixel beyond the pixel that was tested.
    let inside = |k: &Keypoint| k.x >= 79.5 && k.x < 148.6 && k.y > 11.9 && k.y < 108.6;
    assert!(found.keypoints.iter().all(inside));
    assert!(extract_harris(&image(20, 20, texture), None, &HarrisOptions::default()).expect("valid").is_empty());
    assert!(extract_harris(&grey, Some(&Mask::filled(3, 3, 1)), &HarrisOptions::default()).is_err());
    assert!(extract_harris(&grey, None, &HarrisOptions { k: f32::NAN, ..HarrisOptions::default() }).is_err());
    assert!(extract_harris(&image(80, 80, |_, _| 0.5), None, &HarrisOptions::default()).expect("valid").is_empty(), "one grey");
}

#[test]
fn too_many_corners_are_spread_over_the_image() {
    let grey = image(300, 200, |x, y| if x < 150.0 { texture(x, y) } else { 0.5 + 0.05 * (texture(x, y) - 0.5) });
    let all = extract_harris(&grey, None, &HarrisOptions { min_share: 1e-9, ..HarrisOptions::default() }).expect("valid");
    let some = extract_harris(&grey, None, &HarrisOptions { max_features: all.len() / 3, min_share: 1e-9, ..HarrisOptions::default() })
        .expect("valid");
    let right = |f: &scene::Features| f.keypoints.iter().filter(|k| k.x > 150.0).count();
    assert_eq!(some.len(), all.len() / 3);
    assert!(right(&some) * 4 > some.len(), "{} of {} lie where contrast is weak", right(&some), some.len());
}
