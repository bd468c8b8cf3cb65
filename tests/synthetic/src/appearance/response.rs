//! What the camera makes of light: exposure, noise of the sensor, gamma.

use crate::dive::ResponseOptions;
use crate::random::{Random, mix};
use std::sync::LazyLock;

/// Steps of the tables.
const STEPS: usize = 4096;

/// sRGB values (IEC 61966-2-1) of linear light from 0 to 1, as shares of 255.
static GAMMA: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let encode = |v: f64| 255.0 * if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    // Denser in the dark, where the curve is steep: by the square root.
    (0..=STEPS).map(|i| encode((i as f64 / STEPS as f64).powi(2)) as f32).collect()
});

/// Standard normal deviates: quantiles of the middle of each of 4,096 classes of equal probability, scaled to variance 1.
static NORMAL: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let quantiles: Vec<f64> = (0..STEPS).map(|i| quantile((i as f64 + 0.5) / STEPS as f64)).collect();
    let deviation = (quantiles.iter().map(|q| q * q).sum::<f64>() / STEPS as f64).sqrt();
    quantiles.into_iter().map(|q| (q / deviation) as f32).collect()
});

/// Quantile of the normal distribution by bisection of its distribution function, an integral by Simpson's rule.
fn quantile(share: f64) -> f64 {
    let density = |x: f64| (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
    let below = |x: f64| {
        let h = x / 64.0;
        let inner: f64 = (1..64).map(|i| if i % 2 == 1 { 4.0 } else { 2.0 } * density(h * f64::from(i))).sum();
        0.5 + h / 3.0 * (density(0.0) + inner + density(x))
    };
    let (mut low, mut high) = (-5.0, 5.0);
    for _ in 0..50 {
        let middle = f64::midpoint(low, high);
        if below(middle) < share { low = middle } else { high = middle }
    }
    low
}

/// A normal deviate from random bits; the lowest 12 are used.
fn gauss(bits: u64) -> f32 {
    NORMAL[(bits & (STEPS as u64 - 1)) as usize]
}

/// Red is not lifted by more than this: nothing but noise would be seen.
const MOST_BALANCE: f32 = 4.0;
/// Mean of a well exposed frame, linear: the grey value 118 of 255.
const MEAN_GREY: f32 = 0.18;

/// From linear light to bytes.
#[derive(Clone, Debug)]
pub(crate) struct Response {
    /// Full scale of each channel is reached at 1 / gain: exposure and white balance.
    pub gain: [f32; 3],
    /// Share of the light of the other channels that each channel sees.
    pub crosstalk: f32,
    /// Standard deviation of the noise, grey values of 255.
    pub noise: f32,
}

impl Response {
    /// Exposure and white balance for a frame of linear light, where a grey card has the colour `grey`.
    pub fn new(options: &ResponseOptions, frame: &[[f32; 3]], grey: [f32; 3]) -> Self {
        let mixed = mix_channels(grey, options.crosstalk);
        let balance = mixed.map(|v| (mixed[1] / v.max(1e-12)).powf(options.white_balance).min(MOST_BALANCE));
        let exposure = options.gain.unwrap_or_else(|| {
            let sum: f64 =
                frame.iter().map(|light| f64::from((light[0] * balance[0] + light[1] * balance[1] + light[2] * balance[2]) / 3.0)).sum();
            let mean = (sum / frame.len().max(1) as f64) as f32;
            if mean > 1e-9 { MEAN_GREY / mean } else { 1.0 }
        });
        Self { gain: balance.map(|b| b * exposure), crosstalk: options.crosstalk, noise: options.noise }
    }

    /// Grey values of 255, neither rounded nor with noise.
    pub fn grey(&self, light: [f32; 3]) -> [f32; 3] {
        let mixed = mix_channels(light, self.crosstalk);
        std::array::from_fn(|c| {
            let value = (mixed[c] * self.gain[c]).clamp(0.0, 1.0);
            GAMMA[(value.sqrt() * STEPS as f32 + 0.5) as usize]
        })
    }

    /// A row of bytes from a row of light. `key` seeds the noise of the row.
    pub fn row(&self, light: &[[f32; 3]], key: u64, out: &mut [[u8; 3]]) {
        let mut random = Random::new(mix(key));
        for (light, out) in light.iter().zip(out) {
            let bits = if self.noise > 0.0 { random.bits() } else { 0 };
            let greys = self.grey(*light);
            for c in 0..3 {
                // Shot noise grows with the root of the light and gamma takes as much away: even over the grey values, but for the
                // darkest, where the electronics' own noise is left.
                let noise = self.noise * gauss(bits >> (12 * c));
                out[c] = (greys[c] + noise + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
    }
}

/// Every channel of a camera sees a share of what the others see.
fn mix_channels(light: [f32; 3], crosstalk: f32) -> [f32; 3] {
    let mean = (light[0] + light[1] + light[2]) * (1.0 / 3.0);
    light.map(|v| v + crosstalk * (mean - v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_values_follow_the_standard() {
        let response = Response { gain: [1.0; 3], crosstalk: 0.0, noise: 0.0 };
        let mut out = [[0; 3]; 4];
        response.row(&[[0.0; 3], [0.18; 3], [0.5, 0.002, 1.0], [2.0, -1.0, 0.214]], 1, &mut out);
        // IEC 61966-2-1: 0.18 is 117.6, 0.5 is 187.5, 0.002 is 6.6, 0.214 is 127.5; the table rounds by 0.2 at most.
        assert_eq!(out[0], [0; 3]);
        assert!(out[1] == [118; 3] || out[1] == [117; 3], "{:?}", out[1]);
        assert!((187..=188).contains(&out[2][0]) && (6..=7).contains(&out[2][1]) && out[2][2] == 255, "{:?}", out[2]);
        assert!(out[3][0] == 255 && out[3][1] == 0 && (127..=128).contains(&out[3][2]), "{:?}", out[3]);
    }

    #[test]
    fn noise_has_the_deviation_asked_for() {
        let response = Response { gain: [1.0; 3], crosstalk: 0.0, noise: 4.0 };
        let mut out = vec![[0; 3]; 40_000];
        response.row(&vec![[0.18; 3]; 40_000], 9, &mut out);
        for c in 0..3 {
            let mean = out.iter().map(|v| f64::from(v[c])).sum::<f64>() / 40_000.0;
            let deviation = (out.iter().map(|v| (f64::from(v[c]) - mean).powi(2)).sum::<f64>() / 39_999.0).sqrt();
            // Standard error of a deviation from 40,000 values: 0.35 %; rounding to bytes adds 1/12 to 16.
            assert!((mean - 117.6).abs() < 0.4 && (deviation / (16.0f64 + 1.0 / 12.0).sqrt() - 1.0).abs() < 0.015, "{mean} {deviation}");
        }
    }
}
