//! How rough a surface is.

use super::{Plane, check, corners, vector_area};
use crate::SurfaceError;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use scene::Mesh;
use serde::Serialize;

/// Roughness as a ratio of areas.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rugosity {
    /// Area of the faces.
    pub area: f64,
    /// Their area seen along the normal of the plane; what overhangs counts once.
    pub projected: f64,
    /// The first by the second, 1 for a plane.
    pub ratio: f64,
}

/// Surface area by planar area (Dahl, *Surface area in ecological analysis: quantification of benthic coral-reef algae*, Marine Biology 23,
/// 1973).
///
/// # Errors
/// [`SurfaceError::NoPlane`] where nothing is seen along the normal, as of a closed mesh; [`SurfaceError::EmptyMesh`],
/// [`SurfaceError::BadFace`].
pub fn rugosity(mesh: &Mesh, plane: &Plane) -> Result<Rugosity, SurfaceError> {
    check(mesh)?;
    let (mut area, mut projected) = (0.0, 0.0);
    for face in &mesh.faces {
        let of_face = vector_area(&corners(mesh, face));
        area += of_face.norm();
        projected += of_face.dot(&plane.normal);
    }
    if projected <= area * 1e-9 {
        return Err(SurfaceError::NoPlane);
    }
    Ok(Rugosity { area, projected, ratio: area / projected })
}

/// Roughness along profiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProfileRugosity {
    /// Profiles that cross the surface.
    pub profiles: usize,
    /// Mean of the ratio of chain to tape.
    pub mean: f64,
    /// Smallest of them.
    pub min: f64,
    /// Largest of them.
    pub max: f64,
}

/// Chain and tape: the length of the surface along a line by the straight length (Risk, *Fish diversity on a coral reef in the Virgin
/// Islands*, Atoll Research Bulletin 153, 1972), on `count` profiles along each of two perpendicular directions of the plane, evenly over the
/// extent of the mesh. The chain follows every triangle, overhangs too; where the mesh has a hole neither chain nor tape counts.
///
/// # Errors
/// [`SurfaceError::NoPlane`] where no profile crosses the mesh; [`SurfaceError::EmptyMesh`], [`SurfaceError::BadFace`].
pub fn profile_rugosity(mesh: &Mesh, plane: &Plane, count: usize) -> Result<ProfileRugosity, SurfaceError> {
    check(mesh)?;
    let profiles: Vec<(Vector3<f64>, f64)> = plane
        .axes()
        .iter()
        .flat_map(|&across| {
            let at = |p: &Point3<f64>| (p - plane.point).dot(&across);
            let (low, high) = mesh.vertices.iter().map(at).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            (0..count).map(move |i| (across, low + (high - low) * (i as f64 + 0.5) / count as f64))
        })
        .collect();
    let ratios: Vec<Option<f64>> = profiles.par_iter().map(|(across, offset)| profile(mesh, plane, across, *offset)).collect();
    let ratios: Vec<f64> = ratios.into_iter().flatten().collect();
    if ratios.is_empty() {
        return Err(SurfaceError::NoPlane);
    }
    Ok(ProfileRugosity {
        profiles: ratios.len(),
        mean: ratios.iter().sum::<f64>() / ratios.len() as f64,
        min: ratios.iter().copied().fold(f64::INFINITY, f64::min),
        max: ratios.iter().copied().fold(0.0, f64::max),
    })
}

/// Chain by tape where the plane at `offset` along `across` cuts the mesh.
fn profile(mesh: &Mesh, plane: &Plane, across: &Vector3<f64>, offset: f64) -> Option<f64> {
    let (mut chain, mut tape) = (0.0, 0.0);
    for face in &mesh.faces {
        let corners = corners(mesh, face);
        let d = corners.map(|p| (p - plane.point).dot(across) - offset);
        if d.iter().all(|&d| d < 0.0) || d.iter().all(|&d| d >= 0.0) {
            continue;
        }
        let mut ends = (0..3).filter_map(|i| {
            let (a, b) = (d[i], d[(i + 1) % 3]);
            ((a < 0.0) != (b < 0.0)).then(|| corners[i] + (corners[(i + 1) % 3] - corners[i]) * (a / (a - b)))
        });
        if let (Some(a), Some(b)) = (ends.next(), ends.next()) {
            let step = b - a;
            let flat = (step - plane.normal * step.dot(&plane.normal)).norm();
            chain += step.norm();
            // Under an overhang the tape is passed three times, once backwards.
            tape += flat * vector_area(&corners).dot(&plane.normal).signum();
        }
    }
    (tape > chain * 1e-6).then(|| chain / tape)
}
