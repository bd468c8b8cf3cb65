//! Distances to a mesh and to a cloud.

use super::nearest::Index;
use super::pseudonormal::PseudoNormals;
use super::triangle::{Triangle, corners};
use crate::{EvalError, morton};
use nalgebra::Point3;
use scene::Mesh;

/// Largest coordinate relative to the reference whose square is far from the limits of f32.
const MAX_COORDINATE: f64 = 1e12;

/// Signed distance of every point.
pub(crate) fn signed_to_mesh(points: &[Point3<f64>], mesh: &Mesh) -> Result<Vec<f64>, EvalError> {
    check_mesh(mesh)?;
    let (origin, extent) = frame(&mesh.vertices);
    check_positions("point", points, &origin)?;
    let normals = PseudoNormals::new(mesh, &origin);
    let triangles = mesh.faces.iter().map(|face| Triangle::new(corners(&mesh.vertices, face, &origin))).collect();
    let index = Index::new(origin, extent, triangles);
    Ok(index.map_nearest(points, |nearest, p| {
        let (to_point, feature) = index.primitives[nearest].nearest(p);
        to_point.norm() * normals.sign(mesh, nearest, feature, &to_point)
    }))
}

/// Distance of every point to the nearest of `others`.
pub(crate) fn to_cloud(points: &[Point3<f64>], others: &[Point3<f64>]) -> Result<Vec<f64>, EvalError> {
    if others.is_empty() {
        return Err(EvalError::EmptyReference("the cloud has no points"));
    }
    check_positions("reference point", others, &Point3::origin())?;
    let (origin, extent) = frame(others);
    check_positions("point", points, &origin)?;
    let index = Index::new(origin, extent, others.iter().map(|p| p - origin).collect());
    Ok(index.map_nearest(points, |nearest, p| (p - index.primitives[nearest]).norm()))
}

/// A mesh has faces, these name existing vertices, and all are at usable positions.
pub(crate) fn check_mesh(mesh: &Mesh) -> Result<(), EvalError> {
    if mesh.faces.is_empty() {
        return Err(EvalError::EmptyReference("the mesh has no faces"));
    }
    let count = mesh.vertices.len();
    if let Some(face) = mesh.faces.iter().position(|f| f.iter().any(|&v| v as usize >= count)) {
        return Err(EvalError::BadFace { face, vertices: mesh.faces[face], count });
    }
    check_positions("reference vertex", &mesh.vertices, &Point3::origin())
}

pub(crate) fn check_positions(what: &'static str, points: &[Point3<f64>], origin: &Point3<f64>) -> Result<(), EvalError> {
    let bad = points.iter().position(|p| !(p - origin).iter().all(|c| c.abs() <= MAX_COORDINATE));
    bad.map_or(Ok(()), |index| Err(EvalError::BadPosition { what, index, position: points[index].into() }))
}

/// Centre of the box of the points and the largest coordinate relative to it: what f32 has to hold.
fn frame(points: &[Point3<f64>]) -> (Point3<f64>, f64) {
    let (min, max) = morton::bounds(points);
    (nalgebra::center(&min, &max), (max - min).amax() / 2.0)
}
