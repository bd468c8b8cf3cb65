//! On which side of a surface a point lies.

use super::triangle::{Feature, corners};
use nalgebra::{Point3, Vector3};
use scene::Mesh;

/// Normals whose sign with the vector from the nearest point decides the side, also where an edge or a vertex is nearest.
///
/// Face: its normal; edge: the sum of the unit normals at it; vertex: the sum of the unit normals weighted by the angle of
/// each face there (Baerentzen & Aanaes, *Signed distance computation using the angle weighted pseudonormal*, TVCG 2005,
/// who prove the sign for closed surfaces; on open ones it tells the side of the nearest face). Vertices at the same
/// position count as one, so that triangle soups keep their sign. Faces without area carry no normal.
pub(crate) struct PseudoNormals {
    faces: Vec<Vector3<f64>>,
    edges: Vec<[Vector3<f64>; 3]>,
    vertices: Vec<Vector3<f64>>,
    /// Vertex of the mesh to the first one at its position.
    welded: Vec<u32>,
}

impl PseudoNormals {
    pub fn new(mesh: &Mesh, origin: &Point3<f64>) -> Self {
        let welded = weld(&mesh.vertices);
        let mut vertices = vec![Vector3::zeros(); mesh.vertices.len()];
        let mut faces = Vec::with_capacity(mesh.faces.len());
        let mut half_edges = Vec::with_capacity(3 * mesh.faces.len());
        for (f, face) in mesh.faces.iter().enumerate() {
            let p = corners(&mesh.vertices, face, origin);
            let normal = (p[1] - p[0]).cross(&(p[2] - p[0])).try_normalize(0.0).unwrap_or_default();
            faces.push(normal);
            for i in 0..3 {
                let (next, previous) = (p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]);
                let corner = welded[face[i] as usize];
                vertices[corner as usize] += normal * next.angle(&previous);
                let other = welded[face[(i + 1) % 3] as usize];
                half_edges.push((corner.min(other), corner.max(other), (3 * f + i) as u32));
            }
        }
        half_edges.sort_unstable();
        let mut edges = vec![[Vector3::zeros(); 3]; mesh.faces.len()];
        for same in half_edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let sum: Vector3<f64> = same.iter().map(|e| faces[e.2 as usize / 3]).sum();
            for &(_, _, half_edge) in same {
                edges[half_edge as usize / 3][half_edge as usize % 3] = sum;
            }
        }
        Self { faces, edges, vertices, welded }
    }

    /// Negative behind the surface (against its normal), else positive; `to_point` leads from the nearest point, which lies
    /// on `feature` of `face`, to the point.
    pub fn sign(&self, mesh: &Mesh, face: usize, feature: Feature, to_point: &Vector3<f64>) -> f64 {
        let normal = match feature {
            Feature::Face => &self.faces[face],
            Feature::Edge(i) => &self.edges[face][i],
            Feature::Vertex(i) => &self.vertices[self.welded[mesh.faces[face][i] as usize] as usize],
        };
        if normal.dot(to_point) < 0.0 { -1.0 } else { 1.0 }
    }
}

fn weld(vertices: &[Point3<f64>]) -> Vec<u32> {
    let key = |i: u32| vertices[i as usize].coords.map(|c| (c + 0.0).to_bits());
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.sort_unstable_by_key(|&i| (<[u64; 3]>::from(key(i)), i));
    let mut welded = vec![0; vertices.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &i in same {
            welded[i as usize] = same[0];
        }
    }
    welded
}
