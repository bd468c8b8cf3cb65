//! Correction of colour and contrast before an image is masked.

use imaging::{gaussian_blur, resize_area_grey};
use scene::Raster;

/// What is done with an image before it is masked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preprocessing {
    /// Nothing.
    #[default]
    None,
    /// Histogram equalisation of each channel.
    Equalise,
    /// Equalisation by tiles with limited contrast (Zuiderveld, *Contrast limited adaptive histogram equalization*, Graphics Gems IV, 1994), 8 x 8 tiles, limit 2.
    Clahe,
    /// Colours moved to grey on the mean and lightness stretched in the space l alpha beta (Bianco et al., *A new color correction method for underwater imaging*, ISPRS
    /// Archives, 2015).
    Lab,
    /// Ratio of each channel to its surroundings at three scales (Jobson et al., *A multiscale retinex for bridging the gap between color images and the human
    /// observation of scenes*, IEEE TIP, 1997).
    Retinex,
}

/// The image corrected; its size stays.
#[must_use]
pub fn preprocess(rgb: Raster<[u8; 3]>, kind: Preprocessing) -> Raster<[u8; 3]> {
    if rgb.data().is_empty() {
        return rgb;
    }
    match kind {
        Preprocessing::None => rgb,
        Preprocessing::Equalise => equalise(rgb),
        Preprocessing::Clahe => clahe(rgb),
        Preprocessing::Lab => lab(&rgb),
        Preprocessing::Retinex => retinex(&rgb),
    }
}

/// Maps grey values so that each holds its share of the pixels of a histogram.
fn equalising(histogram: &[f32; 256]) -> [u8; 256] {
    let total: f32 = histogram.iter().sum();
    let mut below = 0.0;
    histogram.map(|count| {
        below += count;
        // The middle of its own pixels: a flat image stays in the middle.
        (255.0 * (below - 0.5 * count) / total.max(1.0)).round() as u8
    })
}

fn equalise(mut rgb: Raster<[u8; 3]>) -> Raster<[u8; 3]> {
    let mut histograms = [[0.0f32; 256]; 3];
    for pixel in rgb.data() {
        (0..3).for_each(|c| histograms[c][usize::from(pixel[c])] += 1.0);
    }
    let maps = histograms.map(|h| equalising(&h));
    rgb.data_mut().iter_mut().for_each(|pixel| (0..3).for_each(|c| pixel[c] = maps[c][usize::from(pixel[c])]));
    rgb
}

/// Tiles along each side.
const TILES: usize = 8;
/// A grey value counts no more than this often its mean share.
const CLIP: f32 = 2.0;

fn luma(pixel: [u8; 3]) -> u8 {
    ((299 * u32::from(pixel[0]) + 587 * u32::from(pixel[1]) + 114 * u32::from(pixel[2]) + 500) / 1000) as u8
}

fn clahe(mut rgb: Raster<[u8; 3]>) -> Raster<[u8; 3]> {
    let (width, height) = (rgb.width(), rgb.height());
    let (columns, rows) = (TILES.min(width), TILES.min(height));
    let edge = |i: usize, n: usize, length: usize| i * length / n;
    let mut maps = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            let mut histogram = [0.0f32; 256];
            let mut count = 0.0;
            for y in edge(row, rows, height)..edge(row + 1, rows, height) {
                for &pixel in &rgb.row(y)[edge(column, columns, width)..edge(column + 1, columns, width)] {
                    histogram[usize::from(luma(pixel))] += 1.0;
                    count += 1.0;
                }
            }
            let limit = CLIP * count / 256.0;
            let over: f32 = histogram.iter().map(|h| (h - limit).max(0.0)).sum();
            maps.push(equalising(&histogram.map(|h| h.min(limit) + over / 256.0)));
        }
    }
    // Between the centres of tiles maps are mixed.
    let between = |x: usize, n: usize, length: usize| {
        let at = ((x as f32 + 0.5) * n as f32 / length as f32 - 0.5).clamp(0.0, (n - 1) as f32);
        let first = (at as usize).min(n.saturating_sub(2));
        (first, (first + 1).min(n - 1), at - first as f32)
    };
    let across: Vec<_> = (0..width).map(|x| between(x, columns, width)).collect();
    for y in 0..height {
        let (top, bottom, fy) = between(y, rows, height);
        for (pixel, &(left, right, fx)) in rgb.row_mut(y).iter_mut().zip(&across) {
            let old = luma(*pixel);
            let value = |row: usize, column: usize| f32::from(maps[row * columns + column][usize::from(old)]);
            let line = |row: usize| value(row, left) * (1.0 - fx) + value(row, right) * fx;
            let gain = (line(top) * (1.0 - fy) + line(bottom) * fy) / f32::from(old.max(1));
            *pixel = pixel.map(|v| (f32::from(v) * gain).round().min(255.0) as u8);
        }
    }
    rgb
}

/// From RGB to the cone responses, Ruderman et al. 1998.
const LMS: [[f32; 3]; 3] = [[0.3811, 0.5783, 0.0402], [0.1967, 0.7244, 0.0782], [0.0241, 0.1288, 0.8444]];
/// And back.
const RGB: [[f32; 3]; 3] = [[4.4679, -3.5873, 0.1193], [-1.2186, 2.3809, -0.1624], [0.0497, -0.2439, 1.2045]];
/// Share of the pixels at either end of the lightness that the stretch cuts off.
const CUT_OFF: f64 = 0.01;

fn times(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn lab(rgb: &Raster<[u8; 3]>) -> Raster<[u8; 3]> {
    let (a, b, c) = (1.0 / 3f32.sqrt(), 1.0 / 6f32.sqrt(), 1.0 / 2f32.sqrt());
    let mut lab = rgb.map(|pixel| {
        let [l, m, s] = times(&LMS, pixel.map(|v| (f32::from(v) + 1.0) / 256.0)).map(f32::log10);
        [a * (l + m + s), b * (l + m - 2.0 * s), c * (l - m)]
    });
    let count = lab.data().len() as f64;
    let mean = |i: usize| (lab.data().iter().map(|p| f64::from(p[i])).sum::<f64>() / count) as f32;
    let (alpha, beta) = (mean(1), mean(2));
    let mut lightness: Vec<f32> = lab.data().iter().map(|p| p[0]).collect();
    lightness.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| lightness[((share * count) as usize).min(lightness.len() - 1)];
    let (low, high) = (at(CUT_OFF), at(1.0 - CUT_OFF));
    // The range of lightness from 1/256 to 1.
    let (darkest, scale) = (-256f32.log10() * 3.0 * a, 256f32.log10() * 3.0 * a / (high - low).max(1e-3));
    for p in lab.data_mut() {
        *p = [darkest + (p[0] - low).clamp(0.0, high - low) * scale, p[1] - alpha, p[2] - beta];
    }
    lab.map(|&[l, alpha, beta]| {
        let (l, alpha, beta) = (a * l, b * alpha, c * beta);
        let lms = [l + alpha + beta, l + alpha - beta, l - 2.0 * alpha].map(|v| 10f32.powf(v));
        times(&RGB, lms).map(|v| (v * 256.0 - 1.0).round().clamp(0.0, 255.0) as u8)
    })
}

/// Standard deviations of the surroundings, as shares of the long side: 15, 80 and 250 pixels of the 1000 or so of the paper's images.
const SCALES: [f32; 3] = [0.015, 0.08, 0.25];
/// Surroundings are computed at this long side: they hold no detail.
const SURROUND_PX: usize = 256;

fn retinex(rgb: &Raster<[u8; 3]>) -> Raster<[u8; 3]> {
    let (width, height) = (rgb.width(), rgb.height());
    let scale = (SURROUND_PX as f64 / width.max(height) as f64).min(1.0);
    let small = |length: usize| ((length as f64 * scale).round() as usize).max(1);
    let mut out = rgb.clone();
    for channel in 0..3 {
        let plane = rgb.map(|pixel| (f32::from(pixel[channel]) + 1.0) / 256.0);
        let reduced = resize_area_grey(&plane, small(width), small(height));
        let long = reduced.width().max(reduced.height()) as f32;
        let mut ratio: Vec<f32> = plane.data().iter().map(|v| v.ln()).collect();
        for share in SCALES {
            let surround = resize_area_grey(&gaussian_blur(&reduced, (share * long).max(0.5)), width, height);
            ratio.iter_mut().zip(surround.data()).for_each(|(r, s)| *r -= s.max(1e-4).ln() / SCALES.len() as f32);
        }
        // Two standard deviations to either side fill the grey values.
        let count = ratio.len() as f64;
        let mean = ratio.iter().map(|r| f64::from(*r)).sum::<f64>() / count;
        let deviation = (ratio.iter().map(|r| (f64::from(*r) - mean).powi(2)).sum::<f64>() / count).sqrt().max(1e-3);
        for (pixel, r) in out.data_mut().iter_mut().zip(&ratio) {
            pixel[channel] = (127.5 + (f64::from(*r) - mean) / deviation * 63.75).round().clamp(0.0, 255.0) as u8;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Preprocessing; 5] =
        [Preprocessing::None, Preprocessing::Equalise, Preprocessing::Clahe, Preprocessing::Lab, Preprocessing::Retinex];

    /// Faint blue picture of little contrast, with a gradient across.
    fn faint() -> Raster<[u8; 3]> {
        let pixel = |i: usize| [20 + (i % 97 / 12) as u8, 60 + (i % 53 / 6) as u8, 120 + (i % 31 / 3) as u8];
        Raster::from_vec(160, 90, (0..160 * 90).map(pixel).collect()).expect("one value a pixel")
    }

    fn moments(rgb: &Raster<[u8; 3]>, channel: usize) -> (f64, f64) {
        let n = rgb.data().len() as f64;
        let mean = rgb.data().iter().map(|p| f64::from(p[channel])).sum::<f64>() / n;
        (mean, (rgb.data().iter().map(|p| (f64::from(p[channel]) - mean).powi(2)).sum::<f64>() / n).sqrt())
    }

    #[test]
    fn contrast_grows_and_none_is_nothing() {
        let before = faint();
        for kind in ALL {
            let after = preprocess(before.clone(), kind);
            let (old, new) = (moments(&before, 1).1, moments(&after, 1).1);
            match kind {
                Preprocessing::None => assert_eq!(after, before),
                _ => assert!(new > 1.5 * old, "{kind:?}: {old} to {new}"),
            }
        }
    }

    #[test]
    fn equalised_values_are_uniform() {
        // 256 grey values in equal numbers have mean 127.5 and standard deviation 73.9; 10 distinct ones come close.
        let (mean, deviation) = moments(&preprocess(faint(), Preprocessing::Equalise), 2);
        assert!((mean - 127.5).abs() < 3.0 && (deviation - 73.9).abs() < 4.0, "{mean} {deviation}");
    }

    #[test]
    fn the_cast_of_water_goes() {
        let after = preprocess(faint(), Preprocessing::Lab);
        let means = [0, 1, 2].map(|c| moments(&after, c).0);
        let spread = means.iter().fold(0.0f64, |s, m| s.max((m - means[1]).abs()));
        assert!(spread < 25.0, "from 100 grey values between red and blue: {means:?}");
    }

    #[test]
    fn tiny_and_flat_images_do_not_panic() {
        for kind in ALL {
            for (w, h) in [(0, 0), (0, 5), (1, 1), (3, 200)] {
                let after = preprocess(Raster::filled(w, h, [0, 128, 255]), kind);
                assert_eq!((after.width(), after.height()), (w, h));
            }
        }
    }
}
