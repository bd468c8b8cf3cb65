//! Position and size of single Gaussian blobs, known exactly.

use super::picture::render;
use crate::{SiftOptions, extract};
use scene::Keypoint;

/// Sub-pixel positions of the blobs on an image of `side` pixels.
fn centres(side: f64) -> Vec<[f64; 2]> {
    [[0.0, 0.0], [0.5, 0.5], [0.13, 0.37], [0.25, 0.81], [0.66, 0.5], [0.92, 0.08]].map(|d| [side / 2.0 + d[0], side / 2.0 + d[1]]).to_vec()
}

/// The strongest keypoint of an image of one blob of the given centre, standard deviation and amplitude.
fn find(side: usize, centre: [f64; 2], sigma: f64, amplitude: f64, options: &SiftOptions) -> Keypoint {
    let image = render(side, side, |x, y| {
        let (dx, dy) = (x - centre[0], y - centre[1]);
        0.5 + amplitude * (-0.5 * (dx * dx + dy * dy) / (sigma * sigma)).exp()
    });
    let features = extract(&image, None, options).expect("valid options");
    assert!(!features.is_empty(), "no keypoint for sigma {sigma} at {centre:?}");
    features.keypoints[0]
}

#[test]
fn blobs_are_found_where_they_are() {
    for options in [SiftOptions::default(), SiftOptions { double_image: true, ..SiftOptions::default() }] {
        for sigma in [2.4, 3.0, 4.0, 5.5, 7.0, 9.0, 13.0] {
            for centre in centres(160.0) {
                for amplitude in [0.4, -0.4] {
                    let k = find(160, centre, sigma, amplitude, &options);
                    let error = (f64::from(k.x) - centre[0]).hypot(f64::from(k.y) - centre[1]);
                    assert!(error < 0.03, "sigma {sigma}, centre {centre:?}: off by {error}, doubled: {}", options.double_image);
                    // The difference of levels s and k s is largest where s^2 = t / k, with t the variance of the blob before the
                    // camera's blur. 4 %: the parabola over levels that are 26 % apart, and the grid of octave 2.
                    let expected = (sigma * sigma - 0.25).sqrt() / 2f64.powf(1.0 / 6.0);
                    let ratio = f64::from(k.scale) / expected;
                    assert!((ratio - 1.0).abs() < 0.04, "sigma {sigma}: scale {} is not {expected}", k.scale);
                }
            }
        }
    }
}

#[test]
fn faint_blobs_are_found_when_nothing_else_is() {
    let options = SiftOptions::default();
    // A blob of amplitude a has a difference of Gaussians of about 0.11 a: this one lies between the two thresholds.
    let k = find(160, [80.3, 79.6], 4.0, 0.03, &options);
    assert!((k.x - 80.3).hypot(k.y - 79.6) < 0.03);
    let strict = SiftOptions { low_contrast_fraction: 1.0, ..options };
    let image = render(160, 160, |x, y| 0.5 + 0.03 * (-((x - 80.3).powi(2) + (y - 79.6).powi(2)) / 32.0).exp());
    assert!(extract(&image, None, &strict).expect("valid options").is_empty());
}
