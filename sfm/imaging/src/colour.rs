//! Grey values.

use scene::Raster;

/// Weights of ITU-R BT.601 luma, the Y of JPEG.
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];

/// Grey values in 0..=1 of an sRGB image: BT.601 luma of the encoded values, the same quantity as the Y channel of a JPEG.
#[must_use]
pub fn grey_from_rgb(rgb: &Raster<[u8; 3]>) -> Raster<f32> {
    rgb.map(|&[r, g, b]| luma(f32::from(r), f32::from(g), f32::from(b)) / 255.0)
}

/// Luma in the unit of its arguments.
pub(crate) fn luma(r: f32, g: f32, b: f32) -> f32 {
    LUMA[0] * r + LUMA[1] * g + LUMA[2] * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_of_white_black_and_primaries() {
        let rgb = Raster::from_vec(5, 1, vec![[0; 3], [255; 3], [255, 0, 0], [0, 255, 0], [0, 0, 255]]).expect("five pixels");
        let grey = grey_from_rgb(&rgb);
        for (found, expected) in grey.data().iter().zip([0.0, 1.0, 0.299, 0.587, 0.114]) {
            // Three roundings of f32.
            assert!((found - expected).abs() < 3e-7, "{found} for {expected}");
        }
    }
}
