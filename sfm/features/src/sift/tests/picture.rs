//! Pictures that are functions of the plane, so that they can be rendered under any warp without resampling.

use scene::Raster;

/// A hash of a lattice point to 0..1.
fn hash(x: i64, y: i64, seed: u64) -> f64 {
    let mut h = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
        ^ seed.wrapping_mul(0x1656_67b1_9e37_79f9);
    h = (h ^ (h >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    h = (h ^ (h >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    ((h ^ (h >> 33)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Smooth random values at lattice points `wavelength` apart, blended with quintic weights: 0..1, twice differentiable.
fn lattice(x: f64, y: f64, wavelength: f64, seed: u64) -> f64 {
    let (u, v) = (x / wavelength, y / wavelength);
    let (iu, iv) = (u.floor(), v.floor());
    let ease = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (a, b) = (ease(u - iu), ease(v - iv));
    let at = |dx: i64, dy: i64| hash(iu as i64 + dx, iv as i64 + dy, seed);
    (at(0, 0) * (1.0 - a) + at(1, 0) * a) * (1.0 - b) + (at(0, 1) * (1.0 - a) + at(1, 1) * a) * b
}

/// Texture at the point (x, y): noise of wavelengths from 5 px to 300 px, about as strong at all of them; 0.1..0.9.
pub(super) fn texture(x: f64, y: f64, seed: u64) -> f64 {
    let (mut sum, mut total, mut wavelength) = (0f64, 0f64, 5f64);
    for i in 0..10u32 {
        // Turned against each other, or all lattices would have the same axes.
        let (s, c) = (0.7 * f64::from(i)).sin_cos();
        let strength = wavelength.powf(0.3);
        sum += strength * lattice(c * x - s * y, s * x + c * y, wavelength, seed + u64::from(i));
        total += strength;
        wavelength *= 1.6;
    }
    (0.5 + 1.6 * (sum / total - 0.5)).clamp(0.0, 1.0)
}

/// An image of `value` at the pixel centres.
pub(super) fn render(width: usize, height: usize, value: impl Fn(f64, f64) -> f64) -> Raster<f32> {
    let data = (0..width * height).map(|i| value((i % width) as f64 + 0.5, (i / width) as f64 + 0.5) as f32).collect();
    Raster::from_vec(width, height, data).expect("the size fits")
}

/// An image of [`texture`].
pub(super) fn textured(width: usize, height: usize, seed: u64) -> Raster<f32> {
    render(width, height, |x, y| texture(x, y, seed))
}
