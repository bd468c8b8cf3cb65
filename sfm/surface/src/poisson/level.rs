//! The nodes of one level that carry unknowns.

use super::density::around;
use super::samples::Samples;
use crate::lattice::{Bricks, EDGE, NONE, decode};
use rayon::prelude::*;

/// Samples a piece of parallel work.
const PIECE: usize = 1 << 14;

/// The unknowns of one level: tents on the 6 x 6 x 6 nodes around each cell that holds a sample taken to this level.
///
/// That is where the divergence of the samples' normals is not 0. The bricks hold one more node on every side, so that every cell under
/// a tent has its corners; the parents of all these nodes carry unknowns of the level above.
pub(super) struct Level {
    pub(super) depth: u32,
    pub(super) bricks: Bricks,
    /// A bit for each node with an unknown: 64 for each of the eight slices of a brick.
    pub(super) unknown: Vec<[u64; EDGE]>,
}

impl Level {
    pub(super) fn new(samples: &Samples, depth: u32) -> Self {
        let pieces: Vec<usize> = (0..samples.all.len()).step_by(PIECE).collect();
        let occupied: Vec<(Vec<u64>, Vec<u64>)> = pieces
            .par_iter()
            .map(|&start| {
                let cells = samples.cells(start..(start + PIECE).min(samples.all.len()), depth);
                let taken = cells.filter(|(_, run)| samples.all[run.clone()].iter().any(|s| u32::from(s.depth) >= depth));
                let cells: Vec<u64> = taken.map(|(code, _)| code).collect();
                let mut bricks: Vec<u64> = cells.iter().flat_map(|&code| around(decode(code), 3, 4)).collect();
                bricks.sort_unstable();
                bricks.dedup();
                (cells, bricks)
            })
            .collect();
        let bricks = Bricks::new(occupied.iter().flat_map(|(_, bricks)| bricks.iter().copied()).collect());
        // Ascending; a cell at the border of two pieces may come twice.
        let cells: Vec<u64> = occupied.into_iter().flat_map(|(cells, _)| cells).collect();
        let unknown = (0..bricks.len()).into_par_iter().map(|brick| unknowns(&bricks, brick, &cells)).collect();
        Self { depth, bricks, unknown }
    }

    /// Number of unknowns.
    pub(super) fn count(&self) -> usize {
        self.unknown.iter().flatten().map(|bits| bits.count_ones() as usize).sum()
    }
}

/// Marks the nodes -2 to 3 from every occupied cell.
fn unknowns(bricks: &Bricks, brick: usize, cells: &[u64]) -> [u64; EDGE] {
    let first = bricks.at(brick).map(|v| i64::from(v) * EDGE as i64);
    let mut bits = [0u64; EDGE];
    for neighbour in bricks.near[brick] {
        if neighbour == NONE {
            continue;
        }
        let code = bricks.codes[neighbour as usize];
        let start = cells.partition_point(|&c| c >> 9 < code);
        for &cell in cells[start..].iter().take_while(|&&c| c >> 9 == code) {
            let cell = decode(cell);
            let span = |axis: usize| {
                let at = i64::from(cell[axis]) - first[axis];
                (at - 2).max(0)..(at + 4).min(EDGE as i64)
            };
            let (xs, ys) = (span(0), span(1));
            if xs.is_empty() {
                continue;
            }
            let row = ((1u64 << (xs.end - xs.start)) - 1) << xs.start;
            for z in span(2) {
                for y in ys.clone() {
                    bits[z as usize] |= row << (8 * y);
                }
            }
        }
    }
    bits
}
