//! The right side: the spread normals against the gradients of the tents.

use super::kernel::smoothed;
use super::level::Level;
use super::samples::{Sample, Samples, cell_of};
use crate::lattice::{EDGE, NODES};
use rayon::prelude::*;
use std::ops::Range;

/// The samples by the level that they are taken to.
pub(super) struct ByDepth {
    /// For each level the samples taken to it, in order.
    lists: Vec<Vec<u32>>,
}

impl ByDepth {
    pub(super) fn new(samples: &Samples) -> Self {
        let mut lists = vec![Vec::new(); samples.depth as usize + 1];
        for (i, sample) in samples.all.iter().enumerate() {
            lists[usize::from(sample.depth)].push(i as u32);
        }
        Self { lists }
    }

    fn is_empty(&self, depth: u32) -> bool {
        self.lists[depth as usize].is_empty()
    }

    /// Those taken to `depth` in a range of all samples.
    fn within(&self, depth: u32, range: Range<usize>) -> &[u32] {
        let list = &self.lists[depth as usize];
        let start = list.partition_point(|&i| (i as usize) < range.start);
        let end = start + list[start..].partition_point(|&i| (i as usize) < range.end);
        &list[start..end]
    }
}

/// Box of nodes: first node and number along each axis.
pub(super) struct Nodes {
    pub(super) first: [i64; 3],
    pub(super) size: [usize; 3],
}

/// Adds the samples taken to level `of` to the right side of the nodes of level `level`, which is not coarser.
fn add(samples: &Samples, by_depth: &ByDepth, level: u32, of: u32, nodes: &Nodes, out: &mut [f32]) {
    // Samples within a cell and a half of their level and one of ours reach a node: bricks of their level that hold those cells.
    let (shift, width) = (level - of, f64::from(3u32 << (level - of)));
    let limit = (1i64 << of) - 1;
    let low = nodes.first.map(|v| ((v >> shift) - 3).clamp(0, limit) >> 3);
    let high: [i64; 3] = std::array::from_fn(|a| (((nodes.first[a] + nodes.size[a] as i64) >> shift) + 3).clamp(0, limit) >> 3);
    for bz in low[2]..=high[2] {
        for by in low[1]..=high[1] {
            for bx in low[0]..=high[0] {
                // A brick has 8 cells along its edge; of levels with fewer cells it is the whole cube.
                let brick = [bx as u32, by as u32, bz as u32];
                let range = if of >= 3 { samples.within(brick, of, 3) } else { 0..samples.all.len() };
                for &i in by_depth.within(of, range) {
                    spread(&samples.all[i as usize], level, width, nodes, out);
                }
            }
        }
    }
}

/// Adds one sample.
fn spread(sample: &Sample, level: u32, width: f64, nodes: &Nodes, out: &mut [f32]) {
    let cells = f64::from(1u32 << level);
    let reach = width / 2.0 + 1.0;
    let at: [f64; 3] = std::array::from_fn(|a| sample.position[a] * cells - nodes.first[a] as f64);
    let span = |axis: usize| {
        let first = (at[axis] - reach).floor().max(-1.0) as i64 + 1;
        first.max(0) as usize..((at[axis] + reach).ceil().max(0.0) as usize).min(nodes.size[axis])
    };
    let spans = [span(0), span(1), span(2)];
    if spans.iter().any(Range::is_empty) {
        return;
    }
    // Area in units of the cube times cells: psi' has a cell's edge below it.
    let scale = f64::from(sample.area) * cells;
    let normal = sample.normal.map(|v| f64::from(v) * scale);
    let along = |axis: usize, i: usize| smoothed(at[axis] - i as f64, width);
    // The spans are short but for the widest kernels.
    let mut xs = [[0.0; 2]; 6];
    let few = spans[0].len() <= xs.len();
    if few {
        for (x, i) in xs.iter_mut().zip(spans[0].clone()) {
            *x = along(0, i);
        }
    }
    for z in spans[2].clone() {
        let [pz, dz] = along(2, z);
        for y in spans[1].clone() {
            let [py, dy] = along(1, y);
            let (slope, value) = (normal[0] * py * pz, normal[1] * dy * pz + normal[2] * py * dz);
            let row = &mut out[(z * nodes.size[1] + y) * nodes.size[0]..][spans[0].clone()];
            for (k, node) in row.iter_mut().enumerate() {
                let [px, dx] = if few { xs[k] } else { along(0, spans[0].start + k) };
                *node += (slope * dx + value * px) as f32;
            }
        }
    }
}

/// The right side of a level from the samples taken to it, and from coarser ones.
pub(super) fn of_level(samples: &Samples, by_depth: &ByDepth, level: &Level, coarsest: u32) -> (Vec<f32>, Vec<f32>) {
    let fill = |depths: Range<u32>| {
        let depths: Vec<u32> = depths.filter(|&d| !by_depth.is_empty(d)).collect();
        let mut out = vec![0.0; level.bricks.len() * NODES];
        out.par_chunks_mut(NODES).enumerate().for_each(|(brick, out)| {
            let first = level.bricks.at(brick).map(|v| i64::from(v) * EDGE as i64);
            let nodes = Nodes { first, size: [EDGE; 3] };
            for &of in &depths {
                add(samples, by_depth, level.depth, of, &nodes, out);
            }
        });
        out
    };
    (fill(level.depth..level.depth + 1), fill(coarsest..level.depth))
}

/// The right side of the coarsest level, dense, from the samples taken to it.
pub(super) fn of_base(samples: &Samples, by_depth: &ByDepth, depth: u32) -> Vec<f32> {
    let n = (1usize << depth) + 1;
    let mut out = vec![0.0; n * n * n];
    for &i in &by_depth.lists[depth as usize] {
        spread(&samples.all[i as usize], depth, 3.0, &Nodes { first: [0; 3], size: [n; 3] }, &mut out);
    }
    debug_assert!(samples.all.iter().all(|s| cell_of(&s.position, depth).iter().all(|&c| c > 0 || n < 6)));
    out
}
