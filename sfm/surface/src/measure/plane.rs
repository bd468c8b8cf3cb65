//! Planes to measure from.

use super::holes;
use crate::SurfaceError;
use nalgebra::{Matrix3, Point3, SymmetricEigen, Vector3};
use scene::Mesh;

/// An oriented plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of it.
    pub point: Point3<f64>,
    /// Its unit normal: where above is.
    pub normal: Vector3<f64>,
}

/// Rounds of reweighting.
const ROUNDS: usize = 30;
/// Points further off than this many robust standard deviations are left out in the end.
const OUTLIER: f64 = 3.0;

impl Plane {
    /// Signed distance of a point.
    #[must_use]
    pub fn height(&self, point: &Point3<f64>) -> f64 {
        (point - self.point).dot(&self.normal)
    }

    /// Two unit vectors along the plane, perpendicular to each other.
    #[must_use]
    pub fn axes(&self) -> [Vector3<f64>; 2] {
        let least = if self.normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let first = (least - self.normal * self.normal.dot(&least)).normalize();
        [first, self.normal.cross(&first)]
    }
}

/// A plane through most of the points, its normal on the side of `up`: least squares reweighted by the Cauchy function, 1 / (1 + (d / s)^2)
/// with s 1.4826 times the median distance (Holland & Welsch, *Robust regression using iteratively reweighted least-squares*, 1977), then
/// plain least squares of the points within 3 s, so that what stands on the plane does not tilt it.
///
/// # Errors
/// [`SurfaceError::NoPlane`] where the points lie on one line.
pub fn fit_plane(points: &[Point3<f64>], up: &Vector3<f64>) -> Result<Plane, SurfaceError> {
    let spread = |plane: &Plane| {
        let mut off: Vec<f64> = points.iter().map(|p| plane.height(p).abs()).collect();
        let middle = off.len() / 2;
        1.4826 * *off.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let mut plane = least_squares(points, |_| 1.0, up)?;
    for _ in 0..ROUNDS {
        let s = spread(&plane);
        match least_squares(points, |p| 1.0 / (1.0 + (plane.height(p) / s).powi(2)), up) {
            Ok(next) if s > 0.0 => plane = next,
            // Most points lie on it exactly.
            _ => break,
        }
    }
    let limit = OUTLIER * spread(&plane);
    Ok(least_squares(points, |p| f64::from(plane.height(p).abs() <= limit), up).unwrap_or(plane))
}

fn least_squares(points: &[Point3<f64>], weight: impl Fn(&Point3<f64>) -> f64, up: &Vector3<f64>) -> Result<Plane, SurfaceError> {
    let weights: Vec<f64> = points.iter().map(weight).collect();
    let total: f64 = weights.iter().sum();
    let mean = points.iter().zip(&weights).map(|(p, &w)| p.coords * w).sum::<Vector3<f64>>() / total;
    let spread = |(p, &w): (&Point3<f64>, &f64)| {
        let d = p.coords - mean;
        d * d.transpose() * w
    };
    let scatter: Matrix3<f64> = points.iter().zip(&weights).map(spread).sum();
    if points.len() < 3 || !scatter.iter().all(|v| v.is_finite()) {
        return Err(SurfaceError::NoPlane);
    }
    let eigen = SymmetricEigen::new(scatter);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    if eigen.eigenvalues[order[1]] <= eigen.eigenvalues[order[2]] * 1e-12 {
        return Err(SurfaceError::NoPlane);
    }
    let normal: Vector3<f64> = eigen.eigenvectors.column(order[0]).into();
    let normal = if normal.dot(up) < 0.0 { -normal } else { normal };
    Ok(Plane { point: mean.into(), normal: normal.normalize() })
}

/// Edges that the band beside the rim lies inside: a reconstructed surface bends where the points end.
const BAND_FROM: u32 = 8;
/// Edges to where it ends.
const BAND_TO: u32 = 16;

/// The plane through the vertices beside the rim of an open mesh, its longest boundary loop, 8 to 16 edges inside (those of the rim itself
/// where there are none), fitted as by [`fit_plane`], above where the faces look in the mean: the ground that what stands in the middle
/// stands on.
///
/// # Errors
/// [`SurfaceError::NoPlane`] where the mesh is closed or the vertices lie on a line; as [`holes()`].
pub fn rim_plane(mesh: &Mesh) -> Result<Plane, SurfaceError> {
    let found = holes(mesh)?;
    let rim = found.loops.first().ok_or(SurfaceError::NoPlane)?;
    let away = edges_from(mesh, &rim.vertices);
    let up: Vector3<f64> = mesh.faces.iter().map(|f| super::vector_area(&super::corners(mesh, f))).sum();
    let with = |range: std::ops::RangeInclusive<u32>| -> Vec<Point3<f64>> {
        mesh.vertices.iter().zip(&away).filter(|(_, away)| range.contains(away)).map(|(p, _)| *p).collect()
    };
    let band = with(BAND_FROM..=BAND_TO);
    if band.len() >= rim.vertices.len() { fit_plane(&band, &up) } else { fit_plane(&with(0..=0), &up) }
}

/// Number of edges from each vertex to the nearest of some, up to the end of the band.
fn edges_from(mesh: &Mesh, start: &[u32]) -> Vec<u32> {
    let mut away = vec![u32::MAX; mesh.vertices.len()];
    start.iter().for_each(|&v| away[v as usize] = 0);
    for step in 1..=BAND_TO {
        // A face that has a vertex of the last step gives its others this one.
        for face in &mesh.faces {
            if face.iter().any(|&v| away[v as usize] == step - 1) {
                for &v in face {
                    away[v as usize] = away[v as usize].min(step);
                }
            }
        }
    }
    away
}
