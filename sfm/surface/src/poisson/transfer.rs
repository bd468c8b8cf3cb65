//! Values from a coarse level to a fine one, and sums back: tents of a level are sums of tents of the next.

use super::level::Level;
use crate::lattice::{Bricks, EDGE, NODES, decode};
use rayon::prelude::*;

/// Nodes along the edge of the coarse box under a fine brick.
const SIDE: usize = 5;

/// The 5 x 5 x 5 nodes from `first`, a multiple of 4; NaN where there is none.
fn gather(bricks: &Bricks, values: &[f32], first: [usize; 3]) -> [f32; SIDE * SIDE * SIDE] {
    // The box starts in the first or the fifth node of a brick: only its last node may lie in the next.
    let home = first.map(|v| (v / EDGE) as u32);
    let next: [Option<usize>; 8] = std::array::from_fn(|k| {
        let step = [k & 1, k >> 1 & 1, k >> 2];
        let needed = (0..3).all(|a| step[a] == 0 || first[a] % EDGE == EDGE / 2);
        needed.then(|| bricks.find(std::array::from_fn(|a| home[a] + step[a] as u32))).flatten()
    });
    std::array::from_fn(|k| {
        let c = [k % SIDE, k / SIDE % SIDE, k / (SIDE * SIDE)];
        let at: [usize; 3] = std::array::from_fn(|a| first[a] % EDGE + c[a]);
        let which = at[0] / EDGE + 2 * (at[1] / EDGE) + 4 * (at[2] / EDGE);
        next[which].map_or(f32::NAN, |brick| values[brick * NODES + ((at[2] % EDGE) * EDGE + at[1] % EDGE) * EDGE + at[0] % EDGE])
    })
}

/// The values of a level on the nodes of bricks of the next; NaN where a parent has none.
pub(super) fn prolong(coarse: &Bricks, values: &[f32], fine: &Bricks) -> Vec<f32> {
    let mut out = vec![0.0; fine.len() * NODES];
    out.par_chunks_mut(NODES).enumerate().for_each(|(brick, out)| {
        let parents = gather(coarse, values, decode(fine.codes[brick]).map(|v| v as usize * EDGE / 2));
        for (k, out) in out.iter_mut().enumerate() {
            let c = [k % EDGE, k / EDGE % EDGE, k / (EDGE * EDGE)];
            let low = (c[2] / 2 * SIDE + c[1] / 2) * SIDE + c[0] / 2;
            let (dx, dy, dz) = (c[0] % 2, (c[1] % 2) * SIDE, (c[2] % 2) * SIDE * SIDE);
            // Half way along an axis the step is not 0, else both ends are the same node.
            let line = |at: usize| 0.5 * (parents[at] + parents[at + dx]);
            let plane = |at: usize| 0.5 * (line(at) + line(at + dy));
            *out = 0.5 * (plane(low) + plane(low + dz));
        }
    });
    out
}

/// Nodes along the edge of the fine box under a coarse brick.
const BOX: usize = 2 * EDGE + 1;

/// Sums of a fine level on a box of coarse nodes that starts at `first` (a multiple of 8) with 8 nodes along each axis.
fn restrict_box(fine: &Level, values: &[f32], first: [usize; 3], buffer: &mut Vec<f32>) -> Option<[f32; NODES]> {
    buffer.clear();
    buffer.resize(BOX * BOX * BOX, 0.0);
    let mut any = false;
    // Fine nodes 2 first - 1 to 2 first + 15.
    for k in 0..27 {
        let step = [k % 3, k / 3 % 3, k / 9];
        let c: [i64; 3] = std::array::from_fn(|a| (first[a] / EDGE * 2 + step[a]) as i64 - 1);
        if c.iter().any(|&v| v < 0) {
            continue;
        }
        let Some(brick) = fine.bricks.find(c.map(|v| v as u32)) else { continue };
        any = true;
        let offset = c.iter().zip(first).map(|(&c, f)| c * EDGE as i64 - (2 * f as i64 - 1)).collect::<Vec<_>>();
        for z in 0..EDGE {
            for y in 0..EDGE {
                for x in 0..EDGE {
                    let at = [x as i64 + offset[0], y as i64 + offset[1], z as i64 + offset[2]];
                    if at.iter().all(|v| (0..BOX as i64).contains(v)) {
                        buffer[((at[2] as usize) * BOX + at[1] as usize) * BOX + at[0] as usize] =
                            values[brick * NODES + (z * EDGE + y) * EDGE + x];
                    }
                }
            }
        }
    }
    any.then(|| {
        std::array::from_fn(|k| {
            let c = [k % EDGE, k / EDGE % EDGE, k / (EDGE * EDGE)];
            let at = (2 * c[2] * BOX + 2 * c[1]) * BOX + 2 * c[0];
            let line = |at: usize| 0.5 * buffer[at] + buffer[at + 1] + 0.5 * buffer[at + 2];
            let plane = |at: usize| 0.5 * line(at) + line(at + BOX) + 0.5 * line(at + 2 * BOX);
            0.5 * plane(at) + plane(at + BOX * BOX) + 0.5 * plane(at + 2 * BOX * BOX)
        })
    })
}

/// Adds the sums of a fine level to the next coarser one.
pub(super) fn restrict(fine: &Level, values: &[f32], coarse: &Bricks, out: &mut [f32]) {
    out.par_chunks_mut(NODES).enumerate().for_each_init(Vec::new, |buffer, (brick, out)| {
        let first = coarse.at(brick).map(|v| v as usize * EDGE);
        if let Some(sums) = restrict_box(fine, values, first, buffer) {
            out.iter_mut().zip(sums).for_each(|(out, sum)| *out += sum);
        }
    });
}

/// The same where the coarser level is dense.
pub(super) fn restrict_to_dense(fine: &Level, values: &[f32], n: usize, out: &mut [f32]) {
    let mut buffer = Vec::new();
    let bricks = n.div_ceil(EDGE);
    for k in 0..bricks * bricks * bricks {
        let first = [k % bricks, k / bricks % bricks, k / (bricks * bricks)].map(|v| v * EDGE);
        let Some(sums) = restrict_box(fine, values, first, &mut buffer) else { continue };
        for (k, sum) in sums.iter().enumerate() {
            let c = [first[0] + k % EDGE, first[1] + k / EDGE % EDGE, first[2] + k / (EDGE * EDGE)];
            if c.iter().all(|&v| v < n) {
                out[(c[2] * n + c[1]) * n + c[0]] += sum;
            }
        }
    }
}
