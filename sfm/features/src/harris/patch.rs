//! Grey values about a corner as a descriptor.

use scene::{Descriptor, Raster};

/// Samples along the side of a patch: 121 of the 128 bytes.
const SIDE: usize = 11;
/// Distance of samples, pixels: patches are 21 x 21 pixels.
const STEP_PX: f32 = 2.0;
/// Corners keep this far from the border, pixels.
pub(super) const MARGIN_PX: usize = 12;
/// Length of a patch of unit norm. Patches are stored about [`ZERO`]; only a patch with half of its variance in one sample is cut.
pub(super) const UNIT: f64 = 256.0;
/// The byte of a grey value that is the mean of the patch.
const ZERO: f32 = 128.0;

/// The patch about a place, less its mean and with unit norm: what the brightness and contrast of the light do is gone, and the scalar product
/// of two patches is their normalised cross-correlation. `None` where all is one grey.
pub(super) fn describe(smooth: &Raster<f32>, x: f32, y: f32) -> Option<Descriptor> {
    let reach = (SIDE / 2) as f32 * STEP_PX;
    let (x0, y0) = (x - reach, y - reach);
    let (left, top) = (x0.floor(), y0.floor());
    let (fx, fy) = (x0 - left, y0 - top);
    let mut values = [0.0f32; SIDE * SIDE];
    let mut sum = 0.0;
    for j in 0..SIDE {
        let row = top as usize + 2 * j;
        let (upper, lower) = (smooth.row(row), smooth.row(row + 1));
        for i in 0..SIDE {
            let column = left as usize + 2 * i;
            let between = |r: &[f32]| r[column] + fx * (r[column + 1] - r[column]);
            let (a, b) = (between(upper), between(lower));
            let value = a + fy * (b - a);
            values[j * SIDE + i] = value;
            sum += value;
        }
    }
    let mean = sum / (SIDE * SIDE) as f32;
    let norm = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f32>().sqrt();
    if norm < 1e-5 {
        return None;
    }
    let mut descriptor = [ZERO as u8; 128];
    for (byte, value) in descriptor.iter_mut().zip(values) {
        *byte = (ZERO + (value - mean) / norm * UNIT as f32).round().clamp(0.0, 255.0) as u8;
    }
    Some(descriptor)
}

/// Squared distance of two descriptors.
pub(super) fn distance(a: &Descriptor, b: &Descriptor) -> u32 {
    a.iter().zip(b).map(|(&x, &y)| (i32::from(x) - i32::from(y)).pow(2) as u32).sum()
}

/// The squared distance of patches that correlate by `correlation`: |a - b|^2 = 2 - 2 a.b.
pub(super) fn distance_at(correlation: f64) -> f64 {
    UNIT * UNIT * (2.0 - 2.0 * correlation)
}
