//! Binary morphology with discs, exact, 64 pixels at a time.
//!
//! A disc of radius r is a stack of 2r + 1 horizontal runs. A dilation by it is the union over these rows of the image, dilated by the run and
//! moved by the row. A dilation by a run widens in steps of one: two shifted unions of words. In all about 4r operations on words, r/16 a pixel.

use crate::BitMask;

/// Half-widths of the rows of a disc: `half_widths(r)[j]` for rows j and -j, the largest x with x^2 + j^2 <= r (r + 1).
///
/// r (r + 1) instead of r^2 rounds the pixels' distances to the nearest whole number: discs without the four spikes.
fn half_widths(radius: usize) -> Vec<usize> {
    let limit = radius * (radius + 1);
    (0..=radius).map(|j| (limit - j * j).isqrt()).collect()
}

/// Union of the discs of `radius` pixels around every set pixel. Radius 0 changes nothing.
#[must_use]
pub fn dilate(image: &BitMask, radius: usize) -> BitMask {
    let mut out = image.clone();
    if image.width() == 0 || radius == 0 {
        return out;
    }
    let height = image.height();
    let half = half_widths(radius);
    // Rows of the disc from its narrow ends to its middle: the run grows.
    let mut wide = image.clone();
    let mut width = 0;
    for j in (0..=radius).rev() {
        while width < half[j] {
            widen(&mut wide);
            width += 1;
        }
        for y in 0..height {
            for target in [y.checked_sub(j), (j > 0).then_some(y + j).filter(|t| *t < height)].into_iter().flatten() {
                out.row_mut(target).iter_mut().zip(wide.row(y)).for_each(|(o, w)| *o |= w);
            }
        }
    }
    out.clear_beyond_width();
    out
}

/// Pixels whose disc of `radius` pixels lies in the set, as far as it lies in the image: what is outside does not take part.
#[must_use]
pub fn erode(image: &BitMask, radius: usize) -> BitMask {
    dilate(&image.not(), radius).not()
}

/// Closing: dilation, then erosion. Fills gaps and bays narrower than the disc; never removes a pixel.
#[must_use]
pub fn close(image: &BitMask, radius: usize) -> BitMask {
    erode(&dilate(image, radius), radius)
}

/// Dilates every row by one pixel to either side. Bits may run beyond the width within the last word.
fn widen(image: &mut BitMask) {
    for y in 0..image.height() {
        let row = image.row_mut(y);
        let mut before = 0u64;
        for i in 0..row.len() {
            let word = row[i];
            let after = row.get(i + 1).copied().unwrap_or(0);
            row[i] = word | (word << 1) | (before >> 63) | (word >> 1) | (after << 63);
            before = word;
        }
    }
    image.clear_beyond_width();
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Pixel by pixel, from the definition.
    fn naive(image: &BitMask, radius: i64, dilation: bool) -> BitMask {
        let mut out = BitMask::new(image.width(), image.height());
        for y in 0..image.height() {
            for x in 0..image.width() {
                let disc = (-radius..=radius).flat_map(|j| (-radius..=radius).map(move |i| (i, j)));
                let mut inside = disc
                    .filter(|(i, j)| i * i + j * j <= radius * (radius + 1))
                    .map(|(i, j)| (x as i64 + i, y as i64 + j))
                    .filter(|&(u, v)| u >= 0 && v >= 0 && u < image.width() as i64 && v < image.height() as i64);
                let set = |(u, v): (i64, i64)| image.get(u as usize, v as usize);
                if if dilation { inside.any(set) } else { inside.all(set) } {
                    out.set(x, y);
                }
            }
        }
        out
    }

    fn image() -> impl Strategy<Value = BitMask> {
        (1usize..140, 1usize..20, 1u32..40, any::<u32>()).prop_map(|(w, h, density, seed)| {
            let values: Vec<u32> =
                (0..w * h).map(|i| (i as u32 ^ seed).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(0x9E37_79B9) >> 16).collect();
            BitMask::from_test(w, h, &values, |v| v % 100 < density)
        })
    }

    proptest! {
        #[test]
        fn agrees_with_the_definition(image in image(), radius in 0usize..8) {
            prop_assert_eq!(dilate(&image, radius), naive(&image, radius as i64, true));
            prop_assert_eq!(erode(&image, radius), naive(&image, radius as i64, false));
        }

        #[test]
        fn closing_is_extensive_and_idempotent(image in image(), radius in 0usize..8) {
            let closed = close(&image, radius);
            prop_assert_eq!(closed.count_common(&image), image.count());
            prop_assert_eq!(close(&closed, radius), closed);
        }
    }

    #[test]
    fn discs_are_round() {
        let mut image = BitMask::new(129, 129);
        image.set(64, 64);
        for radius in [1usize, 5, 20, 60] {
            let disc = dilate(&image, radius);
            let area = std::f64::consts::PI * (radius as f64 + 0.5).powi(2);
            assert!((disc.count() as f64 / area - 1.0).abs() < 0.3 / radius as f64 + 0.01, "radius {radius}: {} {area}", disc.count());
        }
    }
}
