//! Light that a surface sends towards the camera, and what the water makes of it.

use super::scene::DiveScene;
use crate::appearance::{Lamps, Water};
use nalgebra::Vector3;

/// Towards the sun: its light keeps a direction even at depth, as a share of all daylight.
const SUN: [f32; 3] = [0.32, -0.42, 0.85];
const SUN_SHARE: f32 = 0.35;
/// Share of the light that the surroundings send back into the shade, where nothing of the sky is seen.
const BOUNCE: f32 = 0.10;
/// Share of scattered light that goes forwards by small angles and is not lost to the picture, but spread (Jaffe, *Computer modeling
/// and the design of optimal underwater imaging systems*, IEEE J. Oceanic Engineering 15, 1990).
const FORWARD: f32 = 0.6;
/// Radiance that the water scatters back from a lamp, as a share of its light and its scattering: 1.8 % of scattering goes backwards
/// (Petzold 1972) into 2 pi.
const BACKSCATTER: f32 = 0.018 / std::f32::consts::TAU;

/// Distances up to which the light of the lamps in the water is summed, metres.
pub(super) const STEPS_M: [f32; 10] = [0.0, 0.3, 0.6, 1.0, 1.5, 2.2, 3.2, 4.5, 7.0, 12.0];

/// The light of one exposure.
pub(super) struct Light<'a> {
    dive: &'a DiveScene,
    lamps: Option<Lamps>,
    time_s: f64,
    caustics: f32,
}

/// What reaches the camera from one point: straight, and spread by the water.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Arriving {
    pub straight: [f32; 3],
    pub spread: [f32; 3],
}

/// A point on a surface.
pub(super) struct Surface {
    pub point: Vector3<f32>,
    pub normal: Vector3<f32>,
    pub albedo: [f32; 3],
    /// Open share of the sky.
    pub open: f32,
}

impl Arriving {
    pub fn add(&mut self, other: &Self, weight: f32) {
        for c in 0..3 {
            self.straight[c] += weight * other.straight[c];
            self.spread[c] += weight * other.spread[c];
        }
    }
}

impl<'a> Light<'a> {
    pub fn new(dive: &'a DiveScene, exposure: usize) -> Self {
        let time_s = dive.motion.frame_time_s(exposure);
        // Ripples focus the light at a few metres; below, the foci of many ripples overlap.
        let caustics = dive.options.water.caustics * (-((dive.options.water.depth_m as f32 - 5.0) / 8.0).max(0.0)).exp();
        Self { dive, lamps: dive.lamps(exposure), time_s, caustics }
    }

    fn water(&self) -> Option<&Water> {
        self.dive.water.as_ref()
    }

    fn daylight(&self, height_m: f32) -> [f32; 3] {
        match self.water() {
            Some(water) => water.daylight_at(height_m),
            None => [f32::from(u8::from(self.dive.options.water.daylight)); 3],
        }
    }

    /// Radiance of a surface: Lambert's law.
    pub fn reflected(&self, surface: &Surface) -> [f32; 3] {
        let facing_up = 0.5 + 0.5 * surface.normal.z;
        let sun = surface.normal.dot(&Vector3::from(SUN)).max(0.0) * self.focus(&surface.point);
        let from_above = surface.open * ((1.0 - SUN_SHARE) * facing_up + SUN_SHARE * sun) + BOUNCE * (1.0 - 0.5 * facing_up);
        let day = self.daylight(surface.point.z);
        let lamps = self.lamps.as_ref().map_or([0.0; 3], |lamps| lamps.on_surface(&surface.point, &surface.normal, self.water()));
        std::array::from_fn(|c| surface.albedo[c] * std::f32::consts::FRAC_1_PI * (day[c] * from_above + lamps[c]))
    }

    /// How rippled water focuses the sun at a place: 1 on average.
    fn focus(&self, point: &Vector3<f32>) -> f32 {
        if self.caustics < 1e-3 {
            return 1.0;
        }
        // Where the ray of the sun through the point meets the level z = 0.
        let foot = [point.x - point.z * SUN[0] / SUN[2], point.y - point.z * SUN[1] / SUN[2]];
        let t = self.time_s as f32;
        // Three trains of waves, bent by each other: bright lines where their slopes cancel.
        let mut phase =
            [6.1 * foot[0] + 2.3 * foot[1] + 1.9 * t, -3.7 * foot[0] + 5.2 * foot[1] - 1.6 * t, 4.4 * foot[0] - 4.9 * foot[1] + 2.2 * t];
        let bend = [1.3 * (0.7 * phase[1]).sin(), 1.1 * (0.8 * phase[2]).sin(), 1.2 * (0.9 * phase[0]).sin()];
        phase.iter_mut().zip(bend).for_each(|(p, b)| *p += b);
        let sum = phase[0].sin() + phase[1].sin() + phase[2].sin();
        let line = bright_line(sum);
        1.0 + self.caustics * (line - MEAN_LINE) / MEAN_LINE
    }

    /// Light of a surface seen through water, without what the water adds.
    pub fn through(&self, radiance: [f32; 3], distance: f32) -> Arriving {
        let Some(water) = self.water() else { return Arriving { straight: radiance, spread: [0.0; 3] } };
        let straight = water.left_after(distance);
        Arriving {
            straight: std::array::from_fn(|c| radiance[c] * straight[c]),
            spread: std::array::from_fn(|c| {
                radiance[c] * straight[c] * ((FORWARD * water.scattering_per_m[c] * distance).min(20.0).exp() - 1.0)
            }),
        }
    }

    /// Light that the water adds over a distance along a direction whose vertical component is `up`, from the camera at a height.
    pub fn veil(&self, height_m: f32, up: f32, distance: Option<f32>) -> [f32; 3] {
        let Some(water) = self.water() else { return [0.0; 3] };
        let endless = water.veil(&self.daylight(height_m), up);
        let Some(distance) = distance else { return endless };
        // The light that is spread forwards replaces a part of the loss: so much less is veiled.
        std::array::from_fn(|c| endless[c] * (1.0 - (-(water.beam_per_m[c] - FORWARD * water.scattering_per_m[c]) * distance).exp()))
    }

    /// Light of the lamps that the water scatters back along a ray, summed up to each of [`STEPS_M`].
    pub fn haze(&self, origin: &Vector3<f32>, direction: &Vector3<f32>) -> [[f32; 3]; STEPS_M.len()] {
        let mut sums = [[0.0; 3]; STEPS_M.len()];
        let (Some(water), Some(lamps)) = (self.water(), &self.lamps) else { return sums };
        for i in 1..STEPS_M.len() {
            let (middle, length) = ((STEPS_M[i - 1] + STEPS_M[i]) / 2.0, STEPS_M[i] - STEPS_M[i - 1]);
            let (light, left) = (lamps.in_water(&(origin + direction * middle), water), water.left_after(middle));
            sums[i] = std::array::from_fn(|c| sums[i - 1][c] + BACKSCATTER * water.scattering_per_m[c] * light[c] * left[c] * length);
        }
        sums
    }

    /// Colour of the light that a grey card near the camera sends back, with a green of 1.
    pub fn colour(&self, height_m: f32) -> [f32; 3] {
        let (Some(water), day) = (self.water(), self.daylight(height_m)) else { return [1.0; 3] };
        let lamp = if self.lamps.is_some() { self.dive.options.lamps.power / 4.0 } else { 0.0 };
        let light: [f32; 3] = std::array::from_fn(|c| (day[c] + lamp) * (-2.0 * water.diffuse_per_m[c]).exp());
        light.map(|v| v / light[1].max(1e-12))
    }

    /// Light that falls on a speck in the water.
    pub fn on_speck(&self, point: &Vector3<f32>) -> [f32; 3] {
        let day = self.daylight(point.z);
        let lamps = match (&self.lamps, self.water()) {
            (Some(lamps), Some(water)) => lamps.in_water(point, water),
            _ => [0.0; 3],
        };
        std::array::from_fn(|c| 0.5 * day[c] + lamps[c])
    }
}

/// Brightness about the place where three sines cancel.
fn bright_line(sum: f32) -> f32 {
    1.0 / (1.0 + 6.0 * sum * sum)
}

/// Mean of 1 / (1 + 6 s2) over the sum s of three sines of independent phases.
const MEAN_LINE: f32 = 0.3055;

/// The haze up to a distance, from its sums.
pub(super) fn haze_up_to(sums: &[[f32; 3]; STEPS_M.len()], distance: f32) -> [f32; 3] {
    let last = STEPS_M.len() - 1;
    let next = STEPS_M.iter().position(|s| *s > distance).unwrap_or(last).max(1);
    let share = ((distance - STEPS_M[next - 1]) / (STEPS_M[next] - STEPS_M[next - 1])).min(1.0);
    std::array::from_fn(|c| sums[next - 1][c] + share * (sums[next][c] - sums[next - 1][c]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Caustics move light about and add none.
    #[test]
    fn the_mean_of_the_lines_is_what_it_is_taken_for() {
        let mut random = Random::new(2);
        let n = 200_000;
        let mut draw = || (0..3).map(|_| random.range(0.0, std::f64::consts::TAU).sin()).sum::<f64>() as f32;
        let mean = (0..n).map(|_| f64::from(bright_line(draw()))).sum::<f64>() / f64::from(n);
        // The lines vary by 0.32: four standard errors of 200,000 draws.
        assert!((mean / f64::from(MEAN_LINE) - 1.0).abs() < 0.01, "{mean}");
    }

    #[test]
    fn haze_is_interpolated_between_its_steps_and_ends_with_the_last() {
        let sums: [[f32; 3]; STEPS_M.len()] = std::array::from_fn(|i| [STEPS_M[i]; 3]);
        for (distance, expected) in [(0.0, 0.0), (0.45, 0.45), (5.0, 5.0), (12.0, 12.0), (40.0, 12.0), (f32::INFINITY, 12.0)] {
            assert!((haze_up_to(&sums, distance)[1] - expected).abs() < 1e-5, "{distance}");
        }
    }
}
