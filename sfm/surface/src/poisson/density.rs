//! How densely the surface is sampled, and attributes carried by the same kernel.

use super::samples::{Sample, Samples, cell_of};
use crate::lattice::{Bricks, Coordinates, EDGE, NODES, NONE, encode};
use rayon::prelude::*;

/// Levels that the density lies above the finest: a cell there has enough points to count.
const KERNEL_LEVELS: u32 = 2;
/// What the kernel sums on a plane through points of density one a cell: the mean over all offsets of the sum of squares of a quadratic
/// B-spline at integer steps, which is its autocorrelation at 0.
const ON_A_PLANE: f64 = 11.0 / 20.0;

/// Sums of `C` channels on the centres of cells, spread and read by quadratic B-splines (27 cells).
pub(super) struct Splat<const C: usize> {
    bricks: Bricks,
    values: Vec<[f32; C]>,
    level: u32,
}

/// Quadratic B-spline at the three cells around a point that lies `f` behind the first edge of the middle one.
fn weights(f: f32) -> [f32; 3] {
    let t = f - 0.5;
    [0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)]
}

/// The weights along the three axes.
fn all_weights(position: &[f64; 3], cell: Coordinates, level: u32) -> [[f32; 3]; 3] {
    let cells = f64::from(1u32 << level);
    std::array::from_fn(|axis| weights((position[axis] * cells - f64::from(cell[axis])) as f32))
}

impl<const C: usize> Splat<C> {
    pub(super) fn new(samples: &Samples, level: u32, value: impl Fn(&Sample) -> [f32; C] + Sync) -> Self {
        let pieces: Vec<usize> = (0..samples.all.len()).step_by(1 << 14).collect();
        let codes: Vec<u64> = pieces
            .par_iter()
            .flat_map_iter(|&start| {
                let mut codes: Vec<u64> = samples
                    .cells(start..(start + (1 << 14)).min(samples.all.len()), level)
                    .flat_map(|(code, _)| around(crate::lattice::decode(code), 1, 1))
                    .collect();
                codes.sort_unstable();
                codes.dedup();
                codes
            })
            .collect();
        let bricks = Bricks::new(codes);
        let mut values = vec![[0.0; C]; bricks.len() * NODES];
        values.par_chunks_mut(NODES).enumerate().for_each(|(brick, out)| {
            let first = bricks.at(brick).map(|v| v as i64 * EDGE as i64);
            for neighbour in bricks.near[brick] {
                if neighbour == NONE {
                    continue;
                }
                for sample in &samples.all[samples.within(bricks.at(neighbour as usize), level, 3)] {
                    let cell = cell_of(&sample.position, level);
                    let near: [i64; 3] = std::array::from_fn(|a| i64::from(cell[a]) - first[a]);
                    if near.iter().any(|v| !(-1..=8).contains(v)) {
                        continue;
                    }
                    let [wx, wy, wz] = all_weights(&sample.position, cell, level);
                    let value = value(sample);
                    for (z, wz) in (near[2] - 1..).zip(wz).filter(|(z, _)| (0..8).contains(z)) {
                        for (y, wy) in (near[1] - 1..).zip(wy).filter(|(y, _)| (0..8).contains(y)) {
                            for (x, wx) in (near[0] - 1..).zip(wx).filter(|(x, _)| (0..8).contains(x)) {
                                let node = &mut out[((z * 8 + y) * 8 + x) as usize];
                                for c in 0..C {
                                    node[c] += wx * wy * wz * value[c];
                                }
                            }
                        }
                    }
                }
            }
        });
        Self { bricks, values, level }
    }

    /// The sums at a position of the unit cube. `last` is the brick that was used last, for speed alone.
    pub(super) fn at(&self, position: &[f64; 3], last: &mut Option<usize>) -> [f32; C] {
        let cell = cell_of(position, self.level);
        let home = cell.map(|v| v >> 3);
        let code = encode(home);
        let mut sum = [0.0; C];
        if last.is_none_or(|b| self.bricks.codes[b] != code) {
            *last = self.bricks.find(home);
        }
        let Some(brick) = *last else { return sum };
        let near = &self.bricks.near[brick];
        let [wx, wy, wz] = all_weights(position, cell, self.level);
        // Of -1..=8: the brick along an axis, and the node in it.
        let split = |cell: u32, step: usize| {
            let at = (cell & 7) as usize + step + 7;
            (at / 8, at % 8)
        };
        for (k, wz) in wz.iter().enumerate() {
            let (bz, z) = split(cell[2], k);
            for (j, wy) in wy.iter().enumerate() {
                let (by, y) = split(cell[1], j);
                for (i, wx) in wx.iter().enumerate() {
                    let (bx, x) = split(cell[0], i);
                    let brick = near[bz * 9 + by * 3 + bx];
                    if brick != NONE {
                        let value = &self.values[brick as usize * NODES + (z * 8 + y) * 8 + x];
                        for c in 0..C {
                            sum[c] += wx * wy * wz * value[c];
                        }
                    }
                }
            }
        }
        sum
    }
}

/// Codes of the bricks that hold the nodes from `below` before a cell to `above` behind it.
pub(super) fn around(cell: Coordinates, below: u32, above: u32) -> impl Iterator<Item = u64> {
    let low = cell.map(|v| v.saturating_sub(below) >> 3);
    let high = cell.map(|v| (v + above) >> 3);
    let span = move |axis: usize| low[axis]..=high[axis];
    span(2).flat_map(move |z| span(1).flat_map(move |y| span(0).map(move |x| encode([x, y, z]))))
}

/// Density of the points, for later use at any position.
pub(super) struct Density {
    splat: Splat<2>,
    /// Cells a unit of length.
    cells: f64,
}

impl Density {
    /// Measures the density and gives each sample its area and its depth: the finest level at which a cell holds `per_cell` points.
    pub(super) fn new(samples: &mut Samples, per_cell: f64) -> Self {
        let finest = samples.depth;
        let lowest = super::base::DEPTH.min(finest);
        let mut level = finest.saturating_sub(KERNEL_LEVELS).max(2);
        let channels = |s: &Sample| [1.0, s.confidence];
        let first = Splat::new(samples, level, channels);
        let mut open = place(samples, &first, per_cell, lowest, level <= lowest);
        while open > 0 && level > lowest {
            level -= 1;
            let coarser = Splat::new(samples, level, channels);
            open = place(samples, &coarser, per_cell, lowest, level == lowest);
        }
        let level = first.level;
        Self { splat: first, cells: f64::from(1u32 << level) }
    }

    /// Points a unit of area at a position of the unit cube, edge of the cube 1.
    pub(super) fn at(&self, position: &[f64; 3], last: &mut Option<usize>) -> f64 {
        f64::from(self.splat.at(position, last)[0]) / ON_A_PLANE * self.cells * self.cells
    }
}

/// Gives area and depth to the samples that have none yet and around which there are enough; returns how many stay without.
fn place(samples: &mut Samples, splat: &Splat<2>, per_cell: f64, lowest: u32, all: bool) -> usize {
    let (finest, level) = (samples.depth, splat.level);
    let cell_area = 0.25f64.powi(level as i32);
    samples
        .all
        .par_chunks_mut(4096)
        .map(|piece| {
            let (mut last, mut open) = (None, 0);
            for sample in piece.iter_mut().filter(|s| s.area == 0.0) {
                let [count, weight] = splat.at(&sample.position, &mut last).map(|v| f64::from(v) / ON_A_PLANE);
                if count < per_cell && !all {
                    open += 1;
                    continue;
                }
                let depth = f64::from(level) + (count / per_cell).log2() / 2.0;
                sample.depth = depth.floor().clamp(f64::from(lowest), f64::from(finest)) as u8;
                // A point among too few stands for no more than its share of a cell.
                let crowd = weight * (per_cell / count).max(1.0);
                sample.area = (cell_area * f64::from(sample.confidence) / crowd) as f32;
            }
            open
        })
        .sum()
}
