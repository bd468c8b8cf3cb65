//! Binary images of one bit a pixel: morphology and labelling then work on 64 pixels at once.

use scene::{Mask, Raster};

/// A binary image, row after row; each row starts with a new word, pixel x is bit `x % 64` of word `x / 64`. Bits beyond the width are zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BitMask {
    width: usize,
    height: usize,
    words: Vec<u64>,
}

impl BitMask {
    /// An image of zeros.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, words: vec![0; width.div_ceil(64) * height] }
    }

    /// The image of the pixels for which `test` holds; `values` are row-major.
    ///
    /// # Panics
    /// When the number of values is not `width * height`.
    #[must_use]
    pub fn from_test<T: Copy>(width: usize, height: usize, values: &[T], test: impl Fn(T) -> bool) -> Self {
        assert_eq!(values.len(), width * height, "one value a pixel");
        let mut bits = Self::new(width, height);
        for y in 0..height {
            for (word, pixels) in bits.row_mut(y).iter_mut().zip(values[y * width..(y + 1) * width].chunks(64)) {
                *word = pixels.iter().enumerate().fold(0, |word, (i, &v)| word | (u64::from(test(v)) << i));
            }
        }
        bits
    }

    /// The pixels of a mask above 127.
    #[must_use]
    pub fn from_mask(mask: &Mask) -> Self {
        Self::from_test(mask.width(), mask.height(), mask.data(), |v| v > 127)
    }

    /// The mask of `width` x `height` pixels in which every bit fills a square of `factor` pixels, the last ones cut at the border or
    /// continued to it.
    ///
    /// # Panics
    /// When the image has no pixels but the mask has, or `factor` is zero.
    #[must_use]
    pub fn to_mask(&self, width: usize, height: usize, factor: usize) -> Mask {
        assert!(factor > 0, "a factor of zero");
        let mut mask: Mask = Raster::filled(width, height, 0);
        for y in 0..height {
            let row = self.row((y / factor).min(self.height - 1));
            let line = mask.row_mut(y);
            for_runs(row, self.width, |from, to| {
                let end = if to == self.width { width } else { width.min(to * factor) };
                line[(from * factor).min(end)..end].fill(255);
            });
        }
        mask
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The words of row `y`.
    #[must_use]
    pub fn row(&self, y: usize) -> &[u64] {
        let n = self.width.div_ceil(64);
        &self.words[y * n..(y + 1) * n]
    }

    /// The words of row `y`; bits beyond the width must stay zero.
    pub(crate) fn row_mut(&mut self, y: usize) -> &mut [u64] {
        let n = self.width.div_ceil(64);
        &mut self.words[y * n..(y + 1) * n]
    }

    /// Whether pixel (x, y) is set; false outside.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> bool {
        x < self.width && y < self.height && self.row(y)[x / 64] >> (x % 64) & 1 == 1
    }

    /// Sets pixel (x, y).
    ///
    /// # Panics
    /// Outside of the image.
    pub fn set(&mut self, x: usize, y: usize) {
        assert!(x < self.width, "column {x} of {}", self.width);
        self.row_mut(y)[x / 64] |= 1 << (x % 64);
    }

    /// Takes pixel (x, y) out.
    ///
    /// # Panics
    /// Outside of the image.
    pub fn clear(&mut self, x: usize, y: usize) {
        assert!(x < self.width, "column {x} of {}", self.width);
        self.row_mut(y)[x / 64] &= !(1 << (x % 64));
    }

    /// Number of set pixels.
    #[must_use]
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// The complement.
    #[must_use]
    pub fn not(&self) -> Self {
        let mut out = self.clone();
        out.words.iter_mut().for_each(|w| *w = !*w);
        out.clear_beyond_width();
        out
    }

    /// Adds the pixels of an image of the same size.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn or(&mut self, other: &Self) {
        assert_eq!((self.width, self.height), (other.width, other.height), "same size");
        self.words.iter_mut().zip(&other.words).for_each(|(a, b)| *a |= b);
    }

    /// The pixels set in both of two images of the same size.
    ///
    /// # Panics
    /// When the sizes differ.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        assert_eq!((self.width, self.height), (other.width, other.height), "same size");
        let words = self.words.iter().zip(&other.words).map(|(a, b)| a & b).collect();
        Self { width: self.width, height: self.height, words }
    }

    /// Number of pixels set in both of two images of the same size.
    ///
    /// # Panics
    /// When the sizes differ.
    #[must_use]
    pub fn count_common(&self, other: &Self) -> usize {
        assert_eq!((self.width, self.height), (other.width, other.height), "same size");
        self.words.iter().zip(&other.words).map(|(a, b)| (a & b).count_ones() as usize).sum()
    }

    /// Restores the invariant about bits beyond the width.
    pub(crate) fn clear_beyond_width(&mut self) {
        let used = self.width % 64;
        if used != 0 {
            let n = self.width.div_ceil(64);
            self.words.chunks_exact_mut(n).for_each(|row| row[n - 1] &= (1 << used) - 1);
        }
    }
}

/// Calls with the first column of every run of set pixels in a row of `width` pixels, and the column after its last.
pub(crate) fn for_runs(row: &[u64], width: usize, mut f: impl FnMut(usize, usize)) {
    let mut open: Option<usize> = None;
    for (i, &word) in row.iter().enumerate() {
        // Bits where the row changes with respect to the pixel before.
        let mut changes = word ^ ((word << 1) | u64::from(open.is_some()));
        while changes != 0 {
            let x = 64 * i + changes.trailing_zeros() as usize;
            match open.take() {
                None => open = Some(x),
                Some(from) => f(from, x),
            }
            changes &= changes - 1;
        }
    }
    if let Some(from) = open {
        f(from, width);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(w: usize, h: usize) -> Mask {
        let values = (0..w * h).map(|i| if (i as u32).wrapping_mul(2_654_435_761) >> 30 == 0 { 255 } else { 0 }).collect();
        Raster::from_vec(w, h, values).expect("one value a pixel")
    }

    #[test]
    fn mask_to_bits_and_back() {
        for (w, h) in [(1, 1), (63, 3), (64, 2), (65, 4), (200, 7)] {
            let mask = pattern(w, h);
            let bits = BitMask::from_mask(&mask);
            assert_eq!(bits.to_mask(w, h, 1), mask);
            assert_eq!(bits.count(), mask.data().iter().filter(|&&v| v == 255).count());
            assert_eq!(bits.not().count(), w * h - bits.count());
            assert_eq!(bits.not().not(), bits);
            assert_eq!(bits.count_common(&bits.not()), 0);
            assert_eq!(bits.and(&bits), bits);
        }
    }

    #[test]
    fn squares_are_cut_at_the_border_or_continued_to_it() {
        for (w, h, factor) in [(1, 1, 3), (67, 5, 2), (130, 9, 5)] {
            let small = pattern(w, h);
            let bits = BitMask::from_mask(&small);
            // One pixel less than the squares cover, and some more than that.
            for (width, height) in [(w * factor - 1, h * factor - 1), (w * factor + 7, h * factor + 3)] {
                let mask = bits.to_mask(width, height, factor);
                for y in 0..height {
                    for x in 0..width {
                        assert_eq!(
                            mask[(x, y)],
                            small[((x / factor).min(w - 1), (y / factor).min(h - 1))],
                            "{x} {y} of {width} x {height}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn bits_fill_squares() {
        let mut bits = BitMask::new(2, 1);
        bits.set(1, 0);
        let mask = bits.to_mask(5, 3, 2);
        for y in 0..3 {
            assert_eq!(mask.row(y), [0, 0, 255, 255, 255]);
        }
    }
}
