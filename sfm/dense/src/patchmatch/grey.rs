//! Grey images laid out for sampling between pixels, and their reduction.

use crate::view::{ACTIVE, INSIDE};
use scene::Raster;

/// A grey image whose every element holds a pixel and its right neighbour, so that a bilinear sample takes two loads.
pub(crate) struct GreyView {
    pub width: usize,
    pub height: usize,
    /// Low half: the pixel; high half: the pixel to its right (its own value in the last column).
    pub pairs: Vec<u32>,
    /// [`crate::view::ACTIVE`] and [`crate::view::INSIDE`] of every pixel.
    pub valid: Raster<u8>,
}

impl GreyView {
    /// `grey` and `valid` have one size.
    pub fn new(grey: &Raster<u16>, valid: &Raster<u8>) -> Self {
        let (width, height) = (grey.width(), grey.height());
        let mut pairs = Vec::with_capacity(width * height);
        for y in 0..height {
            let row = grey.row(y);
            for x in 0..width {
                pairs.push(u32::from(row[x]) | u32::from(row[(x + 1).min(width - 1)]) << 16);
            }
        }
        Self { width, height, pairs, valid: valid.clone() }
    }
}

/// Half the size by averaging 2 x 2 pixels; the last row or column of an odd size is left out, so that coordinates halve exactly.
pub(crate) fn halve_grey(image: &Raster<u16>) -> Raster<u16> {
    halve(image, |a, b, c, d| ((u32::from(a) + u32::from(b) + u32::from(c) + u32::from(d) + 2) / 4) as u16)
}

/// Half the size; a pixel takes part where any of its four does, and is inside where all are.
pub(crate) fn halve_valid(image: &Raster<u8>) -> Raster<u8> {
    halve(image, |a, b, c, d| (a | b | c | d) & ACTIVE | a & b & c & d & INSIDE)
}

fn halve<T: Copy>(image: &Raster<T>, combine: impl Fn(T, T, T, T) -> T) -> Raster<T> {
    let (w, h) = (image.width() / 2, image.height() / 2);
    let mut data = Vec::with_capacity(w * h);
    for y in 0..h {
        let (top, bottom) = (image.row(2 * y), image.row(2 * y + 1));
        for x in 0..w {
            data.push(combine(top[2 * x], top[2 * x + 1], bottom[2 * x], bottom[2 * x + 1]));
        }
    }
    Raster::from_vec(w, h, data).expect("one value a pixel was pushed")
}
