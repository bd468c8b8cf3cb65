//! Areas and volumes of meshes.

use crate::EvalError;
use crate::distance::check_mesh;
use crate::surface;
use scene::Mesh;
use serde::Serialize;

/// Size of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeshSize {
    /// Area of all triangles, square metres.
    pub area_m2: f64,
    /// Enclosed volume, cubic metres, positive where the normals point outwards; `None` where the mesh is open.
    pub volume_m3: Option<f64>,
    /// Edges that do not belong to two triangles of opposite direction: 0 for a closed surface.
    pub open_edges: usize,
}

/// Area, volume and closedness of a mesh. The volume is the sum of the tetrahedra over the triangles from a common corner
/// (divergence theorem; Zhang & Chen, *Efficient feature extraction for 2D/3D objects in mesh representation*, ICIP 2001).
/// Vertices at the same place but of different index count as different: such a mesh is open.
///
/// # Errors
/// As for distances to a mesh.
pub fn mesh_size(mesh: &Mesh) -> Result<MeshSize, EvalError> {
    check_mesh(mesh)?;
    // Per edge, smaller vertex first: how often forwards less how often backwards, and how often at all.
    let mut edges: Vec<(u32, u32, bool)> =
        mesh.faces.iter().flat_map(|f| (0..3).map(|i| (f[i], f[(i + 1) % 3]))).map(|(a, b)| (a.min(b), a.max(b), a < b)).collect();
    edges.sort_unstable();
    let closed = |same: &[(u32, u32, bool)]| same.len() == 2 && same[0].2 != same[1].2;
    let open_edges = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter(|same| !closed(same)).count();
    let origin = mesh.vertices[mesh.faces[0][0] as usize];
    let tetrahedron = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|v| mesh.vertices[v as usize] - origin);
        a.dot(&b.cross(&c)) / 6.0
    };
    let volume: f64 = mesh.faces.iter().map(tetrahedron).sum();
    Ok(MeshSize { area_m2: surface::area(mesh), volume_m3: (open_edges == 0).then_some(volume), open_edges })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn a_cube_has_its_volume_and_a_box_without_lid_has_none() {
        let corner = |i: u32| Point3::new(1e5 + f64::from(i & 1) * 2.0, f64::from(i >> 1 & 1) * 3.0, f64::from(i >> 2) * 4.0);
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mut mesh = Mesh { vertices: (0..8).map(corner).collect(), faces, colours: vec![] };
        let size = mesh_size(&mesh).expect("a cuboid");
        assert!((size.volume_m3.expect("closed") - 24.0).abs() < 1e-9 && (size.area_m2 - 52.0).abs() < 1e-9, "{size:?}");
        mesh.faces.iter_mut().for_each(|f| f.swap(1, 2));
        assert!((mesh_size(&mesh).expect("inside out").volume_m3.expect("closed") + 24.0).abs() < 1e-9);
        mesh.faces.truncate(10);
        assert_eq!(mesh_size(&mesh).map(|s| (s.volume_m3, s.open_edges)), Ok((None, 4)));
    }
}
