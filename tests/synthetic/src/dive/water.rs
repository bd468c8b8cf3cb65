//! Light through water: what reaches the camera weakens, and the water's own light comes in its place.

/// Share of the light of red, green and blue that a metre takes (clear coastal water; Jerlov, *Marine Optics*, 1976,
/// type I to 1 read at 620, 540 and 460 nm).
const ATTENUATION_PER_M: [f64; 3] = [0.32, 0.09, 0.06];
/// Linear RGB of endless water.
const VEIL: [f64; 3] = [0.03, 0.16, 0.24];

/// Linear RGB after `distance_m` of water (Beer-Lambert with veiling light); endless water for `None`.
pub(super) fn through(colour: Option<([f64; 3], f64)>) -> [f64; 3] {
    let Some((colour, distance_m)) = colour else { return VEIL };
    std::array::from_fn(|c| {
        let left = (-ATTENUATION_PER_M[c] * distance_m).exp();
        colour[c] * left + VEIL[c] * (1.0 - left)
    })
}

/// Linear light as an sRGB byte (IEC 61966-2-1).
pub(super) fn srgb(linear: f64) -> f64 {
    let v = linear.clamp(0.0, 1.0);
    255.0 * if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}
