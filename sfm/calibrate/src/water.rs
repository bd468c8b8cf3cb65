//! The refractive index of sea water.

/// A formula for the refractive index of sea water.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum IndexFormula {
    /// Quan & Fry, *Empirical equation for the index of refraction of seawater*, Applied Optics 34, 1995, with the growth under pressure of
    /// Millard & Seaver, Deep-Sea Research 37, 1990 (terms in P, P2, P / lambda2, P T and P T2, at 1 dbar a metre). Good to about 2e-5.
    #[default]
    QuanFry,
    /// Hoehle 1971, as Rofallski et al. (ISPRS Archives 2020) use it: n = 1.338 + 4e-5 (486 + 0.003 d + 50 s - lambda - t), with s in per cent.
    Hoehle,
}

impl IndexFormula {
    /// The name used on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::QuanFry => "quan-fry",
            Self::Hoehle => "hoehle",
        }
    }
}

/// Water between the port and the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Water {
    /// Depth, metres.
    pub depth_m: f64,
    /// Practical salinity, parts per thousand: 0 for fresh water, 35 for the sea.
    pub salinity_ppt: f64,
    /// Temperature, degrees Celsius.
    pub temperature_degc: f64,
    /// Wavelength of the light, nanometres; 540 is the green that cameras see best.
    pub wavelength_nm: f64,
}

impl Water {
    /// What is outside of the range in which the formulas were fitted, in words; empty where nothing is.
    #[must_use]
    pub fn out_of_range(&self) -> Vec<String> {
        let limits = [
            ("depth", "m", self.depth_m, 0.0, 11_000.0),
            ("salinity", "parts per thousand", self.salinity_ppt, 0.0, 43.0),
            ("temperature", "degrees Celsius", self.temperature_degc, 0.0, 30.0),
            ("wavelength", "nm", self.wavelength_nm, 400.0, 700.0),
        ];
        let outside = limits.into_iter().filter(|(_, _, value, low, high)| !(low..=high).contains(&value));
        outside.map(|(what, unit, value, low, high)| format!("{what} {value} {unit} is not from {low} to {high}")).collect()
    }

    /// The refractive index against vacuum.
    #[must_use]
    pub fn refractive_index(&self, formula: IndexFormula) -> f64 {
        let (d, s, t, l) = (self.depth_m, self.salinity_ppt, self.temperature_degc, self.wavelength_nm);
        match formula {
            IndexFormula::Hoehle => 1.338 + 4e-5 * (486.0 + 0.003 * d + 50.0 * (s / 10.0) - l - t),
            IndexFormula::QuanFry => {
                let salt = (1.779e-4 - 1.05e-6 * t + 1.6e-8 * t * t) * s;
                let light = (15.868 + 0.011_55 * s - 0.004_23 * t) / l - 4382.0 / (l * l) + 1.1455e6 / (l * l * l);
                1.314_05 + salt - 2.02e-6 * t * t + light + d * growth_per_dbar(d, t, l)
            }
        }
    }
}

/// Growth of the index with pressure, a decibar, between the surface and `p` decibar.
fn growth_per_dbar(p: f64, t: f64, wavelength_nm: f64) -> f64 {
    let micrometres = wavelength_nm / 1000.0;
    1.586_838_3e-6 - 1.574_074e-11 * p + 1.071_206_3e-8 / (micrometres * micrometres) - 9.483_448_6e-9 * t + 1.010_032_6e-10 * t * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_renderer_uses_the_same_water(d in 0.0..500.0f64, s in 0.0..40.0f64, t in 0.0..30.0f64, l in 400.0..700.0f64) {
            let water = Water { depth_m: d, salinity_ppt: s, temperature_degc: t, wavelength_nm: l };
            let other = synthetic::optics::refractive_index(l, t, s, d);
            prop_assert!((water.refractive_index(IndexFormula::QuanFry) - other).abs() < 1e-14);
            prop_assert!(water.out_of_range().is_empty());
        }
    }

    #[test]
    fn published_values() {
        let at = |s, t| {
            Water { depth_m: 0.0, salinity_ppt: s, temperature_degc: t, wavelength_nm: 589.3 }.refractive_index(IndexFormula::QuanFry)
        };
        // Fresh water (Tilton & Taylor 1938) and sea water (Austin & Halikas 1976) at 20 degrees and the sodium line.
        assert!((at(0.0, 20.0) - 1.332_99).abs() < 3e-5);
        assert!((at(35.0, 20.0) - 1.339_40).abs() < 5e-5);
        // 1.338 + 4e-5 (486 + 0.075 + 175 - 540 - 19) by hand.
        let reef = Water { depth_m: 25.0, salinity_ppt: 35.0, temperature_degc: 19.0, wavelength_nm: 540.0 };
        assert!((reef.refractive_index(IndexFormula::Hoehle) - 1.342_083).abs() < 1e-12);
    }

    #[test]
    fn what_no_formula_was_fitted_to_is_told() {
        let wrong = Water { depth_m: -1.0, salinity_ppt: 3.5, temperature_degc: f64::NAN, wavelength_nm: 540.0 };
        let told = wrong.out_of_range();
        assert!(told.len() == 2 && told[0].starts_with("depth -1 m") && told[1].starts_with("temperature NaN"), "{told:?}");
    }
}
