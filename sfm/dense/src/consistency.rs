//! Whether depth maps agree about a point.

use crate::DepthMap;
use nalgebra::{Matrix3, Vector2, Vector3};

/// Tolerances of the agreement, see [`crate::FusionOptions`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    pub reprojection_px: f64,
    pub relative_depth: f64,
    pub min_normal_cosine: f64,
}

/// A map with its pose unpacked.
pub(crate) struct PosedMap<'a> {
    pub map: &'a DepthMap,
    pub rotation: Matrix3<f64>,
    pub translation: Vector3<f64>,
}

/// What a map says about a point.
pub(crate) enum Opinion {
    /// It does not look there, or knows nothing.
    None,
    /// It sees a surface clearly behind: the point would hide that.
    Contradiction,
    /// It has a surface in front, or one that fits badly.
    Other,
    /// It sees the same surface.
    Agreement(Support),
}

/// Agreement of one map.
pub(crate) struct Support {
    /// Index of the pixel in the map's rasters.
    pub pixel: usize,
    /// The surface point that the map has there.
    pub position: Vector3<f64>,
    /// Its normal in the world.
    pub normal: Vector3<f64>,
    /// Pixels by which the point moves in the map when it moves by one unit along the ray of the reference.
    pub parallax_px: f64,
}

impl<'a> PosedMap<'a> {
    pub fn new(map: &'a DepthMap) -> Self {
        Self { map, rotation: map.cam_from_world.rotation_matrix(), translation: map.cam_from_world.translation }
    }

    pub fn to_cam(&self, x_in_world: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * x_in_world + self.translation
    }

    pub fn to_world(&self, x_in_cam: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.tr_mul(&(x_in_cam - self.translation))
    }

    pub fn normal_in_world(&self, pixel: usize) -> Vector3<f64> {
        let n = self.map.normal.data()[pixel].map(f64::from);
        self.rotation.tr_mul(&Vector3::from(n))
    }

    /// What this map says about the point `x_in_world` with the unit normal `normal`, that `reference` has at `reference_px`.
    pub fn opinion(
        &self,
        reference: &PosedMap,
        reference_px: &Vector2<f64>,
        x_in_world: &Vector3<f64>,
        normal: &Vector3<f64>,
        tolerance: &Tolerance,
    ) -> Opinion {
        let x = self.to_cam(x_in_world);
        if x.z <= 0.0 {
            return Opinion::None;
        }
        let p = self.map.project(&x);
        let Some(&depth) = self.map.depth.at_point(p.x, p.y) else { return Opinion::None };
        if depth <= 0.0 {
            return Opinion::None;
        }
        let (px, py) = (p.x as usize, p.y as usize);
        let pixel = py * self.map.depth.width() + px;
        // The map's plane, continued from the pixel's centre to the point's exact place.
        let camera = &self.map.camera;
        let n = Vector3::from(self.map.normal.data()[pixel].map(f64::from));
        let centre = self.map.along_ray(&Vector2::new(px as f64 + 0.5, py as f64 + 0.5), f64::from(depth));
        let offset = self.map.offset(&p);
        let direction = (x - offset) / x.z;
        let facing = n.dot(&direction);
        let z = if facing < -1e-3 { n.dot(&(centre - offset)) / facing } else { f64::from(depth) };
        if x.z < z * (1.0 - 3.0 * tolerance.relative_depth) {
            return Opinion::Contradiction;
        }
        if (z - x.z).abs() > tolerance.relative_depth * x.z {
            return Opinion::Other;
        }
        let position = self.to_world(&(direction * z + offset));
        let normal_in_world = self.rotation.tr_mul(&n);
        let back = reference.to_cam(&position);
        if back.z <= 0.0
            || (reference.map.project(&back) - reference_px).norm() > tolerance.reprojection_px
            || normal_in_world.dot(normal) < tolerance.min_normal_cosine
        {
            return Opinion::Other;
        }
        let along = self.rotation * (x_in_world - reference.map.cam_from_world.centre()).normalize();
        let parameters = camera.params();
        let moved =
            Vector2::new(parameters[0] * (along.x - direction.x * along.z), parameters[1] * (along.y - direction.y * along.z)) / x.z;
        Opinion::Agreement(Support { pixel, position, normal: normal_in_world, parallax_px: moved.norm() })
    }
}
