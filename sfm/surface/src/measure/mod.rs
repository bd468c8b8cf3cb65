//! What is measured on a mesh.

mod footprint;
mod holes;
mod plane;
mod rugosity;
mod volume;

pub use footprint::{Footprint, StandingVolume, standing_volume};
pub use holes::{Hole, Holes, holes};
pub use plane::{Plane, fit_plane, rim_plane};
pub use rugosity::{ProfileRugosity, Rugosity, profile_rugosity, rugosity};
pub use volume::{PlaneVolume, closed_volume, surface_area, volume_over_plane};

use crate::SurfaceError;
use nalgebra::{Point3, Vector3};
use scene::Mesh;

/// Refuses a mesh without faces, and faces that do not name finite vertices.
pub(crate) fn check(mesh: &Mesh) -> Result<(), SurfaceError> {
    if mesh.faces.is_empty() {
        return Err(SurfaceError::EmptyMesh);
    }
    let good = |v: u32| mesh.vertices.get(v as usize).is_some_and(|p| p.iter().all(|c| c.is_finite()));
    match mesh.faces.iter().position(|f| !f.iter().all(|&v| good(v))) {
        Some(face) => Err(SurfaceError::BadFace { face, vertices: mesh.faces[face], count: mesh.vertices.len() }),
        None => Ok(()),
    }
}

fn corners(mesh: &Mesh, face: &[u32; 3]) -> [Point3<f64>; 3] {
    face.map(|v| mesh.vertices[v as usize])
}

/// Half the cross product of two sides: the normal with the area as its length.
fn vector_area([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a)) / 2.0
}
