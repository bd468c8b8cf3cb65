//! How much a place looks like a corner of the board.

use crate::sample::{bilinear, inside};
use nalgebra::Vector2;
use scene::Raster;

/// Correlation with four squares, of which that between `u` and `v` is bright, -1 to 1; `u` and `v` lead to the next corners. `None`
/// where the squares reach beyond the image.
pub(super) fn correlation(image: &Raster<f32>, at: &Vector2<f64>, u: &Vector2<f64>, v: &Vector2<f64>) -> Option<f64> {
    const SHARES: [f64; 6] = [-0.36, -0.24, -0.12, 0.12, 0.24, 0.36];
    let (mut sum, mut square, mut with) = (0.0, 0.0, 0.0);
    for a in SHARES {
        for b in SHARES {
            let p = at + u * a + v * b;
            if !inside(image, &p, 0.5) {
                return None;
            }
            let value = bilinear(image, p.x, p.y);
            sum += value;
            square += value * value;
            with += value * (a * b).signum();
        }
    }
    let n = (SHARES.len() * SHARES.len()) as f64;
    let variance = (square / n - (sum / n).powi(2)).max(0.0);
    // Flat places, whose noise might look like anything, do not count.
    Some(with / n / (variance.sqrt() + 0.05))
}
