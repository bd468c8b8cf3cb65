//! A camera behind a flat port.

use super::Camera;
use nalgebra::{Unit, Vector2, Vector3};

/// Steps of the search for the refracted ray: Newton doubles its digits, 4 to 6 are taken.
const MAX_STEPS: usize = 60;

/// A plane-parallel window between the air of the housing and the water.
///
/// A ray leaves the projection centre in air, crosses the window and goes on in water; at both faces Snell's law holds,
/// n sin(angle to the normal) stays. Rays do not meet in one point, so no pinhole camera is exact behind a port (Treibitz
/// et al., *Flat refractive geometry*, PAMI 2012; Agrawal et al., CVPR 2012).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatPort {
    /// Normal of the window in the frame of the camera, towards the water.
    pub normal: Unit<Vector3<f64>>,
    /// From the projection centre to the inner face along the normal, metres.
    pub distance_m: f64,
    /// Thickness of the window, metres.
    pub thickness_m: f64,
    /// Refractive index of what fills the housing.
    pub index_air: f64,
    /// Refractive index of the window.
    pub index_port: f64,
    /// Refractive index of the water.
    pub index_water: f64,
}

impl FlatPort {
    /// The pixel of a point in the water, through the window and then the lens; `camera` describes the lens in air.
    ///
    /// In the plane of the normal and the point, with s the tangent of the ray's angle in air,
    /// d s + t tan(glass) + (z - d - t) tan(water) = r. The left side grows with s: Newton's method within a bracket finds
    /// the one root. `None` where the point is not beyond the window, or the camera does not see the direction.
    #[must_use]
    pub fn project(&self, camera: &Camera, x_in_cam: &Vector3<f64>) -> Option<Vector2<f64>> {
        camera.project(&self.direction_in_air(x_in_cam)?)
    }

    /// The direction in air, in the frame of the camera, of the ray that reaches a point in the water; its component along the
    /// normal is 1. `None` where the point is not beyond the window.
    #[must_use]
    pub fn direction_in_air(&self, x_in_cam: &Vector3<f64>) -> Option<Vector3<f64>> {
        let along = x_in_cam.dot(&self.normal);
        let across = x_in_cam - along * self.normal.as_ref();
        let radius = across.norm();
        let beyond = along - self.distance_m - self.thickness_m;
        if beyond.is_nan() || beyond <= 0.0 || !radius.is_finite() {
            return None;
        }
        if radius == 0.0 {
            return Some(*self.normal.as_ref());
        }
        let tangent = self.solve(radius, beyond)?;
        Some(self.normal.as_ref() + across * (tangent / radius))
    }

    /// The tangent of the angle in air of the ray that reaches `radius` from the normal, `beyond` the outer face.
    fn solve(&self, radius: f64, beyond: f64) -> Option<f64> {
        let parts =
            [(self.distance_m, 1.0), (self.thickness_m, self.index_air / self.index_port), (beyond, self.index_air / self.index_water)];
        // Tangent in the medium and its derivative: sin = ratio s / sqrt(1 + s2), so tan = ratio s / sqrt(1 + (1 - ratio2) s2).
        let reach = |s: f64| {
            parts.iter().fold((0.0, 0.0), |(sum, slope), &(length, ratio)| {
                let under = 1.0 + (1.0 - ratio * ratio) * s * s;
                (sum + length * ratio * s / under.sqrt(), slope + length * ratio / (under * under.sqrt()))
            })
        };
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut s = radius / parts.iter().map(|(length, ratio)| length * ratio).sum::<f64>();
        for _ in 0..MAX_STEPS {
            let (value, slope) = reach(s);
            let miss = value - radius;
            if miss.abs() <= 1e-15 * radius {
                return Some(s);
            }
            if miss < 0.0 {
                low = s;
            } else {
                high = s;
            }
            let newton = s - miss / slope;
            // Beyond the bracket, or nowhere: halve it, or double as long as nothing lies above.
            let inside = newton > low && newton < high;
            let next = if inside {
                newton
            } else if high.is_finite() {
                (low + high) / 2.0
            } else {
                2.0 * s + 1.0
            };
            if (next - s).abs() <= 1e-15 * s || next > 1e8 {
                return (next <= 1e8).then_some(next);
            }
            s = next;
        }
        Some(s)
    }
}

#[cfg(test)]
mod tests {
    use super::super::CameraModel;
    use super::*;
    use proptest::prelude::*;

    fn port(normal: Vector3<f64>) -> FlatPort {
        FlatPort {
            normal: Unit::new_normalize(normal),
            distance_m: 0.02,
            thickness_m: 0.008_42,
            index_air: 1.0,
            index_port: 1.49,
            index_water: 1.34,
        }
    }

    #[test]
    fn near_the_axis_the_principal_distance_grows_by_the_index_of_water() {
        let camera = Camera::from_focal(CameraModel::Pinhole, 1920, 1200, 1000.0).expect("valid");
        // Far away the lengths within the housing do not matter.
        let pixel = port(Vector3::z()).project(&camera, &Vector3::new(1.0, 0.0, 1e4)).expect("in front");
        assert!(((pixel.x - 960.0) / 0.1 - 1.34).abs() < 1e-4, "{pixel}");
    }

    #[test]
    fn equal_media_leave_the_camera_as_it_is() {
        let camera = Camera::from_focal(CameraModel::Pinhole, 640, 400, 500.0).expect("valid");
        let same = FlatPort { index_port: 1.0, index_water: 1.0, ..port(Vector3::new(0.1, -0.05, 1.0)) };
        let point = Vector3::new(0.4, -0.3, 1.2);
        let (with, without) = (same.project(&camera, &point).expect("seen"), camera.project(&point).expect("seen"));
        assert!((with - without).norm() < 1e-9);
    }

    #[test]
    fn points_that_are_not_in_the_water_have_no_pixel() {
        let camera = Camera::from_focal(CameraModel::Pinhole, 640, 400, 500.0).expect("valid");
        for point in [Vector3::new(0.0, 0.0, 0.028), Vector3::new(0.0, 0.0, -1.0), Vector3::new(f64::NAN, 0.0, 1.0)] {
            assert_eq!(port(Vector3::z()).project(&camera, &point), None, "{point}");
        }
    }

    proptest! {
        #[test]
        fn snells_law_holds_at_both_faces(x in -2.0..2.0f64, y in -2.0..2.0f64, z in 0.05..6.0f64, nx in -0.1..0.1f64, ny in -0.1..0.1f64) {
            let port = port(Vector3::new(nx, ny, 1.0));
            let point = Vector3::new(x, y, z);
            let Some(air) = port.direction_in_air(&point) else { return Ok(()) };
            let n = port.normal.as_ref();
            let sine = |d: &Vector3<f64>| d.cross(n).norm() / d.norm();
            // Walk the ray outwards: where it leaves the glass is known once its angle in the glass is.
            let inner = port.distance_m * air;
            let across = (air - air.dot(n) * n).normalize();
            let in_glass = (sine(&air) * port.index_air / port.index_port).asin().tan();
            let outer = inner + port.thickness_m * (n + in_glass * across);
            let water = point - outer;
            prop_assume!((air - air.dot(n) * n).norm() > 1e-6);
            prop_assert!((port.index_water * sine(&water) - port.index_air * sine(&air)).abs() < 1e-9);
            // One plane.
            prop_assert!(water.normalize().dot(&n.cross(&across)).abs() < 1e-9);
        }
    }
}
