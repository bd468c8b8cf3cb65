//! Albedo: noise of several octaves in 3D, so that it does not repeat and follows the surface.

use super::surface::Material;
use crate::random::mix;
use nalgebra::Vector3;

/// Coarsest wavelength, metres, and number of octaves: 0.5 m down to 8 mm.
const COARSEST_M: f64 = 0.5;
const OCTAVES: i32 = 7;

/// A value in -1..1 at each corner of the unit grid.
fn corner(x: i64, y: i64, z: i64, seed: u64) -> f64 {
    let key = (x as u64).wrapping_mul(0x8CB9_2BA7_2F3D_8DD7)
        ^ (y as u64).wrapping_mul(0xA24B_AED4_963E_E407)
        ^ (z as u64).wrapping_mul(0x9FB2_1C65_1E98_DF25);
    (mix(key ^ seed) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Value noise with a smooth step between the corners.
fn noise(p: &Vector3<f64>, seed: u64) -> f64 {
    let floor = p.map(f64::floor);
    let t = (p - floor).map(|v| v * v * (3.0 - 2.0 * v));
    let (x, y, z) = (floor.x as i64, floor.y as i64, floor.z as i64);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let along_x = |dy, dz| mix(corner(x, y + dy, z + dz, seed), corner(x + 1, y + dy, z + dz, seed), t.x);
    mix(mix(along_x(0, 0), along_x(1, 0), t.y), mix(along_x(0, 1), along_x(1, 1), t.y), t.z)
}

/// Octaves of noise in about -1..1; octaves finer than two footprints fade out, as a lens would blur them.
pub(super) fn fractal(p: &Vector3<f64>, footprint_m: f64, seed: u64) -> f64 {
    let mut sum = 0.0;
    let mut wavelength = COARSEST_M;
    for octave in 0..OCTAVES {
        let share = ((wavelength / footprint_m - 1.5) / 1.5).clamp(0.0, 1.0);
        if share > 0.0 {
            // Shifted octave by octave, so that grid planes do not fall together.
            let shifted = p / wavelength + Vector3::new(0.37, 0.61, 0.13) * f64::from(octave);
            sum += share * 0.5 * noise(&shifted, seed.wrapping_add(octave as u64));
        }
        wavelength /= 2.0;
    }
    sum
}

/// Width of the bands of a scale bar, metres.
const BAND_M: f64 = 0.1;

/// Linear RGB albedo at a point of a surface.
pub(super) fn albedo(p: &Vector3<f64>, material: Material, footprint_m: f64, seed: u64) -> [f64; 3] {
    let grain = fractal(p, footprint_m, seed);
    let tint = fractal(&(p * 0.6), footprint_m, seed ^ 0x5EED);
    let (base, contrast) = match material {
        Material::Concrete => ([0.30, 0.31, 0.24], 0.75),
        Material::Sand => ([0.52, 0.50, 0.42], 0.45),
        Material::Bar if ((p.x + p.z) / BAND_M).floor().rem_euclid(2.0) < 1.0 => ([0.06, 0.06, 0.06], 0.2),
        Material::Bar => ([0.85, 0.84, 0.80], 0.1),
    };
    let light = (1.0 + contrast * grain).max(0.08);
    [base[0] * light * (1.0 + 0.25 * tint), base[1] * light, base[2] * light * (1.0 - 0.2 * tint)].map(|v: f64| v.clamp(0.01, 0.95))
}
