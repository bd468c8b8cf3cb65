//! Grey values between pixels.

use nalgebra::Vector2;
use scene::Raster;

/// The grey value at a point in pixel coordinates, bilinearly; beyond the border that of the border.
#[inline]
pub(crate) fn bilinear(image: &Raster<f32>, x: f64, y: f64) -> f64 {
    let (w, h) = (image.width(), image.height());
    let (x, y) = ((x - 0.5).clamp(0.0, (w - 1) as f64), (y - 0.5).clamp(0.0, (h - 1) as f64));
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let (fx, fy) = (x - x0 as f64, y - y0 as f64);
    let (top, bottom) = (image.row(y0), image.row(y1));
    let mix = |row: &[f32]| f64::from(row[x0]) * (1.0 - fx) + f64::from(row[x1]) * fx;
    mix(top) * (1.0 - fy) + mix(bottom) * fy
}

/// Whether a point lies within the image, `margin` pixels from its border.
#[inline]
pub(crate) fn inside(image: &Raster<f32>, p: &Vector2<f64>, margin: f64) -> bool {
    let within = |v: f64, size: usize| v >= margin && v <= size as f64 - margin;
    within(p.x, image.width()) && within(p.y, image.height())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_centres_have_their_value_and_others_a_mean() {
        let image = Raster::from_vec(2, 2, vec![0.0f32, 1.0, 2.0, 3.0]).unwrap();
        assert_eq!(bilinear(&image, 0.5, 0.5), 0.0);
        assert_eq!(bilinear(&image, 1.0, 1.0), 1.5);
        assert_eq!(bilinear(&image, 9.0, 9.0), 3.0);
        assert!(inside(&image, &Vector2::new(1.0, 1.0), 1.0) && !inside(&image, &Vector2::new(1.0, 1.5), 1.0));
    }
}
