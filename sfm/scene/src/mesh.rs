//! Triangle meshes.

use nalgebra::Point3;

/// A triangle mesh; faces are counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in the world.
    pub vertices: Vec<Point3<f64>>,
    /// Vertex indices of each triangle.
    pub faces: Vec<[u32; 3]>,
    /// sRGB colour of each vertex, or empty.
    pub colours: Vec<[u8; 3]>,
}
