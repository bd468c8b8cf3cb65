//! The flat port as the renderer sees it.

use nalgebra::Vector3;
use scene::FlatPort;

/// Where directions of the camera models behind the window are exact, metres: vehicles keep two to four metres from what they survey.
const OBJECT_DISTANCE_M: f64 = 3.0;

/// A plane-parallel window that a ray passes from the lens outwards, by the vector form of Snell's law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Normal towards the water, in the frame of the camera.
    pub normal: Vector3<f64>,
    /// From the projection centre to the inner face, metres.
    pub distance_m: f64,
    /// Thickness, metres.
    pub thickness_m: f64,
    /// Refractive indices of air, window and water.
    pub indices: [f64; 3],
}

impl Window {
    /// Where a ray that leaves the projection centre along a unit vector enters the water, and its unit direction there.
    #[must_use]
    pub fn leave(&self, direction: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let [air, window, water] = self.indices;
        let inside = self.refract(direction, air / window);
        let outside = self.refract(&inside, window / water);
        let inner = direction * (self.distance_m / direction.dot(&self.normal));
        (inner + inside * (self.thickness_m / inside.dot(&self.normal)), outside)
    }

    fn refract(&self, direction: &Vector3<f64>, ratio: f64) -> Vector3<f64> {
        let cosine = direction.dot(&self.normal);
        let bent = (1.0 - ratio * ratio * (1.0 - cosine * cosine)).max(0.0).sqrt();
        direction * ratio + self.normal * (bent - ratio * cosine)
    }

    /// The same window for the camera models.
    #[must_use]
    pub fn port(&self) -> FlatPort {
        let [index_air, index_port, index_water] = self.indices;
        FlatPort {
            normal: nalgebra::Unit::new_normalize(self.normal),
            distance_m: self.distance_m,
            thickness_m: self.thickness_m,
            index_air,
            index_port,
            index_water,
            object_distance_m: OBJECT_DISTANCE_M,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Lens;
    use super::*;
    use scene::{Camera, CameraModel};

    /// A pixel followed into the water comes back to itself by the camera model's search, over the whole frame.
    #[test]
    fn there_and_back() {
        let lens = Lens { focal_px: 1000.0, axis_px: [963.0, 596.0], radial: [-0.09, 0.008], tangential: [1e-4, 2e-4] };
        let params = [1000.0, 963.0, 596.0, -0.09, 0.008, 0.0, 1e-4, 2e-4, 0.0, 0.0];
        let camera = Camera::new(CameraModel::Brown, 1920, 1200, &params).expect("valid");
        let normal = Vector3::new(0.008, -0.005, 1.0).normalize();
        let window = Window { normal, distance_m: 0.031, thickness_m: 0.008_42, indices: [1.0, 1.491, 1.3414] };
        for i in 0..=16 {
            for j in 0..=10 {
                let (x, y) = (120.0 * f64::from(i), 120.0 * f64::from(j));
                let [u, v] = lens.tangents(x, y);
                let (origin, direction) = window.leave(&Vector3::new(u, v, 1.0).normalize());
                assert!((direction.norm() - 1.0).abs() < 1e-12);
                for distance in [0.1, 0.7, 4.0, 50.0] {
                    let pixel = window.port().project(&camera, &(origin + distance * direction)).expect("in the water");
                    assert!((pixel.x - x).abs() < 1e-8 && (pixel.y - y).abs() < 1e-8, "{x} {y} at {distance} m became {pixel}");
                }
            }
        }
    }
}
