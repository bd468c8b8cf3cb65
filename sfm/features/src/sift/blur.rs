//! Separable Gaussian filters over rows.

use super::simd::dispatched;

/// Pixels that an inner loop works on at a time.
const LANES: usize = 16;
/// Rows that one vertical pass produces together, so that each row it reads serves several times.
pub(super) const ROWS: usize = 4;
/// Radius of a kernel in standard deviations: beyond lie 0.05 % of the weight.
const CUT: f64 = 3.5;

/// A sampled Gaussian of odd length, of sum 1.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    weights: Vec<f32>,
}

impl Kernel {
    /// The kernel of standard deviation `sigma` pixels.
    pub(super) fn gaussian(sigma: f64) -> Self {
        let radius = ((CUT * sigma).ceil() as usize).max(2);
        let raw: Vec<f64> = (0..=2 * radius).map(|i| (-0.5 * ((i as f64 - radius as f64) / sigma).powi(2)).exp()).collect();
        let sum: f64 = raw.iter().sum();
        Self { weights: raw.iter().map(|w| (w / sum) as f32).collect() }
    }

    /// Pixels on each side of the centre.
    pub(super) fn radius(&self) -> usize {
        self.weights.len() / 2
    }

    /// All weights.
    pub(super) fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The weights from the centre outwards.
    pub(super) fn half(&self) -> &[f32] {
        &self.weights[self.radius()..]
    }
}

#[inline(always)]
fn lanes(row: &[f32], x: usize) -> &[f32; LANES] {
    row[x..x + LANES].try_into().expect("the slice has that length")
}

#[inline(always)]
fn multiply_add(mut sum: [f32; LANES], weight: f32, values: &[f32; LANES]) -> [f32; LANES] {
    for l in 0..LANES {
        sum[l] += weight * values[l];
    }
    sum
}

/// `out[j * stride + x]` for j below R = sum over i of `weights[i] * rows[i + j][x]`.
#[inline(always)]
fn columns<const R: usize>(rows: &[&[f32]], weights: &[f32], out: &mut [f32], stride: usize, width: usize) {
    let taps = weights.len();
    assert!(taps >= R && rows.len() == taps + R - 1);
    let mut x = 0;
    while x + LANES <= width {
        let mut sums = [[0f32; LANES]; R];
        // The bounds of the inner loops are constants: only so are the sums kept in registers.
        for i in 0..R - 1 {
            let values = lanes(rows[i], x);
            for j in 0..R {
                if j <= i {
                    sums[j] = multiply_add(sums[j], weights[i - j], values);
                }
            }
        }
        for i in R - 1..taps {
            let values = lanes(rows[i], x);
            let window: &[f32; R] = weights[i + 1 - R..=i].try_into().expect("the slice has that length");
            for j in 0..R {
                sums[j] = multiply_add(sums[j], window[R - 1 - j], values);
            }
        }
        for i in 0..R - 1 {
            let values = lanes(rows[taps + i], x);
            for j in 0..R {
                if j > i {
                    sums[j] = multiply_add(sums[j], weights[taps + i - j], values);
                }
            }
        }
        for j in 0..R {
            out[j * stride + x..][..LANES].copy_from_slice(&sums[j]);
        }
        x += LANES;
    }
    for x in x..width {
        for j in 0..R {
            let mut sum = 0f32;
            for i in 0..taps {
                sum += weights[i] * rows[i + j][x];
            }
            out[j * stride + x] = sum;
        }
    }
}

/// `out[x] = half[0] * padded[x + r] + sum over i of half[i] * (padded[x + r - i] + padded[x + r + i])`, with r the radius.
#[inline(always)]
fn row(padded: &[f32], half: &[f32], out: &mut [f32]) {
    let radius = half.len() - 1;
    let width = out.len();
    assert!(padded.len() >= width + 2 * radius);
    let mut x = 0;
    while x + 2 * LANES <= width {
        let mut sums = [[0f32; LANES]; 2];
        for (v, sum) in sums.iter_mut().enumerate() {
            let centre = lanes(padded, x + radius + v * LANES);
            for l in 0..LANES {
                sum[l] = half[0] * centre[l];
            }
        }
        for i in 1..=radius {
            for (v, sum) in sums.iter_mut().enumerate() {
                let left = lanes(padded, x + v * LANES + radius - i);
                let right = lanes(padded, x + v * LANES + radius + i);
                for l in 0..LANES {
                    sum[l] += half[i] * (left[l] + right[l]);
                }
            }
        }
        for (v, sum) in sums.iter().enumerate() {
            out[x + v * LANES..][..LANES].copy_from_slice(sum);
        }
        x += 2 * LANES;
    }
    for x in x..width {
        let mut sum = half[0] * padded[x + radius];
        for i in 1..=radius {
            sum += half[i] * (padded[x + radius - i] + padded[x + radius + i]);
        }
        out[x] = sum;
    }
}

#[inline(always)]
fn difference_body(a: &[f32], b: &[f32], out: &mut [f32]) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = a - b;
    }
}

dispatched!(
    /// Filters columns: [`ROWS`] rows of output, `stride` values apart, from the `weights.len() + ROWS - 1` rows that they cover.
    blur_columns(rows: &[&[f32]], weights: &[f32], out: &mut [f32], stride: usize, width: usize) = columns::<ROWS>
);
dispatched!(
    /// Filters columns: one row of output. The same bits as [`blur_columns`].
    blur_column(rows: &[&[f32]], weights: &[f32], out: &mut [f32], stride: usize, width: usize) = columns::<1>
);
dispatched!(
    /// Filters a row that has `half.len() - 1` values of padding at each end.
    blur_row(padded: &[f32], half: &[f32], out: &mut [f32]) = row
);
dispatched!(
    /// `out = a - b`.
    difference(a: &[f32], b: &[f32], out: &mut [f32]) = difference_body
);
