//! Low passes on frames of linear light.

use rayon::prelude::*;

type Light = [f32; 3];

/// Half of a sampled Gaussian, from its centre outwards; the whole kernel sums to one.
fn kernel(sigma: f32) -> Vec<f32> {
    let radius = (3.0 * sigma).ceil() as usize;
    let values: Vec<f32> = (0..=radius).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
    let sum = values[0] + 2.0 * values[1..].iter().sum::<f32>();
    values.into_iter().map(|v| v / sum).collect()
}

/// Gaussian blur in place; the border is continued by its last pixel. A `sigma` below 0.05 pixels changes nothing.
pub(super) fn blur(frame: &mut [Light], width: usize, sigma: f32) {
    if sigma < 0.05 || frame.is_empty() {
        return;
    }
    let (kernel, height) = (kernel(sigma), frame.len() / width);
    let mut rows = vec![[0.0; 3]; frame.len()];
    rows.par_chunks_mut(width).zip(frame.par_chunks(width)).for_each(|(out, row)| {
        for (x, out) in out.iter_mut().enumerate() {
            *out = weigh(&kernel, |i| &row[x.saturating_sub(i)], |i| &row[(x + i).min(width - 1)]);
        }
    });
    frame.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (x, out) in out.iter_mut().enumerate() {
            *out = weigh(&kernel, |i| &rows[y.saturating_sub(i) * width + x], |i| &rows[(y + i).min(height - 1) * width + x]);
        }
    });
}

fn weigh<'a>(kernel: &[f32], before: impl Fn(usize) -> &'a Light, after: impl Fn(usize) -> &'a Light) -> Light {
    let mut sum = before(0).map(|v| v * kernel[0]);
    for (i, &weight) in kernel.iter().enumerate().skip(1) {
        let (a, b) = (before(i), after(i));
        for c in 0..3 {
            sum[c] += weight * (a[c] + b[c]);
        }
    }
    sum
}

/// Adds light spread by a wide Gaussian: at a quarter of the size where it is wide enough for that.
pub(super) fn halo(light: &[Light], width: usize, sigma: f32, frame: &mut [Light]) {
    const STEP: usize = 4;
    let height = light.len() / width;
    if sigma < 2.0 * STEP as f32 || width < STEP || height < STEP {
        let mut spread = light.to_vec();
        blur(&mut spread, width, sigma);
        frame.iter_mut().zip(&spread).for_each(|(f, s)| (0..3).for_each(|c| f[c] += s[c]));
        return;
    }
    let (columns, rows) = (width.div_ceil(STEP), height.div_ceil(STEP));
    let mut small = vec![[0.0; 3]; columns * rows];
    small.par_chunks_mut(columns).enumerate().for_each(|(j, out)| {
        for (i, out) in out.iter_mut().enumerate() {
            let mut count = 0.0;
            for y in j * STEP..((j + 1) * STEP).min(height) {
                for value in &light[y * width..][i * STEP..((i + 1) * STEP).min(width)] {
                    (0..3).for_each(|c| out[c] += value[c]);
                    count += 1.0;
                }
            }
            *out = out.map(|v| v / count);
        }
    });
    blur(&mut small, columns, sigma / STEP as f32);
    frame.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let (top, bottom, fy) = between(y, STEP, rows);
        for (x, out) in out.iter_mut().enumerate() {
            let (left, right, fx) = between(x, STEP, columns);
            for c in 0..3 {
                let at = |j: usize, i: usize| small[j * columns + i][c];
                let (a, b) = (at(top, left) * (1.0 - fx) + at(top, right) * fx, at(bottom, left) * (1.0 - fx) + at(bottom, right) * fx);
                out[c] += a * (1.0 - fy) + b * fy;
            }
        }
    });
}

/// The two cells about the middle of a pixel and the share of the second.
fn between(pixel: usize, step: usize, count: usize) -> (usize, usize, f32) {
    let place = ((pixel as f32 + 0.5) / step as f32 - 0.5).max(0.0);
    let first = (place as usize).min(count - 1);
    (first, (first + 1).min(count - 1), place - first as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Second moment of a bright pixel after blurring is the variance asked for; nothing is lost.
    #[test]
    fn a_point_spreads_by_the_deviation_asked_for() {
        for sigma in [0.6, 3.0, 9.0] {
            let mut light = vec![[0.0; 3]; 121 * 121];
            light[60 * 121 + 60] = [1.0, 2.0, 0.0];
            let mut frame = vec![[0.0; 3]; 121 * 121];
            halo(&light, 121, sigma, &mut frame);
            let (mut sum, mut second) = (0.0, 0.0);
            for (i, v) in frame.iter().enumerate() {
                sum += f64::from(v[0]);
                second += f64::from(v[0]) * ((i % 121) as f64 - 60.0).powi(2);
            }
            let deviation = (second / sum).sqrt();
            // The sampled kernel ends at 3 sigma; the quarter size adds (4^2 - 1) / 12 by its cells, and its bilinear look-up.
            assert!((sum - 1.0).abs() < 1e-3 && (deviation / f64::from(sigma) - 1.0).abs() < 0.04, "{sigma}: {sum} {deviation}");
            assert!((frame[60 * 121 + 60][1] / frame[60 * 121 + 60][0] - 2.0).abs() < 1e-4);
        }
    }
}
