//! What surfaces look like up close.

use super::noise::{fractal, gradient};
use crate::world::{Material, Panel};
use nalgebra::Vector3;

type Colour = [f32; 3];

/// Linear RGB albedo at a point of a surface, in the frame of its body; `footprint_m` is the size of a pixel there.
pub(crate) fn albedo(p: &Vector3<f64>, material: &Material, panels: &[Panel], footprint_m: f32, seed: u32) -> Colour {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function is compiled for.
        return unsafe { albedo_avx2(p, material, panels, footprint_m, seed) };
    }
    albedo_of(p, material, panels, footprint_m, seed)
}

/// The same with wider vectors: the same operations in the same order, so the same bits.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn albedo_avx2(p: &Vector3<f64>, material: &Material, panels: &[Panel], footprint_m: f32, seed: u32) -> Colour {
    albedo_of(p, material, panels, footprint_m, seed)
}

#[inline(always)]
fn albedo_of(p: &Vector3<f64>, material: &Material, panels: &[Panel], footprint_m: f32, seed: u32) -> Colour {
    let x: Vector3<f32> = p.cast();
    let rough = |strength: f32, roughness: f32| 1.0 + strength * fractal(&x, footprint_m, roughness, seed);
    match material {
        Material::Concrete => concrete(&x, footprint_m, seed),
        Material::Sand => {
            // Grains, shell grit, and patches of finer and coarser sand.
            let patch = fractal(&(x * 0.35), footprint_m, 0.5, seed ^ 0x51);
            let shells = (gradient(&(x * 45.0), seed ^ 0x77) - 0.62).max(0.0) * fade(0.022, footprint_m) * 2.0;
            shade([0.42, 0.37, 0.28], [0.30, 0.27, 0.22], patch, rough(0.36, 0.93), shells)
        }
        Material::Stone => {
            shade([0.24, 0.22, 0.19], [0.13, 0.15, 0.10], fractal(&(x * 0.8), footprint_m, 0.6, seed ^ 0x3), rough(0.6, 0.9), 0.0)
        }
        Material::Steel => {
            let rust = fractal(&(x * 0.6), footprint_m, 0.62, seed ^ 0x9);
            shade([0.16, 0.19, 0.20], [0.23, 0.11, 0.05], 2.5 * rust, rough(0.5, 0.9), 0.0)
        }
        Material::Pipe => {
            let slime = fractal(&(x * 0.9), footprint_m, 0.65, seed ^ 0x21);
            shade([0.25, 0.24, 0.21], [0.09, 0.13, 0.07], 1.6 * slime, rough(0.45, 0.92), 0.0)
        }
        Material::Plain { albedo } => albedo.map(|a| a * rough(0.12, 0.7).clamp(0.5, 1.5)),
        Material::Fish => {
            let belly = (0.5 + 6.0 * x.z).clamp(0.0, 1.0);
            [0.55 - 0.42 * belly, 0.57 - 0.42 * belly, 0.55 - 0.40 * belly].map(|v| v * rough(0.2, 0.7).clamp(0.5, 1.5))
        }
        Material::Bar { axis, origin, band_m } => {
            let along = (p - Vector3::from(*origin)).dot(&Vector3::from(*axis)) / band_m;
            let dark = along.floor().rem_euclid(2.0) < 1.0;
            let grain = rough(0.15, 0.7).clamp(0.5, 1.5);
            if dark { [0.05 * grain; 3] } else { [0.80 * grain, 0.79 * grain, 0.76 * grain] }
        }
        Material::Panel(index) => {
            let panel = &panels[*index];
            let from = p - panel.origin;
            [panel.albedo(from.dot(&panel.u), from.dot(&panel.v), f64::from(footprint_m)) as f32; 3]
        }
    }
}

/// Weathered concrete under turf, crusts and sponges: the growth on it stands in patches of its own colours.
#[inline(always)]
fn concrete(x: &Vector3<f32>, footprint_m: f32, seed: u32) -> Colour {
    let grain = fractal(x, footprint_m, 0.92, seed);
    let turf = fractal(&(x * 0.7 + Vector3::new(11.0, 3.0, 7.0)), footprint_m, 0.6, seed ^ 0xA1);
    let crust = fractal(&(x * 1.3 + Vector3::new(5.0, 17.0, 2.0)), footprint_m, 0.55, seed ^ 0xB2);
    let mut colour = [0.27, 0.26, 0.22];
    blend(&mut colour, [0.10, 0.13, 0.06], 2.2 * turf + 0.45);
    blend(&mut colour, [0.32, 0.14, 0.14], 4.0 * (crust - 0.42));
    blend(&mut colour, [0.42, 0.30, 0.12], 4.0 * (-crust - 0.5));
    finish(colour.map(|c| c * (1.0 + 0.70 * grain).max(0.10)))
}

fn shade(one: Colour, other: Colour, weight: f32, light: f32, bright: f32) -> Colour {
    let mut colour = one;
    blend(&mut colour, other, 0.5 + weight);
    finish(colour.map(|c| c * light.max(0.12) + bright))
}

/// Moves a colour towards another by a weight that is cut to 0..1.
fn blend(colour: &mut Colour, other: Colour, weight: f32) {
    let weight = weight.clamp(0.0, 1.0);
    for c in 0..3 {
        colour[c] += weight * (other[c] - colour[c]);
    }
}

/// The share of a pattern of a wavelength that a pixel of a footprint still resolves.
fn fade(wavelength_m: f32, footprint_m: f32) -> f32 {
    ((wavelength_m / footprint_m - 1.5) * (1.0 / 1.5)).clamp(0.0, 1.0)
}

fn finish(colour: Colour) -> Colour {
    colour.map(|v| v.clamp(0.01, 0.92))
}
