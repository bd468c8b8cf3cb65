//! Images of nothing, masks, limits and wrong options.

use super::picture::{render, textured};
use crate::{FeatureError, SiftOptions, extract};
use scene::{Mask, Raster};

#[test]
fn images_without_structure_have_no_features() {
    let options = SiftOptions::default();
    for (width, height) in [(0, 0), (1, 1), (2, 2), (3, 400), (11, 11), (12, 12), (13, 200), (400, 300)] {
        for value in [0.0, 0.37, 1.0] {
            let image = Raster::filled(width, height, value);
            for double_image in [false, true] {
                let options = SiftOptions { double_image, ..options.clone() };
                assert!(extract(&image, None, &options).expect("valid options").is_empty(), "{width} x {height}");
            }
        }
    }
    let ramp = render(300, 200, |x, y| 0.001 * x + 0.002 * y);
    assert!(extract(&ramp, None, &options).expect("valid options").is_empty());
}

#[test]
fn not_a_number_and_infinity_do_no_harm() {
    let mut image = textured(200, 150, 3);
    image[(100, 70)] = f32::NAN;
    image[(30, 30)] = f32::INFINITY;
    let features = extract(&image, None, &SiftOptions::default()).expect("valid options");
    assert!(!features.is_empty());
    for k in &features.keypoints {
        assert!(k.x.is_finite() && k.y.is_finite() && k.scale.is_finite() && k.orientation.is_finite());
    }
}

#[test]
fn small_textured_images_are_handled() {
    for (width, height) in [(12, 12), (13, 12), (17, 33), (31, 47), (64, 16), (50, 50)] {
        let image = textured(width, height, 9);
        let features = extract(&image, None, &SiftOptions::default()).expect("valid options");
        assert_eq!(features.keypoints.len(), features.descriptors.len());
        for k in &features.keypoints {
            assert!((0.0..=width as f32).contains(&k.x) && (0.0..=height as f32).contains(&k.y));
        }
    }
}

#[test]
fn descriptors_have_the_norm_of_512() {
    let features = extract(&textured(400, 300, 1), None, &SiftOptions::default()).expect("valid options");
    assert!(features.len() > 300, "only {} features", features.len());
    for d in &features.descriptors {
        let squared: f64 = d.iter().map(|&v| f64::from(v).powi(2)).sum();
        // Rounding moves each of the 128 entries by at most 0.5: together less than 1 % of the norm.
        assert!((squared.sqrt() / 512.0 - 1.0).abs() < 0.01);
    }
}

#[test]
fn masked_keypoints_leave_their_place_to_others() {
    let image = textured(400, 300, 2);
    let options = SiftOptions { max_features: 200, ..SiftOptions::default() };
    let data = (0..400 * 300).map(|i| if i % 400 < 200 { 0 } else { 255 }).collect();
    let mask = Mask::from_vec(400, 300, data).expect("the size fits");
    let all = extract(&image, None, &options).expect("valid options");
    let kept = extract(&image, Some(&mask), &options).expect("valid options");
    assert!(all.keypoints.iter().any(|k| k.x < 200.0));
    assert!(kept.keypoints.iter().all(|k| k.x >= 200.0));
    assert_eq!((all.len(), kept.len()), (200, 200));
    let nothing = Mask::filled(400, 300, 0);
    assert!(extract(&image, Some(&nothing), &options).expect("valid options").is_empty());
}

#[test]
fn a_mask_of_another_size_is_an_error() {
    let mask = Mask::filled(300, 400, 255);
    let expected = FeatureError::MaskSize { width: 400, height: 300, mask_width: 300, mask_height: 400 };
    assert_eq!(extract(&textured(400, 300, 2), Some(&mask), &SiftOptions::default()), Err(expected));
}

#[test]
fn impossible_options_are_errors() {
    let image = Raster::filled(20, 20, 0.5);
    let d = SiftOptions::default;
    for options in [
        SiftOptions { contrast_threshold: 0.0, ..d() },
        SiftOptions { contrast_threshold: f32::NAN, ..d() },
        SiftOptions { edge_threshold: 0.5, ..d() },
        SiftOptions { octave_layers: 0, ..d() },
        SiftOptions { first_sigma_px: f32::INFINITY, ..d() },
        SiftOptions { camera_sigma_px: -1.0, ..d() },
        SiftOptions { low_contrast_fraction: 2.0, ..d() },
    ] {
        assert!(matches!(extract(&image, None, &options), Err(FeatureError::Option { .. })), "{options:?}");
    }
}

#[test]
fn limits_are_kept() {
    let image = textured(400, 300, 5);
    for max_features in [0, 1, 7, 100] {
        let options = SiftOptions { max_features, ..SiftOptions::default() };
        assert_eq!(extract(&image, None, &options).expect("valid options").len(), max_features);
    }
    let single = SiftOptions { max_orientations: 1, ..SiftOptions::default() };
    let features = extract(&image, None, &single).expect("valid options");
    let mut places: Vec<_> = features.keypoints.iter().map(|k| (k.x.to_bits(), k.y.to_bits(), k.scale.to_bits())).collect();
    places.sort_unstable();
    places.dedup();
    assert_eq!(places.len(), features.len());
}

#[test]
fn features_spread_over_the_image() {
    // The left half has a quarter of the contrast of the right one.
    let texture = textured(600, 300, 8);
    let image = render(600, 300, |x, y| {
        let value = f64::from(texture[(x as usize, y as usize)]);
        0.5 + (value - 0.5) * if x < 300.0 { 0.25 } else { 1.0 }
    });
    let options = SiftOptions { max_features: 300, ..SiftOptions::default() };
    let features = extract(&image, None, &options).expect("valid options");
    let left = features.keypoints.iter().filter(|k| k.x < 300.0).count();
    // The spread quarter goes to the cells with the fewest: most to the faint half.
    assert!(left >= 35, "only {left} of {} features in the faint half", features.len());
}
