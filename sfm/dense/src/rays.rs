//! The rays of a camera behind a flat port, which do not meet in one point.

use nalgebra::{Vector2, Vector3};
use scene::Camera;

/// Where directions are those of the rays in the water themselves, metres.
pub(crate) const FAR_M: f64 = 1e5;
/// Pixels between nodes: between two of them offsets of millimetres bend by micrometres.
const STEP: usize = 8;
/// Tangent of the largest angle in air that a lens looks at through a port; nodes beyond repeat the offset at it.
const MAX_TANGENT_IN_AIR: f64 = 4.0;

/// Where the rays of the pixels of a raster of directions pass.
///
/// Behind a flat port the raster shows at each pixel what lies in its direction (u, v, 1) in the water. The ray there is that of
/// X = (u z + a, v z + b, z): straight, but not from the origin of the camera's frame. (a, b) is its offset, a smooth function of the pixel,
/// which is kept at every eighth and interpolated.
#[derive(Clone, Debug, PartialEq)]
pub struct RayOffsets {
    width: usize,
    height: usize,
    /// By rows, metres; the first node is the centre of the top-left pixel.
    nodes: Vec<[f32; 2]>,
}

impl RayOffsets {
    /// Of the directions that `pinhole` shows, seen by `camera`; `None` without a port, where all rays pass the origin.
    pub(crate) fn new(camera: &Camera, pinhole: &Camera) -> Option<Self> {
        let port = camera.port()?;
        // Two points of a ray, well outside of the housing.
        let near = 1.0 + 10.0 * (port.distance_m + port.thickness_m);
        let at = |object_distance_m| scene::FlatPort { object_distance_m, ..*port };
        let (first, second, far) = (at(near), at(2.0 * near), at(FAR_M));
        let offset = |direction: &Vector3<f64>| {
            let in_air = far.direction_in_air(&(direction * FAR_M)).unwrap_or(*port.normal);
            let across = in_air - *port.normal * in_air.dot(&port.normal);
            let shrink = (MAX_TANGENT_IN_AIR / across.norm()).min(1.0);
            let in_air = *port.normal + across * shrink;
            let (Some(a), Some(b)) = (first.point_at_object_distance(&in_air), second.point_at_object_distance(&in_air)) else {
                return [0.0; 2];
            };
            let along = (b - a) / (b.z - a.z);
            [(a.x - a.z * along.x) as f32, (a.y - a.z * along.y) as f32]
        };
        let (width, height) = Self::shape(pinhole);
        let p = pinhole.params();
        let node = |i: usize| {
            let (x, y) = ((STEP * (i % width)) as f64 + 0.5, (STEP * (i / width)) as f64 + 0.5);
            offset(&Vector3::new((x - p[2]) / p[0], (y - p[3]) / p[1], 1.0))
        };
        Some(Self { width, height, nodes: (0..width * height).map(node).collect() })
    }

    /// Of stored nodes; `None` when they are not those of a raster of this size, or not finite.
    pub(crate) fn from_nodes(pinhole: &Camera, nodes: Vec<[f32; 2]>) -> Option<Self> {
        let (width, height) = Self::shape(pinhole);
        let whole = nodes.len() == width * height && nodes.iter().flatten().all(|v| v.is_finite());
        whole.then_some(Self { width, height, nodes })
    }

    pub(crate) fn nodes(&self) -> &[[f32; 2]] {
        &self.nodes
    }

    /// Number of nodes along the rows and columns of a raster: the last ones stand on or behind its last pixels.
    fn shape(pinhole: &Camera) -> (usize, usize) {
        let count = |pixels: u32| (pixels as usize).div_ceil(STEP) + 1;
        (count(pinhole.width()), count(pinhole.height()))
    }

    /// The offset at a pixel in index coordinates, in which the centre of the top-left pixel is (0, 0); outside of the raster that of the border.
    #[inline(always)]
    pub(crate) fn at_index(&self, x: f32, y: f32) -> [f32; 2] {
        const INVERSE: f32 = 1.0 / STEP as f32;
        let gx = (x * INVERSE).clamp(0.0, (self.width - 1) as f32);
        let gy = (y * INVERSE).clamp(0.0, (self.height - 1) as f32);
        let (ix, iy) = ((gx as usize).min(self.width - 2), (gy as usize).min(self.height - 2));
        let (fx, fy) = (gx - ix as f32, gy - iy as f32);
        let upper = &self.nodes[iy * self.width + ix..][..2];
        let lower = &self.nodes[(iy + 1) * self.width + ix..][..2];
        [0, 1].map(|k| {
            let (top, bottom) = (upper[0][k] + fx * (upper[1][k] - upper[0][k]), lower[0][k] + fx * (lower[1][k] - lower[0][k]));
            top + fy * (bottom - top)
        })
    }

    /// The offset at a place in the raster, in which the centre of the top-left pixel is (0.5, 0.5).
    #[must_use]
    pub fn at(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        Vector2::from(self.at_index((pixel.x - 0.5) as f32, (pixel.y - 0.5) as f32).map(f64::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::{CameraModel, FlatPort};

    /// Points along the rays of pixels project to these pixels through the port.
    #[test]
    fn points_on_the_rays_project_to_their_pixels() {
        let lens = Camera::new(CameraModel::OpenCv, 960, 600, &[500.0, 502.0, 478.0, 303.0, -0.06, 0.004, 1e-4, -1e-4]).expect("valid");
        let port = FlatPort {
            normal: nalgebra::Unit::new_normalize(Vector3::new(0.02, -0.01, 1.0)),
            distance_m: 0.02,
            thickness_m: 0.008,
            index_air: 1.0,
            index_port: 1.49,
            index_water: 1.34,
            object_distance_m: 2.0,
        };
        let camera = lens.behind(Some(port)).expect("possible");
        let pinhole = Camera::from_focal(CameraModel::Pinhole, 960, 600, camera.mean_focal()).expect("valid");
        let rays = RayOffsets::new(&camera, &pinhole).expect("behind a port");
        let far = camera.with_object_distance(FAR_M);
        let (mut compared, mut largest, mut worst) = (0, 0.0f64, 0.0f64);
        for i in 0..960 * 600 / 97 {
            let pixel = Vector2::new((97 * i % 960) as f64 + 0.3, (97 * i / 960) as f64 + 0.8);
            let direction = pinhole.ray(&pixel).expect("pinhole");
            let direction = direction / direction.z;
            let in_image = |p: &Vector2<f64>| p.x > 0.0 && p.y > 0.0 && p.x < 960.0 && p.y < 600.0;
            let Some(expected) = far.project_direction(&direction).filter(in_image) else { continue };
            let offset = rays.at(&pixel);
            largest = largest.max(offset.norm());
            for z in [0.15, 0.4, 1.0, 5.0] {
                let x = direction * z + Vector3::new(offset.x, offset.y, 0.0);
                let found = camera.project(&x).expect("seen");
                worst = worst.max((found - expected).norm());
                compared += 1;
            }
        }
        assert!(compared > 15_000 && largest > 0.005, "{compared} {largest}");
        // In the corners, where they bend most, 5 micrometres between nodes; 0.15 m away these are 0.02 px.
        assert!(worst < 0.03, "{worst}");
        assert!(RayOffsets::new(&lens, &pinhole).is_none());
        assert_eq!(RayOffsets::from_nodes(&pinhole, rays.nodes().to_vec()).as_ref(), Some(&rays));
        assert!(RayOffsets::from_nodes(&pinhole, rays.nodes()[1..].to_vec()).is_none());
    }
}
