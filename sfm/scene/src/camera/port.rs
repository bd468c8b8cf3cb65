//! A camera behind a flat port.

use super::Camera;
use nalgebra::{Matrix3, Unit, Vector2, Vector3};
use thiserror::Error;

/// Steps of the search for the refracted ray: Newton doubles its digits, 4 to 6 are taken.
const MAX_STEPS: usize = 60;

/// A plane-parallel window between the air of the housing and the water.
///
/// A ray leaves the projection centre in air, crosses the window and goes on in water; at both faces Snell's law holds,
/// n sin(angle to the normal) stays. Rays do not meet in one point, so no pinhole camera is exact behind a port (Treibitz
/// et al., *Flat refractive geometry*, PAMI 2012; Agrawal et al., CVPR 2012).
///
/// Where a pixel alone has to stand for a direction from the projection centre, it is that of the point of its ray at `object_distance_m`:
/// 10 mm behind the port the lateral error at twice the distance is below half of that.
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
    /// Distance from the projection centre at which directions are exact, metres: that of most of what is seen.
    pub object_distance_m: f64,
}

/// What a port cannot be.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{what} of a flat port cannot be {value}: {needed}")]
pub struct PortError {
    /// The quantity.
    pub what: &'static str,
    /// Its value.
    pub value: f64,
    /// What it has to be.
    pub needed: &'static str,
}

/// Tangent in a medium, and its derivative, of a ray with tangent `s` in air: sin = ratio s / sqrt(1 + s2), so
/// tan = ratio s / sqrt(1 + (1 - ratio2) s2).
#[inline]
fn bend(s: f64, ratio: f64) -> (f64, f64) {
    let inverse = 1.0 / (1.0 + (1.0 - ratio * ratio) * s * s);
    let root = ratio * inverse.sqrt();
    (s * root, root * inverse)
}

impl FlatPort {
    /// Every number: normal, distance, thickness, indices of air, window and water, object distance.
    #[must_use]
    pub fn values(&self) -> [f64; 9] {
        let n = &self.normal;
        let lengths_and_indices =
            [self.distance_m, self.thickness_m, self.index_air, self.index_port, self.index_water, self.object_distance_m];
        let [d, t, a, p, w, o] = lengths_and_indices;
        [n.x, n.y, n.z, d, t, a, p, w, o]
    }

    /// Whether there can be such a port.
    ///
    /// # Errors
    /// [`PortError`] for lengths and indices that are not positive numbers, a window without a distance to the camera may have 0, and for a
    /// normal that looks away from what the camera sees.
    pub fn check(&self) -> Result<(), PortError> {
        let within = |what, value: f64, low: f64, needed| {
            if value.is_finite() && value >= low { Ok(()) } else { Err(PortError { what, value, needed }) }
        };
        within("the distance", self.distance_m, 0.0, "it is 0 or more")?;
        within("the thickness", self.thickness_m, 0.0, "it is 0 or more")?;
        for (what, index) in [
            ("the index of the air", self.index_air),
            ("the index of the window", self.index_port),
            ("the index of the water", self.index_water),
        ] {
            within(what, index, 1.0, "no medium has less than 1")?;
        }
        let least = self.distance_m + self.thickness_m + 1e-3;
        within("the object distance", self.object_distance_m, least, "it lies beyond the window")?;
        within("the normal's component along the axis of the camera", self.normal.z, 0.5, "it points towards the water, within 60 degrees")
    }

    /// The pixel of a point in the water, through the window and then the lens; `camera` describes the lens in air.
    ///
    /// `None` where the point is not beyond the window, or the camera does not see the direction.
    #[must_use]
    pub fn project(&self, camera: &Camera, x_in_cam: &Vector3<f64>) -> Option<Vector2<f64>> {
        camera.in_air().project(&self.direction_in_air(x_in_cam)?)
    }

    /// The direction in air, in the frame of the camera, of the ray that reaches a point in the water; its component along the
    /// normal is 1. `None` where the point is not beyond the window.
    ///
    /// In the plane of the normal and the point, with s the tangent of the ray's angle in air,
    /// d s + t tan(glass) + (z - d - t) tan(water) = r. The left side grows with s: Newton's method within a bracket finds
    /// the one root.
    #[must_use]
    pub fn direction_in_air(&self, x_in_cam: &Vector3<f64>) -> Option<Vector3<f64>> {
        let (across, radius, beyond) = self.place(x_in_cam)?;
        if radius == 0.0 {
            return Some(*self.normal.as_ref());
        }
        let tangent = self.solve(radius, beyond)?;
        Some(self.normal.as_ref() + across * (tangent / radius))
    }

    /// As [`FlatPort::direction_in_air`], with its derivative by the point.
    ///
    /// With F(s, r, z) = 0 as above: ds/dr = 1 / F_s and ds/dz = -tan(water) / F_s. The direction is n + s e, e the unit vector across, which turns with the
    /// point by (I - n n' - e e') / r.
    #[must_use]
    pub fn direction_with_jacobian(&self, x_in_cam: &Vector3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (across, radius, beyond) = self.place(x_in_cam)?;
        let n = self.normal.as_ref();
        let parts = self.parts(beyond);
        let s = if radius == 0.0 { 0.0 } else { self.solve(radius, beyond)? };
        let slope: f64 = parts.iter().map(|&(length, ratio)| length * bend(s, ratio).1).sum();
        let plane = Matrix3::identity() - n * n.transpose();
        // Near the normal s / r is its limit there, to twice as many digits.
        if radius <= 1e-9 * beyond {
            let direction = if radius == 0.0 { *n } else { n + across * (s / radius) };
            return Some((direction, plane / slope));
        }
        let e = across / radius;
        let (by_radius, by_depth) = (1.0 / slope, -bend(s, parts[2].1).0 / slope);
        let turn = s / radius;
        let jacobian = e * (by_radius * e + by_depth * n).transpose() + turn * (plane - e * e.transpose());
        Some((n + across * turn, jacobian))
    }

    /// Where a ray that leaves the projection centre in this direction in air is at [`FlatPort::object_distance_m`] from it. `None` where it does not reach the window.
    #[must_use]
    pub fn point_at_object_distance(&self, in_air: &Vector3<f64>) -> Option<Vector3<f64>> {
        let n = self.normal.as_ref();
        let along = in_air.dot(n);
        if along.is_nan() || along <= 0.0 {
            return None;
        }
        let tangents = (in_air - along * n) / along;
        let s = tangents.norm();
        let scaled = |ratio: f64| if s > 0.0 { tangents * (bend(s, ratio).0 / s) } else { tangents };
        let [(distance, _), (thickness, in_port), (_, in_water)] = self.parts(0.0);
        let outer = distance * (n + tangents) + thickness * (n + scaled(in_port));
        let direction = (n + scaled(in_water)).normalize();
        let half = outer.dot(&direction);
        let left = half * half - outer.norm_squared() + self.object_distance_m * self.object_distance_m;
        (left > 0.0).then(|| outer + (left.sqrt() - half) * direction)
    }

    /// Offset from the normal, its length, and the way beyond the outer face.
    fn place(&self, x_in_cam: &Vector3<f64>) -> Option<(Vector3<f64>, f64, f64)> {
        let along = x_in_cam.dot(&self.normal);
        let across = x_in_cam - along * self.normal.as_ref();
        let radius = across.norm();
        let beyond = along - self.distance_m - self.thickness_m;
        (beyond > 0.0 && radius.is_finite()).then_some((across, radius, beyond))
    }

    /// Way along the normal in each medium, and the index of air over that of the medium.
    fn parts(&self, beyond: f64) -> [(f64, f64); 3] {
        [(self.distance_m, 1.0), (self.thickness_m, self.index_air / self.index_port), (beyond, self.index_air / self.index_water)]
    }

    /// The tangent of the angle in air of the ray that reaches `radius` from the normal, `beyond` the outer face.
    fn solve(&self, radius: f64, beyond: f64) -> Option<f64> {
        let parts = self.parts(beyond);
        let reach = |s: f64| {
            parts.iter().fold((0.0, 0.0), |(sum, slope), &(length, ratio)| {
                let (tangent, growth) = bend(s, ratio);
                (sum + length * tangent, slope + length * growth)
            })
        };
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut s = radius / parts.iter().map(|(length, ratio)| length * ratio).sum::<f64>();
        for _ in 0..MAX_STEPS {
            let (value, slope) = reach(s);
            let miss = value - radius;
            // Sums of a few roundings: no step betters them.
            if miss.abs() <= 4.0 * f64::EPSILON * radius {
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
            object_distance_m: 2.0,
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
