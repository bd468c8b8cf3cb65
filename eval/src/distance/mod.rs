//! Distances of points to a reference.

mod measure;
mod nearest;
mod pseudonormal;
#[cfg(test)]
mod tests;
mod tree;
mod triangle;

pub(crate) use measure::{Ruler, centre, check_mesh, check_positions, triangles};
pub(crate) use nearest::Index;
pub(crate) use triangle::Triangle;

use crate::region::Region;
use crate::{EvalError, surface};
use nalgebra::Point3;
use scene::{Cloud, Mesh};

/// What a cloud is compared with.
#[derive(Clone, Debug, PartialEq)]
pub enum Reference {
    /// A surface: distances are exact and signed, positive on the side of the face normals.
    Mesh(Mesh),
    /// A denser or better cloud: distances lead to its nearest point and have no sign.
    Cloud(Cloud),
}

impl Reference {
    /// Points that stand for the reference: those of a cloud, or one for every `step_m` squared of a mesh's area, at most ten
    /// million; only what lies in the region.
    #[must_use]
    pub fn points_over_area(&self, step_m: f64, region: Option<&Region>) -> Vec<Point3<f64>> {
        let mut points = match self {
            Self::Mesh(mesh) => surface::sample(mesh, (surface::area(mesh) / (step_m * step_m)).clamp(1.0, 1e7) as usize),
            Self::Cloud(cloud) => cloud.positions.clone(),
        };
        points.retain(|p| region.is_none_or(|r| r.contains(p)));
        points
    }
}

/// Distance of every point to the reference, in the unit of the positions: signed for a mesh, positive on the side to which
/// the faces' normals point (counter-clockwise corners), unsigned for a cloud.
///
/// Exact: the nearest triangle or point is found through a tree of boxes that are rounded outwards to f32, distances are
/// computed in f64.
///
/// # Errors
/// [`EvalError::EmptyReference`], [`EvalError::BadFace`] and [`EvalError::BadPosition`]. An empty cloud has no distances.
pub fn distances(cloud: &Cloud, reference: &Reference) -> Result<Vec<f32>, EvalError> {
    Ok(Ruler::new(reference)?.distances(&cloud.positions)?.into_iter().map(|d| d as f32).collect())
}
