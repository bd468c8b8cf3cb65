//! Where a mesh ends.

use super::check;
use crate::SurfaceError;
use nalgebra::{Point3, Vector3};
use scene::Mesh;
use serde::Serialize;

/// A loop of edges that have a face on one side only.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hole {
    /// Its vertices in order.
    #[serde(skip)]
    pub vertices: Vec<u32>,
    /// Length of its edges.
    pub length: f64,
    /// Area that it encloses, seen along its own normal: the length of its vector area.
    pub area: f64,
}

/// The boundary of a mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Holes {
    /// Loops, longest first; of an open mesh the first is its rim.
    pub loops: Vec<Hole>,
    /// Edges of more than two faces, or of two that run the same way.
    pub odd_edges: usize,
}

/// The boundary loops of a mesh. Where two loops touch in a vertex the split between them is arbitrary, but always the same.
///
/// # Errors
/// [`SurfaceError::EmptyMesh`], [`SurfaceError::BadFace`].
pub fn holes(mesh: &Mesh) -> Result<Holes, SurfaceError> {
    check(mesh)?;
    let mut edges: Vec<(u32, u32, bool)> =
        mesh.faces.iter().flat_map(|f| (0..3).map(|i| (f[i], f[(i + 1) % 3]))).map(|(a, b)| (a.min(b), a.max(b), a < b)).collect();
    edges.sort_unstable();
    let mut odd_edges = 0;
    // Against the direction of the face beside it, by start.
    let mut boundary: Vec<(u32, u32)> = Vec::new();
    for same in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        match same {
            [(a, b, forward)] => boundary.push(if *forward { (*b, *a) } else { (*a, *b) }),
            [first, second] if first.2 != second.2 => {}
            _ => odd_edges += 1,
        }
    }
    boundary.sort_unstable();
    let mut used = vec![false; boundary.len()];
    let mut loops = Vec::new();
    for start in 0..boundary.len() {
        let (mut at, mut vertices) = (start, Vec::new());
        while !used[at] {
            used[at] = true;
            vertices.push(boundary[at].0);
            let to = boundary[at].1;
            let first = boundary.partition_point(|e| e.0 < to);
            match (first..boundary.len()).take_while(|&k| boundary[k].0 == to).find(|&k| !used[k]) {
                Some(next) => at = next,
                None => break,
            }
        }
        if vertices.len() >= 2 {
            loops.push(measured(mesh, vertices));
        }
    }
    loops.sort_by(|a, b| b.length.total_cmp(&a.length).then(a.vertices.cmp(&b.vertices)));
    Ok(Holes { loops, odd_edges })
}

fn measured(mesh: &Mesh, vertices: Vec<u32>) -> Hole {
    let at = |i: usize| mesh.vertices[vertices[i % vertices.len()] as usize];
    let origin: Point3<f64> = at(0);
    let (mut length, mut area) = (0.0, Vector3::zeros());
    for i in 0..vertices.len() {
        length += (at(i + 1) - at(i)).norm();
        area += (at(i) - origin).cross(&(at(i + 1) - origin)) / 2.0;
    }
    Hole { length, area: area.norm(), vertices }
}
