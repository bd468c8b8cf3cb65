//! Point clouds.

use nalgebra::{Point3, Vector3};

/// A point cloud. An attribute list is empty, or as long as `positions`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// Positions in the world, metres where the scale is metric.
    pub positions: Vec<Point3<f64>>,
    /// Unit normals.
    pub normals: Vec<Vector3<f32>>,
    /// sRGB colours.
    pub colours: Vec<[u8; 3]>,
    /// Number of views that agree on the point.
    pub views: Vec<u16>,
    /// Estimated standard deviation of the position, in the unit of the positions.
    pub sigmas: Vec<f32>,
}

impl Cloud {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
}
