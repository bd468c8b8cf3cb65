//! Repeatability and matching under known warps of a picture that is a function of the plane.

use super::picture::{render, texture};
use crate::{SiftOptions, extract};
use nalgebra::{Matrix3, Vector3};
use scene::{Descriptor, Features};

const WIDTH: usize = 400;
const HEIGHT: usize = 300;

fn squared_distance(a: &Descriptor, b: &Descriptor) -> i32 {
    a.iter().zip(b).map(|(&a, &b)| (i32::from(a) - i32::from(b)).pow(2)).sum()
}

/// What a warp did to the features.
#[derive(Debug)]
struct Outcome {
    /// Share of the keypoints whose image under the warp is a keypoint too (within 1.5 px, scales within a factor of 1.3).
    repeated: f64,
    /// Number of matches that pass the ratio test.
    matches: usize,
    /// Share of them that are right (within 2 px).
    correct: f64,
    /// Median distance of right matches from where they belong, pixels.
    median_error_px: f64,
    /// Median deviation of their change of orientation from the warp's, radians.
    median_turn: f64,
}

/// Features of the picture, and of the picture seen through `b_from_a`.
fn compare(b_from_a: &Matrix3<f64>, seed: u64) -> Outcome {
    let a_from_b = b_from_a.try_inverse().expect("a warp");
    let warp = |h: &Matrix3<f64>, x: f64, y: f64| {
        let p = h * Vector3::new(x, y, 1.0);
        (p.x / p.z, p.y / p.z)
    };
    let options = SiftOptions::default();
    let image_a = render(WIDTH, HEIGHT, |x, y| texture(x, y, seed));
    let image_b = render(WIDTH, HEIGHT, |x, y| {
        let (x, y) = warp(&a_from_b, x, y);
        texture(x, y, seed)
    });
    let [a, b]: [Features; 2] = [image_a, image_b].map(|i| extract(&i, None, &options).expect("valid options"));

    let (mut visible, mut repeated, mut matches) = (0usize, 0usize, 0usize);
    let (mut errors, mut turns) = (Vec::new(), Vec::new());
    for (k, d) in a.keypoints.iter().zip(&a.descriptors) {
        let (x, y) = (f64::from(k.x), f64::from(k.y));
        let (u, v) = warp(b_from_a, x, y);
        let border = 15.0;
        if !(border..WIDTH as f64 - border).contains(&u) || !(border..HEIGHT as f64 - border).contains(&v) {
            continue;
        }
        // The local similarity: how a short step along the orientation moves.
        let (s, c) = f64::from(k.orientation).sin_cos();
        let (du, dv) = warp(b_from_a, x + 0.01 * c, y + 0.01 * s);
        let (scale, angle) = ((du - u).hypot(dv - v) / 0.01, (dv - v).atan2(du - u));
        let expected_scale = f64::from(k.scale) * scale;
        // Finer ones cannot be found: the lowest level with extrema has 2 px.
        if expected_scale < 2.1 {
            continue;
        }
        visible += 1;
        repeated += usize::from(b.keypoints.iter().any(|o| {
            let ratio = f64::from(o.scale) / expected_scale;
            (f64::from(o.x) - u).hypot(f64::from(o.y) - v) < 1.5 && ratio < 1.3 && ratio > 1.0 / 1.3
        }));
        let mut best = (i32::MAX, 0, i32::MAX);
        for (j, other) in b.descriptors.iter().enumerate() {
            let distance = squared_distance(d, other);
            if distance < best.0 {
                best = (distance, j, best.0);
            } else if distance < best.2 {
                best.2 = distance;
            }
        }
        if f64::from(best.0) < 0.64 * f64::from(best.2) {
            matches += 1;
            let o = &b.keypoints[best.1];
            let error = (f64::from(o.x) - u).hypot(f64::from(o.y) - v);
            if error < 2.0 {
                errors.push(error);
                let turn = (f64::from(o.orientation) - angle + 9.0 * std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
                turns.push((turn - std::f64::consts::PI).abs());
            }
        }
    }
    let median = |v: &mut Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v[v.len() / 2]
    };
    Outcome {
        repeated: repeated as f64 / visible as f64,
        matches,
        correct: errors.len() as f64 / matches as f64,
        median_error_px: median(&mut errors),
        median_turn: median(&mut turns),
    }
}

fn similarity(scale: f64, degrees: f64, x: f64, y: f64) -> Matrix3<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    let (cx, cy) = (WIDTH as f64 / 2.0, HEIGHT as f64 / 2.0);
    let (a, b) = (scale * c, scale * s);
    Matrix3::new(a, -b, cx + x - a * cx + b * cy, b, a, cy + y - b * cx - a * cy, 0.0, 0.0, 1.0)
}

/// Bounds hold for two pictures each; they lie a little below what was measured.
fn check(b_from_a: &Matrix3<f64>, repeated: f64, correct: f64, error_px: f64, turn: f64) {
    for seed in [1, 2] {
        let outcome = compare(b_from_a, seed);
        assert!(outcome.repeated >= repeated, "{outcome:?}");
        assert!(outcome.matches >= 100 && outcome.correct >= correct, "{outcome:?}");
        assert!(outcome.median_error_px <= error_px && outcome.median_turn <= turn, "{outcome:?}");
    }
}

#[test]
fn translation_by_whole_pixels() {
    check(&similarity(1.0, 0.0, 16.0, -8.0), 0.95, 0.99, 0.01, 0.03);
}

#[test]
fn translation_by_parts_of_a_pixel() {
    check(&similarity(1.0, 0.0, 7.37, -3.61), 0.9, 0.98, 0.01, 0.01);
}

#[test]
fn rotation() {
    check(&similarity(1.0, 90.0, 0.0, 0.0), 0.9, 0.99, 0.005, 0.001);
    check(&similarity(1.0, 33.0, 2.2, 1.7), 0.9, 0.98, 0.015, 0.01);
}

#[test]
fn change_of_scale() {
    check(&similarity(1.5, 0.0, 0.3, 0.4), 0.85, 0.98, 0.12, 0.04);
    check(&similarity(0.7, -140.0, 0.3, 0.4), 0.85, 0.98, 0.12, 0.04);
}

#[test]
fn homography() {
    let tilt = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 4e-4, -3e-4, 1.0);
    check(&(similarity(1.0, 10.0, 3.1, 5.2) * tilt), 0.7, 0.95, 0.2, 0.12);
}
