//! The refractive index of sea water.

/// Refractive index of sea water from wavelength (nm, 400 to 700), temperature (degrees Celsius, 0 to 30), salinity (parts per
/// thousand, 0 to 40) and depth (metres, taken as decibar).
///
/// Quan & Fry, *Empirical equation for the index of refraction of seawater*, Applied Optics 34, 1995, at the surface; the growth with
/// pressure from Millard & Seaver, *An index of refraction algorithm for seawater over temperature, pressure, salinity, density, and
/// wavelength*, Deep-Sea Research 37, 1990 (terms in P, P2, P / lambda2, P T and P T2).
#[must_use]
pub fn refractive_index(wavelength_nm: f64, temperature_degc: f64, salinity_ppt: f64, depth_m: f64) -> f64 {
    let (l, t, s, p) = (wavelength_nm, temperature_degc, salinity_ppt, depth_m);
    let surface = 1.314_05 + (1.779e-4 - 1.05e-6 * t + 1.6e-8 * t * t) * s - 2.02e-6 * t * t + (15.868 + 0.011_55 * s - 0.004_23 * t) / l
        - 4382.0 / (l * l)
        + 1.1455e6 / (l * l * l);
    let micrometres = l / 1000.0;
    surface
        + p * (1.586_838_3e-6 - 1.574_074e-11 * p + 1.071_206_3e-8 / (micrometres * micrometres) - 9.483_448_6e-9 * t
            + 1.010_032_6e-10 * t * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // Fresh water at 20 degrees and the sodium line: 1.33299 (Tilton & Taylor 1938). The formula is good to 1.5e-5 there, its authors say.
        assert!((refractive_index(589.3, 20.0, 0.0, 0.0) - 1.332_99).abs() < 3e-5);
        // Sea water of 35 ppt at 20 degrees, the same line: 1.33940 (Austin & Halikas 1976).
        assert!((refractive_index(589.3, 20.0, 35.0, 0.0) - 1.339_40).abs() < 5e-5);
        // Water at 1,000 bar refracts by 0.013 to 0.014 more than at the surface (Thormaehlen et al. 1985 for pure water), nearly in proportion to
        // the pressure.
        let deep = refractive_index(540.0, 10.0, 35.0, 10_000.0) - refractive_index(540.0, 10.0, 35.0, 0.0);
        assert!((0.0125..0.0145).contains(&deep), "{deep}");
        let growth = refractive_index(540.0, 20.0, 35.0, 100.0) - refractive_index(540.0, 20.0, 35.0, 0.0);
        assert!((1.1e-4..1.6e-4).contains(&growth), "{growth}");
    }
}
