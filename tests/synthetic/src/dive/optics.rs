//! The optics of the renderer, written apart from `scene::Camera`.

use nalgebra::Vector3;

/// A lens with one focal length, its axis at a pixel, and one radial term: an image radius is r (1 + k r^2) focal
/// lengths, where r is the tangent of the angle to the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Where the axis meets the image, pixels.
    pub axis_px: [f64; 2],
    /// Radial term k.
    pub radial: f64,
}

impl Optics {
    /// Direction of the ray that ends at a point of the image; the middle of the top-left pixel is (0.5, 0.5).
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> Vector3<f64> {
        let (dx, dy) = ((x - self.axis_px[0]) / self.focal_px, (y - self.axis_px[1]) / self.focal_px);
        let bent = dx.hypot(dy);
        if bent == 0.0 {
            return Vector3::z();
        }
        // Bisection on r (1 + k r^2) = bent: slower than Newton, and with nothing in common with it.
        let (mut low, mut high) = (0.0, 4.0 * bent + 1.0);
        if self.radial < 0.0 {
            // The image radius grows up to here only.
            high = (-1.0 / (3.0 * self.radial)).sqrt();
        }
        for _ in 0..60 {
            let r = (low + high) / 2.0;
            if r * (1.0 + self.radial * r * r) < bent {
                low = r;
            } else {
                high = r;
            }
        }
        let scale = low / bent;
        Vector3::new(dx * scale, dy * scale, 1.0).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::{Camera, CameraModel};

    #[test]
    fn agrees_with_the_camera_model() {
        let optics = Optics { focal_px: 520.0, axis_px: [322.0, 199.0], radial: -0.08 };
        let camera = Camera::new(CameraModel::SimpleRadial, 640, 400, &[520.0, 322.0, 199.0, -0.08]).expect("valid");
        for i in 0..=20 {
            for j in 0..=20 {
                let (x, y) = (32.0 * f64::from(i), 20.0 * f64::from(j));
                let pixel = camera.project(&(3.0 * optics.direction(x, y))).expect("in front");
                assert!((pixel.x - x).abs() < 1e-9 && (pixel.y - y).abs() < 1e-9, "{x} {y} became {pixel}");
            }
        }
    }
}
