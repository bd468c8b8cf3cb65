//! Distances of points to a reference.

mod measure;
mod nearest;
mod pseudonormal;
#[cfg(test)]
mod tests;
mod triangle;

pub(crate) use measure::{check_mesh, check_positions, signed_to_mesh, to_cloud};

use crate::EvalError;
use scene::{Cloud, Mesh};

/// What a cloud is compared with.
#[derive(Clone, Debug, PartialEq)]
pub enum Reference {
    /// A surface: distances are exact and signed, positive on the side of the face normals.
    Mesh(Mesh),
    /// A denser or better cloud: distances lead to its nearest point and have no sign.
    Cloud(Cloud),
}

/// Distance of every point to the reference, in the unit of the positions: signed for a mesh, positive on the side to which
/// the faces' normals point (counter-clockwise corners), unsigned for a cloud.
///
/// Exact up to the rounding to f32 for a mesh: the nearest triangle is found through a bounding volume hierarchy (parry3d)
/// whose boxes are rounded outwards, the distance to it is computed in f64.
///
/// # Errors
/// [`EvalError::EmptyReference`], [`EvalError::BadFace`] and [`EvalError::BadPosition`]. An empty cloud has no distances.
pub fn distances(cloud: &Cloud, reference: &Reference) -> Result<Vec<f32>, EvalError> {
    Ok(match reference {
        Reference::Mesh(mesh) => signed_to_mesh(&cloud.positions, mesh)?,
        Reference::Cloud(other) => to_cloud(&cloud.positions, &other.positions)?,
    }
    .into_iter()
    .map(|d| d as f32)
    .collect())
}
