//! Gaussian low pass.

use scene::Raster;

/// Half of a sampled Gaussian, from its centre outwards, normalised so that the whole kernel sums to one. It ends at the first
/// sample beyond 3 `sigma`, where a Gaussian is below 1.2 % of its peak.
///
/// A `sigma` that is not positive gives the identity, one above 1000 is taken as 1000.
#[must_use]
pub fn gaussian_kernel(sigma: f32) -> Vec<f32> {
    if !(sigma > 0.0 && sigma.is_finite()) {
        return vec![1.0];
    }
    let sigma = f64::from(sigma).min(1000.0);
    let radius = (3.0 * sigma).ceil() as usize;
    let values: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum = values[0] + 2.0 * values[1..].iter().sum::<f64>();
    values.iter().map(|v| (v / sum) as f32).collect()
}

/// Convolution with a Gaussian of `sigma` pixels; the border is continued by its last pixel.
///
/// A `sigma` that is not positive returns a copy. The kernel grows with `sigma`: reduce the image first for more than about ten pixels.
#[must_use]
pub fn gaussian_blur(image: &Raster<f32>, sigma: f32) -> Raster<f32> {
    let kernel = gaussian_kernel(sigma);
    let (w, h) = (image.width(), image.height());
    if kernel.len() == 1 || image.data().is_empty() {
        return image.clone();
    }
    let radius = kernel.len() - 1;
    let mut out = Raster::filled(w, h, 0.0f32);
    // One row that is already convolved vertically, with its border continued.
    let mut line = vec![0.0f32; w + 2 * radius];
    for y in 0..h {
        let middle = &mut line[radius..radius + w];
        for (value, &centre) in middle.iter_mut().zip(image.row(y)) {
            *value = kernel[0] * centre;
        }
        for (i, &weight) in kernel.iter().enumerate().skip(1) {
            let (above, below) = (image.row(y.saturating_sub(i)), image.row((y + i).min(h - 1)));
            for ((value, &a), &b) in middle.iter_mut().zip(above).zip(below) {
                *value += weight * (a + b);
            }
        }
        let (first, last) = (line[radius], line[radius + w - 1]);
        line[..radius].fill(first);
        line[radius + w..].fill(last);
        let row = out.row_mut(y);
        for (value, &centre) in row.iter_mut().zip(&line[radius..]) {
            *value = kernel[0] * centre;
        }
        for (i, &weight) in kernel.iter().enumerate().skip(1) {
            for ((value, &a), &b) in row.iter_mut().zip(&line[radius - i..]).zip(&line[radius + i..]) {
                *value += weight * (a + b);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two-dimensional convolution in f64, pixel by pixel.
    fn naive(image: &Raster<f32>, sigma: f32) -> Raster<f32> {
        let radius = (3.0 * sigma).ceil() as i64;
        let (w, h) = (image.width() as i64, image.height() as i64);
        let weight = |i: i64, j: i64| (-0.5 * ((i * i + j * j) as f64) / f64::from(sigma).powi(2)).exp();
        let sum: f64 = (-radius..=radius).flat_map(|j| (-radius..=radius).map(move |i| (i, j))).map(|(i, j)| weight(i, j)).sum();
        let mut values = Vec::new();
        for y in 0..h {
            for x in 0..w {
                let mut v = 0.0;
                for j in -radius..=radius {
                    for i in -radius..=radius {
                        let at = ((x + i).clamp(0, w - 1) as usize, (y + j).clamp(0, h - 1) as usize);
                        v += weight(i, j) * f64::from(image[at]);
                    }
                }
                values.push((v / sum) as f32);
            }
        }
        Raster::from_vec(w as usize, h as usize, values).expect("one value a pixel")
    }

    fn noise(w: usize, h: usize) -> Raster<f32> {
        let values = (0..w * h).map(|i| ((i as u32).wrapping_mul(2_654_435_761) >> 8) as f32 / (1u32 << 24) as f32).collect();
        Raster::from_vec(w, h, values).expect("one value a pixel")
    }

    #[test]
    fn agrees_with_the_plain_convolution() {
        for (w, h, sigma) in [(17, 11, 0.8f32), (9, 23, 1.6), (3, 2, 2.5), (1, 1, 1.0), (1, 8, 1.2)] {
            let image = noise(w, h);
            let (found, expected) = (gaussian_blur(&image, sigma), naive(&image, sigma));
            for (a, b) in found.data().iter().zip(expected.data()) {
                // Sums of at most 16 products of f32 below one.
                assert!((a - b).abs() < 2e-6, "{a} {b} at sigma {sigma}");
            }
        }
    }

    #[test]
    fn kernels_sum_to_one_and_bad_sigmas_change_nothing() {
        for sigma in [0.3, 1.0, 4.7] {
            let k = gaussian_kernel(sigma);
            assert!((k[0] + 2.0 * k[1..].iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
        let image = noise(5, 4);
        for sigma in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(gaussian_blur(&image, sigma), image);
        }
        assert_eq!(gaussian_blur(&Raster::filled(0, 3, 0.0), 1.0).data().len(), 0);
    }
}
