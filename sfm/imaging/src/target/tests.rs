//! Centres against those that were drawn.

use super::testing::{Noise, radius, rendered};
use super::{CircleTarget, NoTarget, measure_circle};
use nalgebra::Vector2;
use scene::Raster;

const SIZE: usize = 48;

/// A disc with a place, axes and turn; white on dark.
fn disc(centre: [f64; 2], axes: [f64; 2], turn: f64, blur_px: f64) -> Raster<f32> {
    rendered(SIZE, SIZE, blur_px, |at| if radius(at, centre, axes, turn) < 1.0 { 0.8 } else { 0.1 })
}

fn measured(image: &Raster<f32>, rough: [f64; 2]) -> CircleTarget {
    measure_circle(image, rough, 6.0).unwrap_or_else(|e| panic!("{e}"))
}

fn off(target: &CircleTarget, truth: [f64; 2]) -> f64 {
    (Vector2::from(target.centre) - Vector2::from(truth)).norm()
}

/// At sub-pixel places, sizes from 5 to 24 pixels across, tilted by up to 66 degrees, sharp and blurred, bright and dark.
#[test]
fn centres_have_no_bias() {
    for (i, axes) in [[2.5, 2.5], [3.2, 2.9], [4.0, 4.0], [5.5, 3.0], [8.0, 7.0], [12.0, 5.0]].into_iter().enumerate() {
        for (k, blur) in [0.0, 0.5, 0.9, 1.4].into_iter().enumerate() {
            let centre = [23.1 + 0.17 * i as f64 + 0.29 * k as f64, 24.9 - 0.23 * i as f64 + 0.11 * k as f64];
            let bright = disc(centre, axes, 0.4 + i as f64, blur);
            for image in [bright.map(|v| 1.0 - v), bright] {
                let target = measured(&image, [centre[0] + 2.0, centre[1] - 1.5]);
                // Where the edge is blurred over most of the ellipse, the model is that much less exact.
                let bound = if axes[1] < 2.5 * blur { 0.03 } else { 0.02 };
                assert!(off(&target, centre) < bound, "{axes:?} at blur {blur}: {} px", off(&target, centre));
                // Blur moves a bent edge inwards by half its variance over the radius of curvature, a^2 / b at most.
                let shrunk = (blur * blur + 1.0 / 12.0) / axes[1] * (axes[0] / axes[1]);
                let given = 2.0 * (axes[0] * axes[1]).sqrt();
                assert!((target.diameter_px() - given).abs() < 0.1 + shrunk, "{given} px at blur {blur}: {}", target.diameter_px());
            }
        }
    }
}

/// Light that falls off to one side moves no centre: over the target by 30 %.
#[test]
fn uneven_light_moves_no_centre() {
    for axes in [[4.0, 4.0], [9.0, 6.0]] {
        let centre = [24.3, 23.6];
        let image = rendered(SIZE, SIZE, 1.0, |at| {
            let light = 1.0 + 0.3 * (at.x - 24.0) / (2.0 * axes[0]);
            light * if radius(at, centre, axes, 0.3) < 1.0 { 0.5 } else { 0.1 }
        });
        let error = off(&measured(&image, [25.0, 22.0]), centre);
        assert!(error < 0.02, "{error} px");
    }
}

#[test]
fn rings_and_other_things_about_it_do_not_matter() {
    let (centre, axes) = ([23.7, 24.2], [5.0, 4.2]);
    let image = rendered(SIZE, SIZE, 0.7, |at| {
        let r = radius(at, centre, axes, 0.2);
        // A disc, a dark ring, a bright ring with gaps, and a bright bottom with an edge that is not symmetric.
        let sector = ((at.y - centre[1]).atan2(at.x - centre[0]) * 2.0).floor() as i32;
        let ring = (2.0..3.0).contains(&r) && sector % 3 != 0;
        if r < 1.0 || ring {
            0.9
        } else if r < 3.4 {
            0.05
        } else if at.x > 30.0 {
            0.7
        } else {
            0.3
        }
    });
    let target = measured(&image, [26.0, 26.0]);
    assert!(off(&target, centre) < 0.02 && (target.diameter_px() - 2.0 * 21f64.sqrt()).abs() < 0.25, "{target:?}");
}

/// Four hundred times with other noise: the spread is what was stated, to a fifth; its own uncertainty is 2.5 %.
#[test]
fn stated_deviations_are_those_of_repetition() {
    for (axes, noise, blur) in [([4.0, 3.5], 0.02, 0.8), ([7.0, 5.0], 0.05, 1.2), ([3.0, 3.0], 0.01, 0.6)] {
        let centre = [24.21, 23.83];
        let clean = disc(centre, axes, 0.7, blur);
        let mut random = Noise::new(5);
        let (mut squares, mut stated, mut mean) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let repetitions = 400.0;
        for _ in 0..repetitions as usize {
            let target = measured(&random.added(&clean, noise), [25.0, 25.0]);
            for k in 0..2 {
                let error = target.centre[k] - centre[k];
                squares[k] += error * error / repetitions;
                stated[k] += target.sigma_px[k].powi(2) / repetitions;
                mean[k] += error / repetitions;
            }
        }
        for k in 0..2 {
            let ratio = (squares[k] / stated[k]).sqrt();
            assert!((0.8..1.2).contains(&ratio), "axis {k}: spread over stated deviation {ratio:.3}, {:.4} px", stated[k].sqrt());
            // Four times the deviation of the mean, and nothing else.
            assert!(mean[k].abs() < 4.0 * (squares[k] / repetitions).sqrt() + 0.002, "bias {} px", mean[k]);
        }
    }
}

#[test]
fn says_why_there_is_no_target() {
    let refused = |image: &Raster<f32>, rough: [f64; 2]| measure_circle(image, rough, 6.0).expect_err("no target");
    let flat = Noise::new(1).added(&Raster::filled(SIZE, SIZE, 0.4), 0.02);
    let nothing = refused(&flat, [20.0, 20.0]);
    assert!(matches!(nothing, NoTarget::Nothing { .. } | NoTarget::NoEllipse | NoTarget::TooSmall { .. }), "{nothing:?}");
    assert_eq!(refused(&flat, [-1.0, 20.0]), NoTarget::Outside);
    assert_eq!(refused(&flat, [f64::NAN, 20.0]), NoTarget::Outside);
    let cut = disc([2.0, 20.0], [5.0, 5.0], 0.0, 0.7);
    assert_eq!(refused(&cut, [4.0, 20.0]), NoTarget::Border);
    // The disc is whole, but what is about it is not.
    let close = disc([6.0, 20.0], [5.0, 5.0], 0.0, 0.7);
    assert_eq!(refused(&close, [7.0, 20.0]), NoTarget::Border);
    let small = disc([20.0, 20.0], [1.6, 1.6], 0.0, 0.4);
    assert!(matches!(refused(&small, [21.0, 20.0]), NoTarget::TooSmall { .. }), "{:?}", refused(&small, [21.0, 20.0]));
    let thin = disc([24.0, 24.0], [14.0, 3.0], 0.3, 0.7);
    assert!(matches!(refused(&thin, [24.0, 25.0]), NoTarget::TooElongated { .. }), "{:?}", refused(&thin, [24.0, 25.0]));
    let far = disc([24.0, 24.0], [4.0, 4.0], 0.0, 0.7);
    assert!(matches!(refused(&far, [32.0, 24.0]), NoTarget::Nothing { .. }));
    let square = rendered(SIZE, SIZE, 0.7, |at| if (at - Vector2::new(24.0, 24.0)).amax() < 7.0 { 0.8 } else { 0.1 });
    assert_eq!(refused(&square, [24.0, 24.0]), NoTarget::NoEllipse);
    // A third of the disc is hidden behind something as dark as its background.
    let hidden = rendered(SIZE, SIZE, 0.7, |at| if radius(at, [24.0, 24.0], [7.0, 7.0], 0.0) < 1.0 && at.x < 27.0 { 0.8 } else { 0.1 });
    assert_eq!(refused(&hidden, [24.0, 24.0]), NoTarget::NoEllipse);
    let faint = Noise::new(3).added(&disc([24.0, 24.0], [3.0, 3.0], 0.0, 1.0), 0.5);
    assert!(measure_circle(&faint, [24.0, 24.0], 6.0).is_err());
}

#[test]
fn the_target_that_is_meant_is_taken() {
    let two = |gap: f64| {
        rendered(SIZE, SIZE, 0.7, |at| {
            let near = |x: f64| radius(at, [x, 24.0], [3.0, 3.0], 0.0) < 1.0;
            if near(24.0 - gap / 2.0) || near(24.0 + gap / 2.0) { 0.8 } else { 0.1 }
        })
    };
    let image = two(12.0);
    let target = measure_circle(&image, [19.0, 24.0], 12.0).expect("one is much nearer");
    assert!(off(&target, [18.0, 24.0]) < 0.02);
    assert!(matches!(measure_circle(&image, [24.2, 24.0], 12.0), Err(NoTarget::Ambiguous(_))));
}

/// Bits do not depend on what else is in the image.
#[test]
fn a_target_is_measured_from_its_surroundings_alone() {
    let image = disc([24.3, 23.8], [4.0, 4.0], 0.0, 0.7);
    let mut changed = image.clone();
    changed[(1, 1)] = 0.9;
    assert_eq!(measured(&image, [24.0, 24.0]), measured(&changed, [24.0, 24.0]));
}
