//! Area and volume.

use super::{Plane, check, corners, holes, vector_area};
use crate::SurfaceError;
use nalgebra::Point3;
use scene::Mesh;
use serde::Serialize;

/// Area of all faces.
///
/// # Errors
/// [`SurfaceError::EmptyMesh`], [`SurfaceError::BadFace`].
pub fn surface_area(mesh: &Mesh) -> Result<f64, SurfaceError> {
    check(mesh)?;
    Ok(mesh.faces.iter().map(|f| vector_area(&corners(mesh, f)).norm()).sum())
}

/// Enclosed volume by the divergence theorem, positive where the faces look outwards: the sum over all faces of
/// a . (b x c) / 6 from a common origin.
///
/// # Errors
/// [`SurfaceError::NotClosed`] with the holes where an edge has not two faces; else as [`surface_area`].
pub fn closed_volume(mesh: &Mesh) -> Result<f64, SurfaceError> {
    let found = holes(mesh)?;
    if !found.loops.is_empty() || found.odd_edges > 0 {
        let odd = if found.odd_edges > 0 { format!(", and {} edges of more than two faces", found.odd_edges) } else { String::new() };
        let length = found.loops.iter().map(|h| h.length).sum();
        return Err(SurfaceError::NotClosed { holes: found.loops.len(), length, odd });
    }
    let origin = mesh.vertices[mesh.faces[0][0] as usize];
    let cone = |f: &[u32; 3]| {
        let [a, b, c] = corners(mesh, f).map(|p| p - origin);
        a.dot(&b.cross(&c)) / 6.0
    };
    Ok(mesh.faces.iter().map(cone).sum())
}

/// Volume between a mesh and a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PlaneVolume {
    /// Where the mesh lies above the plane.
    pub above: f64,
    /// Where it lies below, positive.
    pub below: f64,
    /// Area of the mesh seen along the normal of the plane; what overhangs counts once.
    pub footprint: f64,
}

/// Volume between a mesh, open or closed, and a plane: the sum over the faces of the prism down to the plane, exact also for faces that the plane
/// cuts. A face that looks down counts negatively, so that an overhang is what it is: filled below, empty beneath.
///
/// Above a face with projected area A and heights h the volume is A (h1 + h2 + h3) / 3, and of the part with h > 0 where only h1 is,
/// A h1^3 / (3 (h1 - h2)(h1 - h3)).
///
/// # Errors
/// [`SurfaceError::EmptyMesh`], [`SurfaceError::BadFace`].
pub fn volume_over_plane(mesh: &Mesh, plane: &Plane) -> Result<PlaneVolume, SurfaceError> {
    check(mesh)?;
    let mut out = PlaneVolume::default();
    for face in &mesh.faces {
        prism(&corners(mesh, face), plane, &mut out);
    }
    Ok(out)
}

/// Adds what is between a face and the plane.
pub(super) fn prism(corners: &[Point3<f64>; 3], plane: &Plane, volume: &mut PlaneVolume) {
    let area = vector_area(corners).dot(&plane.normal);
    let heights = corners.map(|p| plane.height(&p));
    volume.footprint += area;
    volume.above += area * positive(heights);
    volume.below += area * positive(heights.map(|h| -h));
}

/// Mean over a triangle of the positive part of a linear function with these values in its corners.
fn positive(mut h: [f64; 3]) -> f64 {
    h.sort_by(|a, b| b.total_cmp(a));
    let [a, b, c] = h;
    let tip = |a: f64, b: f64, c: f64| a * (a / (a - b)) * (a / (a - c)) / 3.0;
    if c >= 0.0 {
        (a + b + c) / 3.0
    } else if a <= 0.0 {
        0.0
    } else if b <= 0.0 {
        tip(a, b, c)
    } else {
        (a + b + c) / 3.0 + tip(-c, -b, -a)
    }
}
