//! Light on its way through water.

use super::Jerlov;
use serde::{Deserialize, Serialize};

/// The water of a dive. Metres, degrees Celsius, parts per thousand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WaterOptions {
    /// Optical type.
    pub jerlov: Jerlov,
    /// Scattering at 525 nm, per metre; that of the type where it is not given.
    pub scattering_per_m: Option<f32>,
    /// Depth of the bottom below the surface.
    pub depth_m: f64,
    /// Temperature.
    pub temperature_degc: f64,
    /// Salinity.
    pub salinity_ppt: f64,
    /// Angle over which light that is scattered forwards spreads, a standard deviation in radians: a halo about what is bright.
    pub forward_blur_rad: f32,
    /// Particles in a cubic metre that shine as specks.
    pub snow_per_m3: f64,
    /// Largest share by which ripples of the surface focus the light on what lies 5 m below it; it falls with depth.
    pub caustics: f32,
    /// Lets daylight in; without it only the lamps shine.
    pub daylight: bool,
}

impl Default for WaterOptions {
    fn default() -> Self {
        Self {
            jerlov: Jerlov::IB,
            scattering_per_m: None,
            depth_m: 15.0,
            temperature_degc: 19.0,
            salinity_ppt: 35.0,
            forward_blur_rad: 0.008,
            snow_per_m3: 30.0,
            caustics: 0.3,
            daylight: true,
        }
    }
}

/// What a metre of water does to light of each channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Water {
    /// Beam attenuation a + b, per metre.
    pub beam_per_m: [f32; 3],
    /// Scattering b, per metre.
    pub scattering_per_m: [f32; 3],
    /// Downward light at the bottom, as a share of that below the surface.
    pub daylight: [f32; 3],
    /// Attenuation of downward light with depth, per metre.
    pub diffuse_per_m: [f32; 3],
}

/// Wavelengths of the channels, nm.
const WAVELENGTHS_NM: [f32; 3] = [600.0, 525.0, 450.0];
/// Radiance of the water seen horizontally, as a share of the downward irradiance where every loss is by scattering: of the size of
/// 1 / 4 pi, the source function of isotropic scattering.
const VEIL: f32 = 0.09;

impl Water {
    /// The water of a dive; `None` for air.
    ///
    /// Absorption a follows from Kirk's relation between the diffuse attenuation K, a and b, K = sqrt(a2 + 0.256 a b) / 0.86
    /// (Kirk, *Limnology and Oceanography* 29, 1984), scattering falls with the wavelength as 1 / lambda.
    #[must_use]
    pub fn new(options: &WaterOptions) -> Option<Self> {
        let jerlov = options.jerlov;
        if jerlov == Jerlov::Air {
            return None;
        }
        let diffuse_per_m = jerlov.diffuse_per_m();
        let at_525 = options.scattering_per_m.unwrap_or(jerlov.scattering_per_m());
        let scattering_per_m = WAVELENGTHS_NM.map(|nm| at_525 * 525.0 / nm);
        let beam_per_m = std::array::from_fn(|c| {
            let (k, half) = (0.86 * diffuse_per_m[c], 0.128 * scattering_per_m[c]);
            (half * half + k * k).sqrt() - half + scattering_per_m[c]
        });
        let daylight = if options.daylight { diffuse_per_m.map(|k| (-k * options.depth_m as f32).exp()) } else { [0.0; 3] };
        Some(Self { beam_per_m, scattering_per_m, daylight, diffuse_per_m })
    }

    /// Daylight at a height above the bottom.
    #[must_use]
    pub fn daylight_at(&self, height_m: f32) -> [f32; 3] {
        std::array::from_fn(|c| self.daylight[c] * (self.diffuse_per_m[c] * height_m).exp())
    }

    /// Radiance of endless water seen along a direction whose vertical component is `up`: brighter towards the surface.
    #[must_use]
    pub fn veil(&self, daylight: &[f32; 3], up: f32) -> [f32; 3] {
        let tilt = (1.3 * up).exp();
        std::array::from_fn(|c| VEIL * self.scattering_per_m[c] / self.beam_per_m[c] * daylight[c] * tilt)
    }

    /// The share of light that a way through the water leaves: Beer-Lambert.
    #[must_use]
    pub fn left_after(&self, distance_m: f32) -> [f32; 3] {
        self.beam_per_m.map(|c| (-c * distance_m).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn water(jerlov: Jerlov) -> Water {
        Water::new(&WaterOptions { jerlov, ..WaterOptions::default() }).expect("not air")
    }

    #[test]
    fn kirks_relation_holds_and_beam_exceeds_diffuse_attenuation() {
        for jerlov in [Jerlov::I, Jerlov::II, Jerlov::C1, Jerlov::C5, Jerlov::C9] {
            let w = water(jerlov);
            for c in 0..3 {
                let (a, b) = (w.beam_per_m[c] - w.scattering_per_m[c], w.scattering_per_m[c]);
                let k = (a * a + 0.256 * a * b).sqrt() / 0.86;
                assert!((k / w.diffuse_per_m[c] - 1.0).abs() < 1e-3, "{jerlov:?} {c} {k}");
                assert!(a > 0.0 && w.beam_per_m[c] > 0.86 * w.diffuse_per_m[c]);
            }
        }
    }

    #[test]
    fn red_is_lost_and_clear_water_is_blue_and_coastal_water_green() {
        let clear = water(Jerlov::IB);
        assert!(clear.daylight[0] < 0.03 && clear.daylight[1] > 0.4 && clear.daylight[2] > 0.5, "{:?}", clear.daylight);
        let [r, g, b] = clear.veil(&clear.daylight, 0.0);
        assert!(r < 0.1 * g && g < b);
        let coastal = water(Jerlov::C3);
        let [r, g, b] = coastal.veil(&coastal.daylight, 0.0);
        assert!(r < g && b < g);
    }

    #[test]
    fn air_is_no_water() {
        assert_eq!(Water::new(&WaterOptions { jerlov: Jerlov::Air, ..WaterOptions::default() }), None);
    }
}
