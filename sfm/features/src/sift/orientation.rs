//! Dominant gradient directions around a keypoint.

use super::simd::dispatched;
use std::f32::consts::{PI, TAU};

/// A level of the pyramid.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    /// Row after row.
    pub(super) data: &'a [f32],
    /// Columns.
    pub(super) width: usize,
    /// Rows.
    pub(super) height: usize,
}

/// Bins of the histogram.
const BINS: usize = 36;
/// Standard deviation of the window, in standard deviations of the keypoint.
const WINDOW: f32 = 1.5;
/// Radius of the window in its standard deviations.
const CUT: f32 = 3.0;
/// A peak counts from this fraction of the highest.
const PEAK: f32 = 0.8;
/// Rounds of smoothing with [1 1 1] / 3.
const SMOOTHING: usize = 6;
/// Gradients computed at a time.
const LANES: usize = 16;

/// Angle of (x, y) in radians, from -pi to pi, to 1e-5; 0 for (0, 0).
///
/// Minimax polynomial of odd powers for the arc tangent on 0..=1 (Abramowitz & Stegun, 4.4.49), mirrored into the eight octants.
#[inline(always)]
pub(super) fn fast_angle(x: f32, y: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = if ax < ay { (ax, ay) } else { (ay, ax) };
    let ratio = small / (large + f32::MIN_POSITIVE);
    let s = ratio * ratio;
    let odd = 1.0
        + s * (-0.333_314_5
            + s * (0.199_935_5
                + s * (-0.142_089 + s * (0.106_562_6 + s * (-0.075_289_6 + s * (0.042_909_6 + s * (-0.016_165_7 + s * 0.002_866_2)))))));
    let mut angle = ratio * odd;
    angle = if ax < ay { 0.5 * PI - angle } else { angle };
    angle = if x < 0.0 { PI - angle } else { angle };
    if y < 0.0 { -angle } else { angle }
}

/// Histogram of gradient directions around (x, y), each weighted with its magnitude and a Gaussian window.
#[inline(always)]
fn histogram_body(view: View, x: f32, y: f32, sigma: f32, histogram: &mut [f32; BINS]) {
    let window = WINDOW * sigma;
    let radius = (CUT * window).floor().max(1.0);
    // Gradients need a neighbour on each side.
    let range = |c: f32, size: usize| ((c - radius).ceil().max(1.0) as usize, ((c + radius).floor().max(0.0) as usize).min(size - 2));
    let ((x0, x1), (y0, y1)) = (range(x, view.width), range(y, view.height));
    let falloff = -0.5 / (window * window);
    let mut bins = [0f32; LANES];
    let mut weights = [0f32; LANES];
    let mut across = [0f32; 256];
    if x1 < x0 || x1 - x0 >= across.len() {
        return;
    }
    for i in 0..=x1 - x0 {
        let d = (x0 + i) as f32 - x;
        across[i] = (falloff * d * d).exp();
    }
    for row in y0..=y1 {
        let d = row as f32 - y;
        let along = (falloff * d * d).exp();
        let line = |r: usize| &view.data[r * view.width..][..view.width];
        let (above, here, below) = (line(row - 1), line(row), line(row + 1));
        let mut start = x0;
        while start <= x1 {
            let n = LANES.min(x1 + 1 - start);
            let gradient = |l: usize, right: &[f32], left: &[f32], up: &[f32], down: &[f32]| {
                let (gx, gy) = (right[l] - left[l], down[l] - up[l]);
                ((gx * gx + gy * gy).sqrt(), fast_angle(gx, gy))
            };
            let (right, left) = (&here[start + 1..start + 1 + n], &here[start - 1..start - 1 + n]);
            let (up, down) = (&above[start..start + n], &below[start..start + n]);
            let falloffs = &across[start - x0..start - x0 + n];
            if n == LANES {
                for l in 0..LANES {
                    let (magnitude, angle) = gradient(l, &right[..LANES], &left[..LANES], &up[..LANES], &down[..LANES]);
                    weights[l] = magnitude * (falloffs[l] * along);
                    bins[l] = (angle + PI) * (BINS as f32 / TAU);
                }
            } else {
                for l in 0..n {
                    let (magnitude, angle) = gradient(l, right, left, up, down);
                    weights[l] = magnitude * (falloffs[l] * along);
                    bins[l] = (angle + PI) * (BINS as f32 / TAU);
                }
            }
            for l in 0..n {
                // Bin b is centred at b + 0.5: shared between the two nearest.
                let position = bins[l] + (BINS as f32 - 0.5);
                let low = position as i32;
                let share = position - low as f32;
                histogram[low as usize % BINS] += (1.0 - share) * weights[l];
                histogram[(low + 1) as usize % BINS] += share * weights[l];
            }
            start += n;
        }
    }
}

dispatched!(
    /// Adds the gradient directions around a keypoint to a histogram whose bin b is centred at (b + 0.5) / 36 turns from -x.
    gradient_histogram(view: View, x: f32, y: f32, sigma: f32, histogram: &mut [f32; BINS]) = histogram_body
);

/// Directions of at most `most` peaks around the keypoint at (x, y) of standard deviation `sigma`, all in pixels of `view` with the centre
/// of the top-left pixel at (0, 0): radians from -pi to pi, clockwise from +x (y down), the highest peak first. Lowe 2004, section 5.
pub(super) fn orientations(simd: super::simd::Simd, view: View, x: f32, y: f32, sigma: f32, most: usize) -> Vec<f32> {
    let mut histogram = [0f32; BINS];
    gradient_histogram(simd, view, x, y, sigma, &mut histogram);
    for _ in 0..SMOOTHING {
        let before = histogram;
        for b in 0..BINS {
            histogram[b] = (before[(b + BINS - 1) % BINS] + before[b] + before[(b + 1) % BINS]) / 3.0;
        }
    }
    let highest = histogram.iter().fold(0f32, |a, &b| a.max(b));
    let mut peaks: Vec<(f32, f32)> = Vec::new();
    for b in 0..BINS {
        let (left, here, right) = (histogram[(b + BINS - 1) % BINS], histogram[b], histogram[(b + 1) % BINS]);
        if here >= PEAK * highest && here > left && here >= right {
            let shift = 0.5 * (left - right) / (left - 2.0 * here + right);
            peaks.push((here, (b as f32 + 0.5 + shift) * (TAU / BINS as f32) - PI));
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(most);
    peaks.into_iter().map(|(_, angle)| angle).collect()
}
