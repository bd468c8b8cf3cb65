//! The volume of what stands on the ground, also where nobody saw its top.

use super::volume::prism;
use super::{Plane, PlaneVolume, check, corners, vector_area};
use crate::SurfaceError;
use nalgebra::{Point2, Point3, Vector3};
use scene::Mesh;
use serde::Serialize;

/// The part of a plane that a mesh covers, seen along the normal, on a grid of square cells; what it encloses counts as covered.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    origin: Point3<f64>,
    axes: [Vector3<f64>; 2],
    cell: f64,
    width: usize,
    height: usize,
    covered: Vec<bool>,
}

/// Most cells of a grid: beyond, they are made larger.
const MAX_CELLS: f64 = 4.0e7;

impl Footprint {
    /// The cells of edge `cell` that a face of `mesh` reaches, and those that they enclose. For a grid above forty million cells they are
    /// larger.
    ///
    /// # Errors
    /// [`SurfaceError::EmptyMesh`], [`SurfaceError::BadFace`]; [`SurfaceError::BadOption`] for an edge that is no positive length.
    pub fn new(mesh: &Mesh, plane: &Plane, cell: f64) -> Result<Self, SurfaceError> {
        check(mesh)?;
        if !(cell > 0.0 && cell.is_finite()) {
            return Err(SurfaceError::BadOption { name: "cell", value: cell, what: "it must be a positive length" });
        }
        let axes = plane.axes();
        let along = |p: &Point3<f64>| Point2::new((p - plane.point).dot(&axes[0]), (p - plane.point).dot(&axes[1]));
        let used = || mesh.faces.iter().flatten().map(|&v| along(&mesh.vertices[v as usize]));
        let low = used().fold(Point2::new(f64::MAX, f64::MAX), |a, p| a.inf(&p));
        let size = used().fold(Point2::new(f64::MIN, f64::MIN), |a, p| a.sup(&p)) - low;
        let cell = cell.max((size.x * size.y / MAX_CELLS).sqrt());
        // A free cell all around, for the water that flows round the island.
        let [width, height] = [size.x, size.y].map(|s| (s / cell) as usize + 3);
        let origin = plane.point + axes[0] * (low.x - cell) + axes[1] * (low.y - cell);
        let mut made = Self { origin, axes, cell, width, height, covered: vec![false; width * height] };
        for face in &mesh.faces {
            made.mark(&corners(mesh, face).map(|p| made.flat(&p)));
        }
        made.fill();
        Ok(made)
    }

    /// Place on the grid, cells.
    fn flat(&self, p: &Point3<f64>) -> Point2<f64> {
        let d = p - self.origin;
        Point2::new(d.dot(&self.axes[0]), d.dot(&self.axes[1])) / self.cell
    }

    /// Marks the cells of the corners, and those whose centre lies in the triangle.
    fn mark(&mut self, [a, b, c]: &[Point2<f64>; 3]) {
        for p in [a, b, c] {
            self.covered[p.y as usize * self.width + p.x as usize] = true;
        }
        let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
        let side = |p: &Point2<f64>, q: &Point2<f64>, x: f64, y: f64| (q - p).perp(&(Point2::new(x, y) - p));
        for row in low.y as usize..=high.y as usize {
            for column in low.x as usize..=high.x as usize {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let sides = [side(a, b, x, y), side(b, c, x, y), side(c, a, x, y)];
                if sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0) {
                    self.covered[row * self.width + column] = true;
                }
            }
        }
    }

    /// Covers what cannot be reached from the border over free sides.
    fn fill(&mut self) {
        let mut outside = vec![false; self.covered.len()];
        let mut open = vec![0];
        outside[0] = true;
        while let Some(at) = open.pop() {
            let (x, y) = (at % self.width, at / self.width);
            let beside = [
                (x > 0).then(|| at - 1),
                (x + 1 < self.width).then_some(at + 1),
                (y > 0).then(|| at - self.width),
                (y + 1 < self.height).then_some(at + self.width),
            ];
            for next in beside.into_iter().flatten() {
                if !outside[next] && !self.covered[next] {
                    outside[next] = true;
                    open.push(next);
                }
            }
        }
        self.covered.iter_mut().zip(outside).for_each(|(covered, outside)| *covered = !outside);
    }

    /// Whether the foot of a point is covered.
    #[must_use]
    pub fn covers(&self, p: &Point3<f64>) -> bool {
        let p = self.flat(p);
        let inside = p.x >= 0.0 && p.y >= 0.0 && p.x < self.width as f64 && p.y < self.height as f64;
        inside && self.covered[p.y as usize * self.width + p.x as usize]
    }

    /// Area that is covered.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.covered.iter().filter(|c| **c).count() as f64 * self.cell * self.cell
    }
}

/// The volume between a reconstructed surface and a plane, over the ground that was surveyed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StandingVolume {
    /// Where the surface lies above the plane; an overhang is empty beneath.
    pub above: f64,
    /// Where it lies below, positive.
    pub below: f64,
    /// Area of the ground.
    pub footprint: f64,
    /// Share, 0 to 1, of the surface over it, seen along the normal from either side, that points support. The rest is what the reconstruction
    /// made of what it knew around.
    pub supported: f64,
}

/// The volume between a reconstructed surface and a plane over a footprint: [`super::volume_over_plane`] of the faces whose middle is over it.
///
/// `mesh` is the surface as reconstructed, *before* it is trimmed: closed over and beneath every place. A trimmed one is open where nobody saw the
/// top of a thing, and without a top there is no volume. `density` and `threshold` are those of [`crate::trim`] and tell what is supported.
///
/// # Errors
/// [`SurfaceError::EmptyMesh`], [`SurfaceError::BadFace`]; [`SurfaceError::BadOption`] where not every vertex has a density.
pub fn standing_volume(
    mesh: &Mesh,
    density: &[f32],
    threshold: f64,
    plane: &Plane,
    footprint: &Footprint,
) -> Result<StandingVolume, SurfaceError> {
    check(mesh)?;
    if density.len() != mesh.vertices.len() {
        return Err(SurfaceError::BadOption { name: "density", value: density.len() as f64, what: "every vertex must have one" });
    }
    let mut volume = PlaneVolume::default();
    let (mut all, mut supported) = (0.0, 0.0);
    for face in &mesh.faces {
        let corners = corners(mesh, face);
        if !footprint.covers(&Point3::from((corners[0].coords + corners[1].coords + corners[2].coords) / 3.0)) {
            continue;
        }
        prism(&corners, plane, &mut volume);
        let area = vector_area(&corners).dot(&plane.normal).abs();
        all += area;
        if face.iter().all(|&v| f64::from(density[v as usize]) >= threshold) {
            supported += area;
        }
    }
    let supported = if all > 0.0 { supported / all } else { 0.0 };
    Ok(StandingVolume { above: volume.above, below: volume.below, footprint: footprint.area(), supported })
}
