//! The surface where the indicator has one value.

use super::cubes::{EDGES, TRIANGLES, edge};
use super::density::around;
use super::level::Level;
use super::transfer::prolong;
use crate::lattice::{Bricks, EDGE, HALO, NODES, NONE, halo_index, load_halo};
use rayon::prelude::*;

/// A level with its solved corrections.
pub(super) struct Solved {
    pub(super) level: Level,
    /// On the nodes of its bricks.
    pub(super) correction: Vec<f32>,
}

/// The surface in the unit cube.
pub(super) struct Surface {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) faces: Vec<[u32; 3]>,
}

/// The indicator on all finest cells that the surface goes through. The sum of the levels is one continuous function; where it ends on a coarse
/// level it is evaluated on the finest all the same, so that no cracks open between levels.
pub(super) fn finest(base: (Bricks, Vec<f32>), levels: &[Solved], iso: f32) -> (Bricks, Vec<f32>) {
    let (mut bricks, mut values) = base;
    for solved in levels {
        let mut codes = crossed(&bricks, &values, iso);
        codes.extend(&solved.level.bricks.codes);
        let finer = Bricks::new(codes);
        let mut next = prolong(&bricks, &values, &finer);
        next.par_chunks_mut(NODES).zip(&finer.codes).for_each(|(next, code)| {
            if let Ok(brick) = solved.level.bricks.codes.binary_search(code) {
                next.iter_mut().zip(&solved.correction[brick * NODES..]).for_each(|(v, c)| *v += c);
            }
        });
        (bricks, values) = (finer, next);
    }
    (bricks, values)
}

type Halo = [f32; HALO * HALO * HALO];

/// Places in a halo buffer of the corners of a cell.
fn corners(halo: &Halo, cell: usize) -> [f32; 8] {
    let [x, y, z] = [cell % EDGE, cell / EDGE % EDGE, cell / (EDGE * EDGE)].map(|v| v as isize);
    std::array::from_fn(|k| halo[halo_index(x + (k & 1) as isize, y + (k >> 1 & 1) as isize, z + (k >> 2) as isize)])
}

/// Which corners lie inside, bit by bit; `None` where the surface does not pass or a corner has no value.
fn pattern(values: &[f32; 8], iso: f32) -> Option<usize> {
    if values.iter().any(|v| v.is_nan()) {
        return None;
    }
    let inside = values.iter().enumerate().map(|(k, v)| usize::from(*v < iso) << k).sum::<usize>();
    (inside != 0 && inside != 255).then_some(inside)
}

/// Bricks of the next level under the cells that the surface passes.
fn crossed(bricks: &Bricks, values: &[f32], iso: f32) -> Vec<u64> {
    (0..bricks.len())
        .into_par_iter()
        .flat_map_iter(|brick| {
            let mut halo = [0.0; HALO * HALO * HALO];
            load_halo(values, &bricks.near[brick], f32::NAN, &mut halo);
            let first = bricks.at(brick);
            let mut codes = Vec::new();
            for cell in 0..NODES {
                if pattern(&corners(&halo, cell), iso).is_some() {
                    let local = [cell % EDGE, cell / EDGE % EDGE, cell / (EDGE * EDGE)];
                    let fine: [u32; 3] = std::array::from_fn(|a| 2 * (first[a] * EDGE as u32 + local[a] as u32));
                    codes.extend(around(fine, 0, 2));
                }
            }
            codes.sort_unstable();
            codes.dedup();
            codes
        })
        .collect()
}

/// Marching cubes over all cells whose corners have values.
pub(super) fn march(bricks: &Bricks, values: &[f32], iso: f32, depth: u32) -> Surface {
    let size = 1.0 / f64::from(1u32 << depth);
    // One vertex on each crossed edge, kept with the node at its start.
    let found: Vec<(Vec<[f64; 3]>, Vec<u32>)> = (0..bricks.len())
        .into_par_iter()
        .map(|brick| {
            let mut halo = [0.0; HALO * HALO * HALO];
            load_halo(values, &bricks.near[brick], f32::NAN, &mut halo);
            let first = bricks.at(brick);
            let (mut vertices, mut numbers) = (Vec::new(), vec![NONE; 3 * NODES]);
            for node in 0..NODES {
                let local = [node % EDGE, node / EDGE % EDGE, node / (EDGE * EDGE)];
                let at = halo_index(local[0] as isize, local[1] as isize, local[2] as isize);
                let a = halo[at];
                for axis in 0..3 {
                    let b = halo[at + HALO.pow(axis as u32)];
                    if a.is_nan() || b.is_nan() || (a < iso) == (b < iso) {
                        continue;
                    }
                    // A vertex in a node would make triangles without area.
                    let t = (f64::from(iso - a) / f64::from(b - a)).clamp(1e-4, 1.0 - 1e-4);
                    numbers[3 * node + axis] = vertices.len() as u32;
                    vertices.push(std::array::from_fn(|k| {
                        (f64::from(first[k] * EDGE as u32) + local[k] as f64 + if k == axis { t } else { 0.0 }) * size
                    }));
                }
            }
            (vertices, numbers)
        })
        .collect();
    let mut starts = vec![0u32];
    for (vertices, _) in &found {
        starts.push(starts[starts.len() - 1] + vertices.len() as u32);
    }
    let number = |brick: usize, node: usize, axis: usize| starts[brick] + found[brick].1[3 * node + axis];
    let faces: Vec<[u32; 3]> = (0..bricks.len())
        .into_par_iter()
        .flat_map_iter(|brick| {
            let mut halo = [0.0; HALO * HALO * HALO];
            load_halo(values, &bricks.near[brick], f32::NAN, &mut halo);
            let mut faces = Vec::new();
            for cell in 0..NODES {
                let Some(inside) = pattern(&corners(&halo, cell), iso) else { continue };
                let local = [cell % EDGE, cell / EDGE % EDGE, cell / (EDGE * EDGE)];
                let vertices: [u32; EDGES] = std::array::from_fn(|e| {
                    let (corner, axis) = edge(e);
                    if (inside >> corner ^ inside >> (corner | 1 << axis)) & 1 == 0 {
                        return NONE;
                    }
                    let at: [usize; 3] = std::array::from_fn(|a| local[a] + (corner >> a & 1));
                    let near = 13 + at[0] / EDGE + 3 * (at[1] / EDGE) + 9 * (at[2] / EDGE);
                    let node = ((at[2] % EDGE) * EDGE + at[1] % EDGE) * EDGE + at[0] % EDGE;
                    number(bricks.near[brick][near] as usize, node, axis)
                });
                faces.extend(TRIANGLES[inside].iter().map(|t| t.map(|e| vertices[usize::from(e)])));
            }
            faces
        })
        .collect();
    Surface { vertices: found.into_iter().flat_map(|(vertices, _)| vertices).collect(), faces }
}
