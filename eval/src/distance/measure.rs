//! Distances to a mesh and to a cloud.

use super::Reference;
use super::nearest::Index;
use super::pseudonormal::PseudoNormals;
use super::triangle::{Triangle, corners};
use crate::{EvalError, hilbert};
use nalgebra::{Point3, Vector3};
use scene::Mesh;

/// Largest coordinate relative to the reference whose square is far from the limits of f32.
const MAX_COORDINATE: f64 = 1e12;

/// A reference that is ready to be asked.
pub(crate) enum Ruler<'a> {
    /// A mesh, with what tells its sides apart.
    Mesh { mesh: &'a Mesh, index: Index<Triangle>, normals: PseudoNormals },
    /// A cloud.
    Cloud(Index<Vector3<f64>>),
}

impl<'a> Ruler<'a> {
    /// Checks a reference and prepares it.
    pub fn new(reference: &'a Reference) -> Result<Self, EvalError> {
        match reference {
            Reference::Mesh(mesh) => {
                check_mesh(mesh)?;
                let origin = centre(&mesh.vertices);
                let (normals, index) = rayon::join(|| PseudoNormals::new(mesh, &origin), || Index::new(origin, triangles(mesh, &origin)));
                Ok(Self::Mesh { mesh, index, normals })
            }
            Reference::Cloud(cloud) => {
                if cloud.is_empty() {
                    return Err(EvalError::EmptyReference("the cloud has no points"));
                }
                check_positions("reference point", &cloud.positions, &Point3::origin())?;
                let origin = centre(&cloud.positions);
                Ok(Self::Cloud(Index::new(origin, cloud.positions.iter().map(|p| p - origin).collect())))
            }
        }
    }

    /// Distance of every point: signed to a mesh, unsigned to a cloud.
    pub fn distances(&self, points: &[Point3<f64>]) -> Result<Vec<f64>, EvalError> {
        match self {
            Self::Mesh { mesh, index, normals } => {
                check_positions("point", points, &index.origin)?;
                Ok(index.map_nearest(points, |found, p| {
                    let (triangle, face) = index.primitive(found.slot);
                    let (to_point, feature) = triangle.nearest(p);
                    to_point.norm() * normals.sign(mesh, face, feature, &to_point)
                }))
            }
            Self::Cloud(index) => {
                check_positions("point", points, &index.origin)?;
                Ok(index.map_nearest(points, |found, _| found.squared.sqrt()))
            }
        }
    }
}

/// The triangles of a mesh relative to `origin`.
pub(crate) fn triangles(mesh: &Mesh, origin: &Point3<f64>) -> Vec<Triangle> {
    mesh.faces.iter().map(|face| Triangle::new(corners(&mesh.vertices, face, origin))).collect()
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

/// Centre of the box of the points: what coordinates are taken relative to, so that f32 can hold them.
pub(crate) fn centre(points: &[Point3<f64>]) -> Point3<f64> {
    let (min, max) = hilbert::bounds(points);
    nalgebra::center(&min, &max)
}
