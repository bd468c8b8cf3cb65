//! Cutting off what no points support.

use crate::SurfaceError;
use crate::clean::{keep, used};
use crate::measure::check;
use scene::Mesh;
use serde::Serialize;

/// What was cut off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TrimSummary {
    /// Density below which the surface was cut, points a unit of area.
    pub threshold: f64,
    /// Area before.
    pub area_before: f64,
    /// Area after.
    pub area_after: f64,
    /// Share of the area that is gone.
    pub share: f64,
    /// Pieces that were left out because they were small.
    pub islands: usize,
}

/// Cuts a mesh where the density of points falls below `threshold`: faces across the limit are cut along the line of that density,
/// linear along their edges. Pieces smaller than the share `min_island` of the area that is left are removed as well. Densities and colours go
/// with the vertices.
///
/// # Errors
/// [`SurfaceError::BadOption`] for a threshold that is negative or an island share outside 0 to 1; [`SurfaceError::EmptyMesh`],
/// [`SurfaceError::BadFace`]. That nothing is left is no error.
pub fn trim(mesh: &Mesh, density: &[f32], threshold: f64, min_island: f64) -> Result<(Mesh, Vec<f32>, TrimSummary), SurfaceError> {
    check(mesh)?;
    if !(threshold >= 0.0 && threshold.is_finite() && density.len() == mesh.vertices.len()) {
        let what = "it must be 0 or more, and every vertex must have a density";
        return Err(SurfaceError::BadOption { name: "threshold", value: threshold, what });
    }
    if !(0.0..1.0).contains(&min_island) {
        return Err(SurfaceError::BadOption { name: "min_island", value: min_island, what: "it must be a share from 0 to below 1" });
    }
    let (mut cut, mut densities) = cut(mesh, density, threshold);
    let islands = drop_islands(&mut cut, min_island);
    let numbers = used(cut.vertices.len(), &cut.faces);
    keep(&mut cut.vertices, &numbers);
    keep(&mut densities, &numbers);
    if !cut.colours.is_empty() {
        keep(&mut cut.colours, &numbers);
    }
    cut.faces.iter_mut().for_each(|f| *f = f.map(|v| numbers[v as usize]));
    let (area_before, area_after) = (area(mesh, &mesh.faces), area(&cut, &cut.faces));
    let share = if area_before > 0.0 { 1.0 - area_after / area_before } else { 0.0 };
    Ok((cut, densities, TrimSummary { threshold, area_before, area_after, share, islands }))
}

fn area(mesh: &Mesh, faces: &[[u32; 3]]) -> f64 {
    faces.iter().map(|f| face_area(mesh, f)).sum()
}

fn face_area(mesh: &Mesh, face: &[u32; 3]) -> f64 {
    let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
    (b - a).cross(&(c - a)).norm() / 2.0
}

fn cut(mesh: &Mesh, density: &[f32], threshold: f64) -> (Mesh, Vec<f32>) {
    let dense = |v: u32| f64::from(density[v as usize]) >= threshold;
    let crossed = |a: u32, b: u32| dense(a) != dense(b);
    let sides = |f: &[u32; 3]| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])];
    let mut edges: Vec<(u32, u32)> =
        mesh.faces.iter().flat_map(sides).filter(|&(a, b)| crossed(a, b)).map(|(a, b)| (a.min(b), a.max(b))).collect();
    edges.sort_unstable();
    edges.dedup();
    let (mut out, mut densities) = (Mesh { faces: Vec::new(), ..mesh.clone() }, density.to_vec());
    for &(a, b) in &edges {
        let (da, db) = (f64::from(density[a as usize]), f64::from(density[b as usize]));
        let t = (threshold - da) / (db - da);
        let (pa, pb) = (mesh.vertices[a as usize], mesh.vertices[b as usize]);
        out.vertices.push(pa + (pb - pa) * t);
        densities.push(threshold as f32);
        if !mesh.colours.is_empty() {
            let (ca, cb) = (mesh.colours[a as usize], mesh.colours[b as usize]);
            out.colours.push(std::array::from_fn(|k| (f64::from(ca[k]) * (1.0 - t) + f64::from(cb[k]) * t).round() as u8));
        }
    }
    let count = mesh.vertices.len();
    let middle = |a: u32, b: u32| (count + edges.partition_point(|&e| e < (a.min(b), a.max(b)))) as u32;
    for face in &mesh.faces {
        // Turned so that the corner that differs from the two others comes first.
        let kept = face.map(dense);
        let odd = (0..3).find(|&i| kept[i] != kept[(i + 1) % 3] && kept[i] != kept[(i + 2) % 3]);
        match odd {
            None if kept[0] => out.faces.push(*face),
            None => {}
            Some(i) => {
                let [a, b, c] = [0, 1, 2].map(|k| face[(i + k) % 3]);
                let (ab, ca) = (middle(a, b), middle(c, a));
                if kept[i] {
                    out.faces.push([a, ab, ca]);
                } else {
                    out.faces.extend([[ab, b, c], [ab, c, ca]]);
                }
            }
        }
    }
    (out, densities)
}

/// Removes the faces of small pieces; returns how many pieces those were.
fn drop_islands(mesh: &mut Mesh, min_share: f64) -> usize {
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| root(&mut parent, v));
        // The smallest number leads, whatever the order.
        let lead = a.min(b).min(c);
        for other in [a, b, c] {
            parent[other as usize] = lead;
        }
    }
    let mut areas = vec![0.0; mesh.vertices.len()];
    for face in &mesh.faces {
        areas[root(&mut parent, face[0]) as usize] += face_area(mesh, face);
    }
    let limit = min_share * areas.iter().sum::<f64>();
    let islands = areas.iter().filter(|&&a| a > 0.0 && a < limit).count();
    mesh.faces.retain(|face| areas[root(&mut parent, face[0]) as usize] >= limit);
    islands
}

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}
