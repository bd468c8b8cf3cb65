//! Photographs made ready for detection: reduced, smoothed, with even contrast.

use imaging::{gaussian_blur, resize_area_grey};
use scene::Raster;

/// Sides of the image below which it is not reduced further.
const MIN_SIDE: usize = 200;
/// Half the side of the window for the local mean and contrast, as a share of the long side.
const WINDOW_SHARE: f64 = 0.04;
/// Contrast, in grey values from 0 to 1, below which a place counts as flat: the noise of a dark picture.
const FLAT: f32 = 0.012;

/// A reduced image with local mean 0 and local standard deviation 1.
pub(crate) struct Level {
    /// Normalised grey values.
    pub image: Raster<f32>,
    /// Pixels of the original a pixel of this, along x and y.
    pub scale: [f64; 2],
}

/// Levels from the finest to the coarsest that are at most `max_side` long.
pub(crate) fn levels(image: &Raster<f32>, max_side: usize, sigma: f32) -> Vec<Level> {
    let mut levels = Vec::new();
    let mut factor = 1;
    loop {
        let (w, h) = (image.width() / factor, image.height() / factor);
        if w.min(h) < MIN_SIDE && factor > 1 || w.min(h) < 24 {
            return levels;
        }
        if w.max(h) <= max_side || w.min(h) / 2 < MIN_SIDE {
            let reduced = if factor == 1 { image.clone() } else { resize_area_grey(image, w, h) };
            let scale = [image.width() as f64 / w as f64, image.height() as f64 / h as f64];
            levels.push(Level { image: normalised(&gaussian_blur(&reduced, sigma)), scale });
        }
        factor *= 2;
    }
}

/// Local mean 0 and standard deviation 1 (Wallis 1976), so that haze, vignetting and lamps do not matter.
fn normalised(image: &Raster<f32>) -> Raster<f32> {
    let (w, h) = (image.width(), image.height());
    let half = ((w.max(h) as f64 * WINDOW_SHARE) as usize).max(8);
    let sums = Sums::new(image);
    let mut out = Raster::filled(w, h, 0.0f32);
    for y in 0..h {
        for x in 0..w {
            let (mean, variance) = sums.moments(x, y, half);
            out[(x, y)] = (image[(x, y)] - mean) / (variance.sqrt() + FLAT);
        }
    }
    out
}

/// Running sums of values and squares (Crow, SIGGRAPH 1984).
pub(crate) struct Sums {
    width: usize,
    height: usize,
    values: Vec<[f64; 2]>,
}

impl Sums {
    pub(crate) fn new(image: &Raster<f32>) -> Self {
        let (w, h) = (image.width(), image.height());
        let mut values = vec![[0.0; 2]; (w + 1) * (h + 1)];
        for y in 0..h {
            let mut row = [0.0; 2];
            for (x, &v) in image.row(y).iter().enumerate() {
                row[0] += f64::from(v);
                row[1] += f64::from(v) * f64::from(v);
                let above = values[y * (w + 1) + x + 1];
                values[(y + 1) * (w + 1) + x + 1] = [above[0] + row[0], above[1] + row[1]];
            }
        }
        Self { width: w, height: h, values }
    }

    /// Mean and variance in the square of `2 half + 1` pixels about one, cut off at the border.
    pub(crate) fn moments(&self, x: usize, y: usize, half: usize) -> (f32, f32) {
        let (x0, x1) = (x.saturating_sub(half), (x + half + 1).min(self.width));
        let (y0, y1) = (y.saturating_sub(half), (y + half + 1).min(self.height));
        let at = |x: usize, y: usize| self.values[y * (self.width + 1) + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        let n = ((x1 - x0) * (y1 - y0)) as f64;
        let [sum, square] = [0, 1].map(|k| (d[k] - b[k] - c[k] + a[k]) / n);
        (sum as f32, (square - sum * sum).max(0.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_window() {
        let image = Raster::from_vec(3, 2, vec![1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        let (mean, variance) = Sums::new(&image).moments(0, 0, 1);
        assert_eq!((mean, variance), (3.0, 2.5));
    }

    #[test]
    fn large_images_are_reduced_to_the_limit_and_on() {
        let image = Raster::filled(3000, 2000, 0.5f32);
        let sizes: Vec<usize> = levels(&image, 1600, 1.0).iter().map(|l| l.image.width()).collect();
        assert_eq!(sizes, [1500, 750, 375]);
        let small = Raster::filled(300, 100, 0.5f32);
        assert_eq!(levels(&small, 1600, 1.0).len(), 1);
    }
}
