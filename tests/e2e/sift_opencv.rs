//! Our keypoints against those of OpenCV's SIFT, an independent implementation of the same paper.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

use features::{SiftOptions, extract};
use opencv::core::{KeyPointTraitConst, Mat, MatTraitManual, Vector, no_array};
use opencv::features2d::{Feature2DTrait, SIFT};
use scene::{Keypoint, Raster};
use synthetic::dive::{DiveOptions, render_dive};

/// A keypoint of OpenCV in the doubled image, in our convention.
struct Reference {
    x: f64,
    y: f64,
    scale: f64,
}

fn opencv_keypoints(grey: &Raster<u8>) -> Vec<Reference> {
    let (rows, columns) = (grey.height() as i32, grey.width() as i32);
    let mut image = Mat::new_rows_cols_with_default(rows, columns, opencv::core::CV_8UC1, 0.0.into()).unwrap();
    image.data_typed_mut::<u8>().unwrap().copy_from_slice(grey.data());
    let mut found = Vector::new();
    // Its defaults: no limit, 3 layers an octave, contrast 0.04, edges 10, sigma 1.6; the image is always doubled.
    SIFT::create_def().unwrap().detect(&image, &mut found, &no_array()).unwrap();
    // In the doubled image, before it halves them: the centre of the top-left pixel is (0, 0), sizes are diameters. (Halved, its
    // keypoints lie a quarter of a pixel down and right, unless its later `enable_precise_upscale` is set.)
    let reference = |k: opencv::core::KeyPoint| Reference {
        x: 2.0 * f64::from(k.pt().x) + 0.5,
        y: 2.0 * f64::from(k.pt().y) + 0.5,
        scale: f64::from(k.size()),
    };
    found.iter().map(reference).collect()
}

/// The image at twice the size as OpenCV doubles it: linear between pixel centres, the border repeated.
fn doubled(grey: &Raster<u8>) -> Raster<f32> {
    let (width, height) = (grey.width(), grey.height());
    let taps = |i: usize, n: usize| {
        let (near, far) = (i / 2, if i.is_multiple_of(2) { (i / 2).saturating_sub(1) } else { (i / 2 + 1).min(n - 1) });
        [(near, 0.75f32), (far, 0.25)]
    };
    let value = |x: usize, y: usize| -> f32 {
        let row = |y: usize| taps(x, width).iter().map(|&(x, w)| w * f32::from(grey[(x, y)])).sum::<f32>();
        taps(y, height).iter().map(|&(y, w)| w * row(y)).sum::<f32>() / 255.0
    };
    let pixels = (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
    Raster::from_vec(2 * width, 2 * height, pixels).unwrap()
}

fn nearest<'a>(ours: &'a [Keypoint], reference: &Reference) -> Option<(&'a Keypoint, f64)> {
    let distance = |k: &Keypoint| (f64::from(k.x) - reference.x).hypot(f64::from(k.y) - reference.y);
    let alike = |k: &&Keypoint| (0.8..1.25).contains(&(f64::from(k.scale) / reference.scale));
    ours.iter().filter(alike).map(|k| (k, distance(k))).min_by(|a, b| a.1.total_cmp(&b.1))
}

#[test]
fn keypoints_are_those_of_opencv() {
    let dive = render_dive(&DiveOptions::small(2, 640, 400)).unwrap();
    let rgb = &dive.images[0].rgb;
    // Both see the same eight bits.
    let grey = Raster::from_vec(rgb.width(), rgb.height(), rgb.data().iter().map(|p| p[1]).collect()).unwrap();
    let reference = opencv_keypoints(&grey);
    // Both look at the same doubled image: what differs is the search.
    let options = SiftOptions {
        max_features: 100_000,
        double_image: false,
        camera_sigma_px: 1.0,
        contrast_threshold: 0.04 / 3.0,
        min_keypoints: 0,
        ..SiftOptions::default()
    };
    let ours = extract(&doubled(&grey), None, &options).unwrap().keypoints;
    assert!(reference.len() > 500, "{} keypoints say little", reference.len());

    let mut near = Vec::new();
    for r in &reference {
        if let Some((k, distance)) = nearest(&ours, r)
            && distance < 1f64.max(0.25 * r.scale)
        {
            near.push((f64::from(k.x) - r.x, f64::from(k.y) - r.y, f64::from(k.scale) / r.scale));
        }
    }
    let share = near.len() as f64 / reference.len() as f64;
    let median = |of: fn(&(f64, f64, f64)) -> f64| {
        let mut values: Vec<f64> = near.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let (dx, dy, ratio) = (median(|n| n.0), median(|n| n.1), median(|n| n.2));
    println!("{} of OpenCV, {} of ours, {share:.3} found, median ({dx:.4}, {dy:.4}) px, scale {ratio:.3}", reference.len(), ours.len());
    // What is left are keypoints at a threshold, where a rounding decides.
    assert!(share > 0.97, "{share}");
    assert!(dx.abs() < 0.02 && dy.abs() < 0.02, "({dx}, {dy}) px");
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    // And hardly any that OpenCV does not find.
    assert!((ours.len() as f64 / reference.len() as f64 - 1.0).abs() < 0.2, "{} and {}", ours.len(), reference.len());
}
