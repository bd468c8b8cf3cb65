//! The surface of a solid as triangles: surface nets (Gibson, *Constrained elastic surface nets*, MICCAI 1998), one vertex in every
//! cell that the surface passes, then pulled onto it.

use super::solid::Solid;
use nalgebra::Vector3;
use rayon::prelude::*;
use scene::Mesh;
use std::collections::HashMap;

/// Cells along the side of a block.
const BLOCK: i32 = 8;
/// Samples along the side of a block.
const SIDE: usize = BLOCK as usize + 1;
/// Steps by which a vertex is pulled onto the surface.
const PULLS: usize = 3;

type Cell = [i32; 3];

/// Meshes what lies between two corners. The same mesh on any number of threads; closed where the solid ends within the corners. With
/// its normals.
pub(super) fn mesh(solid: &Solid, low: Vector3<f64>, high: Vector3<f64>, cell_m: f64) -> (Mesh, Vec<Vector3<f32>>) {
    let block_m = cell_m * f64::from(BLOCK);
    let counts: [i32; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / block_m).ceil() as i32 + 1);
    let all: Vec<Cell> = (0..counts[2]).flat_map(|z| (0..counts[1]).flat_map(move |y| (0..counts[0]).map(move |x| [x, y, z]))).collect();
    let grid = Grid { low, cell_m };
    // Half the diagonal of a block and its margin, what the growth adds, and shapes whose distance is too small by up to a third.
    let reach = 0.5 * 3f64.sqrt() * (block_m + 2.0 * cell_m);
    let blocks: Vec<Block> = all
        .into_par_iter()
        .filter_map(|block| {
            let first = block.map(|b| b * BLOCK);
            let centre = grid.point(&first.map(|c| c + BLOCK / 2));
            let distance = solid.distance(&centre);
            (distance.abs() <= reach + solid.growth_m).then(|| Block::new(&solid.near(&centre, reach), &grid, first))
        })
        .collect();
    let mut mesh = Mesh::default();
    let mut normals = Vec::new();
    let mut index = HashMap::new();
    for block in &blocks {
        for (cell, vertex, normal) in &block.vertices {
            index.insert(*cell, mesh.vertices.len() as u32);
            mesh.vertices.push((*vertex).into());
            normals.push(normal.cast());
        }
    }
    for quad in blocks.iter().flat_map(|b| &b.quads) {
        // A quad at the border of the grid may lack a cell.
        let corners = quad.map(|cell| index.get(&cell).copied());
        if let [Some(a), Some(b), Some(c), Some(d)] = corners {
            mesh.faces.push([a, b, c]);
            mesh.faces.push([a, c, d]);
        }
    }
    (mesh, normals)
}

struct Grid {
    low: Vector3<f64>,
    cell_m: f64,
}

impl Grid {
    fn point(&self, corner: &Cell) -> Vector3<f64> {
        self.low + Vector3::from(corner.map(f64::from)) * self.cell_m
    }
}

struct Block {
    vertices: Vec<(Cell, Vector3<f64>, Vector3<f64>)>,
    quads: Vec<[Cell; 4]>,
}

impl Block {
    fn new(solid: &Solid, grid: &Grid, first: Cell) -> Self {
        let at = |x: usize, y: usize, z: usize| (z * SIDE + y) * SIDE + x;
        let corner = |x: usize, y: usize, z: usize| [first[0] + x as i32, first[1] + y as i32, first[2] + z as i32];
        let mut values = vec![0.0; SIDE * SIDE * SIDE];
        for z in 0..SIDE {
            for y in 0..SIDE {
                for x in 0..SIDE {
                    values[at(x, y, z)] = solid.distance(&grid.point(&corner(x, y, z)));
                }
            }
        }
        let mut out = Self { vertices: Vec::new(), quads: Vec::new() };
        for z in 0..SIDE - 1 {
            for y in 0..SIDE - 1 {
                for x in 0..SIDE - 1 {
                    let cell = corner(x, y, z);
                    let value = |i: usize, j: usize, k: usize| values[at(x + i, y + j, z + k)];
                    out.vertex(solid, grid, cell, &value);
                    let here = value(0, 0, 0);
                    for (axis, next) in [value(1, 0, 0), value(0, 1, 0), value(0, 0, 1)].into_iter().enumerate() {
                        if (here < 0.0) != (next < 0.0) {
                            out.quads.push(quad(cell, axis, here < 0.0));
                        }
                    }
                }
            }
        }
        out
    }

    /// The vertex of a cell: the mean of where its edges pass the surface, pulled onto it.
    fn vertex(&mut self, solid: &Solid, grid: &Grid, cell: Cell, value: &impl Fn(usize, usize, usize) -> f64) {
        let corners: [f64; 8] = std::array::from_fn(|i| value(i & 1, i >> 1 & 1, i >> 2));
        let inside = corners.iter().filter(|v| **v < 0.0).count();
        if inside == 0 || inside == 8 {
            return;
        }
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for axis in 0..3 {
            for a in (0..8usize).filter(|a| a >> axis & 1 == 0) {
                let (va, vb) = (corners[a], corners[a | 1 << axis]);
                if (va < 0.0) != (vb < 0.0) {
                    let mut place = Vector3::new((a & 1) as f64, (a >> 1 & 1) as f64, (a >> 2) as f64);
                    place[axis] = va / (va - vb);
                    sum += place;
                    count += 1.0;
                }
            }
        }
        let middle = grid.point(&cell) + sum / count * grid.cell_m;
        let step = 0.25 * grid.cell_m;
        let mut vertex = middle;
        for _ in 0..PULLS {
            let moved = vertex - solid.normal(&vertex, step) * solid.distance(&vertex);
            // Not out of the cell's neighbourhood: thin walls would change sides.
            if (moved - middle).norm() > 0.7 * grid.cell_m {
                break;
            }
            vertex = moved;
        }
        self.vertices.push((cell, vertex, solid.normal(&vertex, 0.5 * grid.cell_m)));
    }
}

/// The four cells about the edge that leaves a cell's first corner along an axis, counter-clockwise seen from outside.
fn quad(cell: Cell, axis: usize, leaves: bool) -> [Cell; 4] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let back = |a: i32, b: i32| {
        let mut c = cell;
        c[u] -= a;
        c[v] -= b;
        c
    };
    let round = [back(1, 1), back(0, 1), back(0, 0), back(1, 0)];
    if leaves { round } else { [round[0], round[3], round[2], round[1]] }
}
