//! Specks in the water near the camera.

use super::scene::DiveScene;
use super::shade::Light;
use crate::random::{Random, mix};
use nalgebra::Vector3;
use scene::Raster;

/// Specks further away are too faint to be seen as such, metres.
const REACH_M: f64 = 2.5;
/// Nearest speck, metres.
const NEAREST_M: f64 = 0.08;
/// Diameter of the aperture, metres: f/4 at 4.8 mm; a speck out of focus is as wide as this, seen at its distance.
const APERTURE_M: f64 = 0.0012;
/// The camera is focused at this distance, metres.
const FOCUS_M: f64 = 3.0;

/// Adds the specks that one camera sees at one exposure. All cameras see the same specks.
pub(super) fn add_snow(dive: &DiveScene, light: &Light<'_>, camera: usize, exposure: usize, depth: &Raster<f32>, frame: &mut [[f32; 3]]) {
    let Some(water) = dive.water.as_ref().filter(|_| dive.options.water.snow_per_m3 > 0.0) else { return };
    let (pose, index) = (dive.cam_from_world(camera, exposure), dive.refractive_index(exposure));
    let rig = dive.rig_from_world(exposure).centre();
    let mut random = Random::new(mix(dive.options.seed ^ mix(0x5_0E0 + exposure as u64)));
    let count = (dive.options.water.snow_per_m3 * (2.0 * REACH_M).powi(3)).round() as usize;
    for _ in 0..count {
        let offset = Vector3::from_fn(|_, _| random.range(-REACH_M, REACH_M));
        // Most specks are small: sizes by a power law, 0.1 to 1.5 mm.
        let size_m = 1e-4 * (1.0 - 0.9956 * random.unit()).powf(-0.5);
        let point = rig + offset;
        let x_in_cam = pose.apply(&point);
        let distance = x_in_cam.norm();
        if distance > REACH_M || x_in_cam.z < NEAREST_M {
            continue;
        }
        let Some(pixel) = dive.cameras[camera].project(&x_in_cam, index) else { continue };
        let Some(&behind) = depth.at_point(pixel.x, pixel.y) else { continue };
        if behind > 0.0 && f64::from(behind) < x_in_cam.z {
            continue;
        }
        let px_per_rad = dive.cameras[camera].calibrated.camera.params()[0];
        let defocus = APERTURE_M * (1.0 / distance - 1.0 / FOCUS_M).abs();
        let sigma = 0.35 * ((size_m / distance).powi(2) + defocus * defocus).sqrt() * px_per_rad;
        let sigma = sigma.hypot(0.5);
        // Radiance of a white speck times its area in pixels, spread over the disc.
        let area_px = std::f64::consts::FRAC_PI_4 * (size_m / distance * px_per_rad).powi(2);
        let strength = (0.6 / std::f64::consts::PI * area_px / (std::f64::consts::TAU * sigma * sigma)) as f32;
        let left = water.left_after(distance as f32);
        let falls = light.on_speck(&point.cast());
        splat(depth.width(), frame, [pixel.x, pixel.y], sigma, std::array::from_fn(|c| strength * falls[c] * left[c]));
    }
}

fn splat(width: usize, frame: &mut [[f32; 3]], at: [f64; 2], sigma: f64, peak: [f32; 3]) {
    let reach = 3.0 * sigma;
    let span = |v: f64, size: usize| ((v - reach).floor().max(0.0) as usize, ((v + reach).ceil() as usize).min(size));
    let ((left, right), (top, bottom)) = (span(at[0], width), span(at[1], frame.len() / width));
    for y in top..bottom {
        for x in left..right {
            let (dx, dy) = (x as f64 + 0.5 - at[0], y as f64 + 0.5 - at[1]);
            let weight = (-0.5 * (dx * dx + dy * dy) / (sigma * sigma)).exp() as f32;
            for c in 0..3 {
                frame[y * width + x][c] += weight * peak[c];
            }
        }
    }
}
