//! Points that stand for a surface.

use crate::EvalError;
use crate::grid::Cells;
use nalgebra::Point3;
use rayon::prelude::*;
use scene::Mesh;

/// Most points of a lattice over a mesh: about 5 GB of sorting would follow.
const MAX_LATTICE: f64 = 2e8;
/// Steps of the lattice within one cell, along the longest edge of a triangle.
const STEPS_PER_CELL: f64 = 4.0;

/// Keys of the cells that a mesh passes through, ascending: those that hold a point of a lattice whose step is a quarter of
/// a cell. (Cells touched by less of the surface than the step may be missed; a cloud would hardly hit them either.)
pub(crate) fn raster(mesh: &Mesh, cells: Cells) -> Result<Vec<u64>, EvalError> {
    let step = cells.size() / STEPS_PER_CELL;
    let steps = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
        let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
        (longest / step).ceil().max(1.0)
    };
    let lattice: f64 = mesh.faces.iter().map(steps).map(|n| (n + 1.0) * (n + 2.0) / 2.0).sum();
    if lattice > MAX_LATTICE {
        let (min, max) = crate::hilbert::bounds(&mesh.vertices);
        return Err(EvalError::TooFine { what: "cells of the integrity", cell_m: cells.size(), extent_m: (max - min).amax() });
    }
    let mut keys: Vec<u64> = mesh
        .faces
        .par_chunks(1024)
        .flat_map_iter(|faces| {
            let mut keys = Vec::new();
            for face in faces {
                let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
                let n = steps(face) as usize;
                let (along, across) = ((b - a) / n as f64, (c - a) / n as f64);
                for i in 0..=n {
                    let row = a + across * i as f64;
                    keys.extend((0..=n - i).map(|j| cells.key(&(row + along * j as f64))));
                }
            }
            keys.sort_unstable();
            keys.dedup();
            keys
        })
        .collect();
    keys.par_sort_unstable();
    keys.dedup();
    Ok(keys)
}

/// `count` points spread evenly over the area of a mesh, the same for every call; none where it has no area.
///
/// Sample k lies at the share (k + 1/2) / count of the summed area; its place in that triangle comes from the R2 sequence
/// (M. Roberts, *The unreasonable effectiveness of quasirandom sequences*, 2018), folded into the triangle.
pub(crate) fn sample(mesh: &Mesh, count: usize) -> Vec<Point3<f64>> {
    const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];
    let total = area(mesh);
    if total.is_nan() || total <= 0.0 {
        return Vec::new();
    }
    let mut out = Vec::with_capacity(count);
    let mut before = 0.0;
    for face in &mesh.faces {
        before += triangle_area(mesh, face);
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
        while out.len() < count && (out.len() as f64 + 0.5) / count as f64 * total <= before {
            let [mut u, mut v] = R2.map(|step| (0.5 + step * (out.len() + 1) as f64).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            out.push(a + (b - a) * u + (c - a) * v);
        }
    }
    out
}

/// Area of a mesh.
pub(crate) fn area(mesh: &Mesh) -> f64 {
    mesh.faces.iter().map(|f| triangle_area(mesh, f)).sum()
}

fn triangle_area(mesh: &Mesh, face: &[u32; 3]) -> f64 {
    let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
    (b - a).cross(&(c - a)).norm() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(edge: f64) -> Mesh {
        let vertices = [[0.0, 0.0], [edge, 0.0], [edge, edge], [0.0, edge]].map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
        Mesh { vertices, faces: vec![[0, 1, 2], [0, 2, 3]], colours: vec![] }
    }

    #[test]
    fn samples_are_even() {
        let samples = sample(&square(2.0), 4000);
        assert_eq!(samples.len(), 4000);
        // 16 equal squares hold 250 samples each; random ones would scatter by 15, these by less than 5.
        for i in 0..16 {
            let (x, y) = (f64::from(i % 4) * 0.5, f64::from(i / 4) * 0.5);
            let inside = samples.iter().filter(|p| p.x >= x && p.x < x + 0.5 && p.y >= y && p.y < y + 0.5).count();
            assert!(inside.abs_diff(250) <= 5, "{inside} in square {i}");
        }
        let line = Mesh { vertices: vec![Point3::origin(); 3], faces: vec![[0, 1, 2]], colours: vec![] };
        assert!(sample(&line, 10).is_empty());
    }

    #[test]
    fn raster_of_a_square_is_a_square_of_cells() {
        let mesh = square(1.0);
        // A cell is centred on the corner: 0 to 1 covers the cells centred at 0, 0.1, ... 1.0.
        let cells = Cells::new(Point3::origin(), 0.1);
        assert_eq!(raster(&mesh, cells).expect("coarse enough").len(), 11 * 11);
        assert!(raster(&mesh, Cells::new(Point3::origin(), 1e-6)).is_err());
    }
}
