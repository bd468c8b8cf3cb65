//! The descriptor: histograms of gradient directions in 4 x 4 cells of a square that turns and grows with the keypoint.
//!
//! The square is resampled on a grid of its own, so gradients come out in its frame, and the spatial weights (Lowe's Gaussian window times
//! the linear sharing between cells) are the same for all keypoints and separate into columns and rows: pooling needs no scattering.

use super::orientation::{View, fast_angle};
use super::simd::dispatched;
use scene::Descriptor;
use std::f32::consts::TAU;
use std::sync::LazyLock;

/// Cells on a side.
const CELLS: usize = 4;
/// Directions of a cell.
const DIRECTIONS: usize = 8;
/// Side of a cell in standard deviations of the keypoint.
const CELL_SIGMAS: f32 = 3.5;
/// Gradients on a side of the grid, which covers half a cell more than the cells on each side.
const GRID: usize = 24;
/// Samples on a side: gradients are differences of neighbours.
const SAMPLES: usize = GRID + 2;
/// Width that rows of samples are padded to.
const PADDED: usize = 32;
/// Distance of samples in cells.
const SPACING: f32 = (CELLS + 1) as f32 / GRID as f32;
/// Largest share of one entry in the norm (Lowe 2004): limits the weight of strong edges.
const CLAMP: f32 = 0.2;

/// `WEIGHTS[c][i]`: share of gradient i in cell c, along one axis.
static WEIGHTS: LazyLock<[[f32; GRID]; CELLS]> = LazyLock::new(|| {
    let mut weights = [[0f32; GRID]; CELLS];
    for (c, row) in weights.iter_mut().enumerate() {
        for (i, weight) in row.iter_mut().enumerate() {
            let at = (i as f32 - 0.5 * (GRID - 1) as f32) * SPACING;
            let from_cell = (at - (c as f32 - 0.5 * (CELLS - 1) as f32)).abs();
            // Standard deviation of the window: half the cells.
            let window = (-0.5 * (at / (0.5 * CELLS as f32)).powi(2)).exp();
            *weight = window * (1.0 - from_cell).max(0.0);
        }
    }
    weights
});

/// Samples row `row` of the grid: centre (x, y), steps (cos, sin) along the grid's columns.
#[inline(always)]
fn sample_row(view: View, x: f32, y: f32, cos: f32, sin: f32, row: usize, out: &mut [f32; PADDED]) {
    let half = 0.5 * (SAMPLES - 1) as f32;
    let dv = row as f32 - half;
    let (right, bottom) = ((view.width - 1) as f32, (view.height - 1) as f32);
    let (last_x, last_y) = ((view.width - 2) as i32, (view.height - 2) as i32);
    let mut at = [0i32; PADDED];
    let (mut fx, mut fy) = ([0f32; PADDED], [0f32; PADDED]);
    for i in 0..PADDED {
        let du = i as f32 - half;
        let px = x + (cos * du - sin * dv);
        let py = y + (sin * du + cos * dv);
        // Beyond the border the image continues with its border values.
        let px = if px > 0.0 { px } else { 0.0 };
        let py = if py > 0.0 { py } else { 0.0 };
        let px = if px < right { px } else { right };
        let py = if py < bottom { py } else { bottom };
        let (ix, iy) = (px as i32, py as i32);
        let ix = if ix < last_x { ix } else { last_x };
        let iy = if iy < last_y { iy } else { last_y };
        fx[i] = px - ix as f32;
        fy[i] = py - iy as f32;
        at[i] = iy * view.width as i32 + ix;
    }
    let (mut a, mut b, mut c, mut d) = ([0f32; PADDED], [0f32; PADDED], [0f32; PADDED], [0f32; PADDED]);
    for i in 0..SAMPLES {
        let upper = &view.data[at[i] as usize..][..2];
        let lower = &view.data[at[i] as usize + view.width..][..2];
        (a[i], b[i], c[i], d[i]) = (upper[0], upper[1], lower[0], lower[1]);
    }
    for i in 0..PADDED {
        let upper = a[i] + fx[i] * (b[i] - a[i]);
        let lower = c[i] + fx[i] * (d[i] - c[i]);
        out[i] = upper + fy[i] * (lower - upper);
    }
}

/// The raw histograms, [row of cells][direction][column of gradients], before pooling over columns.
type Rows = [[[f32; GRID]; DIRECTIONS]; CELLS];

#[inline(always)]
fn rows_body(view: View, x: f32, y: f32, cos: f32, sin: f32, weights: &[[f32; GRID]; CELLS], rows: &mut Rows) {
    let mut samples = [[0f32; PADDED]; 3];
    sample_row(view, x, y, cos, sin, 0, &mut samples[0]);
    sample_row(view, x, y, cos, sin, 1, &mut samples[1]);
    let (mut magnitude, mut direction) = ([0f32; GRID], [0f32; GRID]);
    for v in 0..GRID {
        sample_row(view, x, y, cos, sin, v + 2, &mut samples[(v + 2) % 3]);
        let (above, here, below) = (&samples[v % 3], &samples[(v + 1) % 3], &samples[(v + 2) % 3]);
        for i in 0..GRID {
            let (gu, gv) = (here[i + 2] - here[i], below[i + 1] - above[i + 1]);
            magnitude[i] = (gu * gu + gv * gv).sqrt();
            let turn = fast_angle(gu, gv) * (DIRECTIONS as f32 / TAU);
            direction[i] = if turn < 0.0 { turn + DIRECTIONS as f32 } else { turn };
        }
        for b in 0..DIRECTIONS {
            let mut share = [0f32; GRID];
            for i in 0..GRID {
                let from = (direction[i] - b as f32).abs();
                let around = DIRECTIONS as f32 - from;
                let distance = if from < around { from } else { around };
                let linear = 1.0 - distance;
                share[i] = magnitude[i] * if linear > 0.0 { linear } else { 0.0 };
            }
            for c in 0..CELLS {
                let weight = weights[c][v];
                if weight > 0.0 {
                    for i in 0..GRID {
                        rows[c][b][i] += weight * share[i];
                    }
                }
            }
        }
    }
}

dispatched!(
    /// Histograms of a patch whose samples are (cos, sin) pixels apart, pooled over its rows.
    patch_rows(view: View, x: f32, y: f32, cos: f32, sin: f32, weights: &[[f32; GRID]; CELLS], rows: &mut Rows) = rows_body
);

/// The RootSIFT descriptor of the keypoint at (x, y), all in pixels of `view` with the centre of the top-left pixel at (0, 0). All zero
/// where the patch is uniform.
pub(super) fn describe(simd: super::simd::Simd, view: View, x: f32, y: f32, sigma: f32, angle: f32) -> Descriptor {
    let step = CELL_SIGMAS * sigma * SPACING;
    let weights = &*WEIGHTS;
    let mut rows: Rows = [[[0f32; GRID]; DIRECTIONS]; CELLS];
    patch_rows(simd, view, x, y, step * angle.cos(), step * angle.sin(), weights, &mut rows);
    let mut histogram = [0f32; CELLS * CELLS * DIRECTIONS];
    for (cy, row) in rows.iter().enumerate() {
        for (b, shares) in row.iter().enumerate() {
            for (cx, weight) in weights.iter().enumerate() {
                let mut sum = 0f32;
                for i in 0..GRID {
                    sum += weight[i] * shares[i];
                }
                histogram[(cy * CELLS + cx) * DIRECTIONS + b] = sum;
            }
        }
    }
    quantise(&histogram)
}

/// Clamps against the L2 norm, takes the square root of the L1-normalised entries, and rounds to 512ths.
fn quantise(histogram: &[f32; 128]) -> Descriptor {
    let norm = histogram.iter().map(|v| v * v).sum::<f32>().sqrt();
    let mut clamped = *histogram;
    for v in &mut clamped {
        *v = v.min(CLAMP * norm);
    }
    let sum: f32 = clamped.iter().sum();
    // What is not a number becomes 0 as a byte, so a uniform patch needs no case of its own.
    clamped.map(|v| (512.0 * (v / sum).sqrt()).round() as u8)
}
