//! What water does to a picture taken in air, in the three filters of Meline et al. (*Comparative study of
//! two 3D reconstruction methods for underwater archaeology*, IROS 2012): colour, blur, speckle. Their figures for 15 m are the defaults.

use crate::random::{Random, mix};
use scene::Raster;

/// Share of red, green and blue that 15 m of water leave: red is gone, green and blue are down by 15 and 13 %.
pub const COLOUR_LEFT: [f32; 3] = [0.0, 0.85, 0.87];
/// Variance of the blur, pixels squared, within 9 x 9 pixels.
pub const BLUR_VARIANCE: f32 = 8.0;
const BLUR_RADIUS: usize = 4;
/// Variance of the speckle: light is multiplied by 1 + n.
pub const SPECKLE_VARIANCE: f32 = 0.02;

/// Takes light away, channel by channel.
#[must_use]
pub fn colour(image: &Raster<[u8; 3]>, left: [f32; 3]) -> Raster<[u8; 3]> {
    image.map(|p| std::array::from_fn(|c| (f32::from(p[c]) * left[c]).round() as u8))
}

/// A Gaussian of a variance, cut to 9 x 9 pixels; the border is continued by its last pixel.
#[must_use]
pub fn blur(image: &Raster<[u8; 3]>, variance: f32) -> Raster<[u8; 3]> {
    let weights: Vec<f32> = (0..=2 * BLUR_RADIUS).map(|i| (-0.5 * (i as f32 - BLUR_RADIUS as f32).powi(2) / variance).exp()).collect();
    let sum: f32 = weights.iter().sum();
    let (width, height) = (image.width(), image.height());
    let near = |v: usize, i: usize, size: usize| (v + i).saturating_sub(BLUR_RADIUS).min(size - 1);
    let mut rows = Raster::filled(width, height, [0.0f32; 3]);
    for y in 0..height {
        for x in 0..width {
            for (i, weight) in weights.iter().enumerate() {
                let p = image.row(y)[near(x, i, width)];
                (0..3).for_each(|c| rows.row_mut(y)[x][c] += weight / sum * f32::from(p[c]));
            }
        }
    }
    let mut out = Raster::filled(width, height, [0u8; 3]);
    for y in 0..height {
        for x in 0..width {
            let mut total = [0.0f32; 3];
            for (i, weight) in weights.iter().enumerate() {
                let p = rows.row(near(y, i, height))[x];
                (0..3).for_each(|c| total[c] += weight / sum * p[c]);
            }
            out.row_mut(y)[x] = total.map(|v| v.round() as u8);
        }
    }
    out
}

/// Multiplies every pixel by 1 + n, n normal with mean 0 and a variance; one draw for all channels, so that grey images have it too.
#[must_use]
pub fn speckle(image: &Raster<[u8; 3]>, variance: f32, seed: u64) -> Raster<[u8; 3]> {
    let (mut random, deviation) = (Random::new(mix(seed ^ 0x59EC)), f64::from(variance.sqrt()));
    image.map(|p| {
        let factor = 1.0 + deviation * random.normal();
        p.map(|v| (f64::from(v) * factor).round().clamp(0.0, 255.0) as u8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_takes_its_shares() {
        let out = colour(&Raster::filled(2, 2, [200, 100, 100]), COLOUR_LEFT);
        assert_eq!(out.data()[3], [0, 85, 87]);
    }

    #[test]
    fn blur_keeps_the_light_and_spreads_it() {
        let mut image = Raster::filled(31, 31, [0u8; 3]);
        for y in 10..21 {
            image.row_mut(y)[10..21].fill([250, 120, 0]);
        }
        let out = blur(&image, BLUR_VARIANCE);
        let sum = |r: &Raster<[u8; 3]>| r.data().iter().map(|p| f64::from(p[0])).sum::<f64>();
        // Bytes round by half a grey value at the 361 pixels touched at most.
        assert!((sum(&out) - sum(&image)).abs() < 181.0, "{} {}", sum(&out), sum(&image));
        let second = |r: &Raster<[u8; 3]>| {
            r.data().iter().enumerate().map(|(i, p)| f64::from(p[0]) * ((i % 31) as f64 - 15.0).powi(2)).sum::<f64>() / sum(r)
        };
        // A Gaussian of variance 8 cut at 4 pixels and sampled has a variance of 4.775.
        assert!((second(&out) - second(&image) - 4.775).abs() < 0.05, "{}", second(&out) - second(&image));
    }

    #[test]
    fn speckle_has_its_variance_and_grows_with_the_light() {
        let deviation = |grey: u8| {
            let out = speckle(&Raster::filled(200, 200, [grey; 3]), SPECKLE_VARIANCE, 3);
            let squares = out.data().iter().flatten().map(|&v| (f64::from(v) - f64::from(grey)).powi(2));
            (squares.sum::<f64>() / 120_000.0).sqrt()
        };
        // Root of 0.02 times the grey value; 40,000 draws: a standard error of 0.35 %.
        assert!((deviation(100) / (0.02f64.sqrt() * 100.0) - 1.0).abs() < 0.01);
        assert!((deviation(50) / deviation(100) - 0.5).abs() < 0.01);
        let image = Raster::filled(8, 8, [90; 3]);
        assert_eq!(speckle(&image, 0.02, 1), speckle(&image, 0.02, 1));
        assert_ne!(speckle(&image, 0.02, 1), speckle(&image, 0.02, 2));
    }
}
