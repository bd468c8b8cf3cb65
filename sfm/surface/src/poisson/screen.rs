//! The screening term: the surface is drawn to the points.

use super::level::Level;
use super::samples::Samples;
use crate::lattice::{EDGE, HALO, encode, halo_index};
use rayon::prelude::*;

/// All samples of a cell as one: their mean position and summed area.
#[derive(Clone, Copy)]
pub(super) struct Pull {
    /// First corner of the cell in the halo of the brick.
    corner: u16,
    /// Position in the cell, 0 to 1.
    at: [f32; 3],
    /// Weight.
    weight: f32,
}

/// Steps in a halo buffer to the eight corners of a cell.
const CORNERS: [usize; 8] = [0, 1, HALO, HALO + 1, HALO * HALO, HALO * HALO + 1, HALO * HALO + HALO, HALO * HALO + HALO + 1];

/// Weights of the eight corners.
#[inline]
fn corner_weights(at: [f32; 3]) -> [f32; 8] {
    let [[a, b], [c, d], [e, f]] = at.map(|t| [1.0 - t, t]);
    [a * c * e, b * c * e, a * d * e, b * d * e, a * c * f, b * c * f, a * d * f, b * d * f]
}

impl Pull {
    /// Adds the pull on the corners of a value field: weight phi_i sum_j phi_j u_j.
    #[inline]
    pub(super) fn apply(&self, field: &[f32], out: &mut [f32]) {
        let weights = corner_weights(self.at);
        let corner = usize::from(self.corner);
        let mut value = 0.0;
        for (w, step) in weights.iter().zip(CORNERS) {
            value += w * field[corner + step];
        }
        value *= self.weight;
        for (w, step) in weights.iter().zip(CORNERS) {
            out[corner + step] += w * value;
        }
    }

    /// Adds the diagonal of the same.
    pub(super) fn diagonal(&self, out: &mut [f32]) {
        for (w, step) in corner_weights(self.at).iter().zip(CORNERS) {
            out[usize::from(self.corner) + step] += w * w * self.weight;
        }
    }
}

/// The pulls that reach the unknowns of each brick, in the cells -1 to 7 from its first node.
pub(super) struct Pulls {
    all: Vec<Pull>,
    starts: Vec<usize>,
}

impl Pulls {
    /// `weight` is that of a unit of area.
    pub(super) fn new(samples: &Samples, level: &Level, weight: f64) -> Self {
        let lists: Vec<Vec<Pull>> = (0..level.bricks.len()).into_par_iter().map(|brick| pulls_of(samples, level, brick, weight)).collect();
        let mut starts = vec![0];
        for list in &lists {
            starts.push(starts[starts.len() - 1] + list.len());
        }
        Self { all: lists.into_iter().flatten().collect(), starts }
    }

    pub(super) fn of(&self, brick: usize) -> &[Pull] {
        &self.all[self.starts[brick]..self.starts[brick + 1]]
    }
}

fn pulls_of(samples: &Samples, level: &Level, brick: usize, weight: f64) -> Vec<Pull> {
    let home = level.bricks.at(brick);
    let unknown = &level.unknown[brick];
    let mut out = Vec::new();
    if unknown.iter().all(|bits| *bits == 0) {
        return out;
    }
    for k in 0..8u32 {
        let back = [k & 1, k >> 1 & 1, k >> 2];
        let mut other = home;
        if (0..3).any(|a| other[a] < back[a]) {
            continue;
        }
        (0..3).for_each(|a| other[a] -= back[a]);
        let range = samples.within(other, level.depth, 3);
        for (code, run) in samples.cells(range, level.depth) {
            let cell = crate::lattice::decode(code);
            let local: [isize; 3] = std::array::from_fn(|a| cell[a] as isize - home[a] as isize * EDGE as isize);
            if local.iter().any(|v| *v < -1) || !touches(unknown, local) {
                continue;
            }
            let cells = f64::from(1u32 << level.depth);
            let (mut sum, mut area) = ([0.0; 3], 0.0);
            for sample in &samples.all[run] {
                let w = f64::from(sample.area);
                (0..3).for_each(|a| sum[a] += w * (sample.position[a] * cells - f64::from(cell[a])));
                area += w;
            }
            let at = sum.map(|s| (s / area) as f32);
            let corner = halo_index(local[0], local[1], local[2]) as u16;
            out.push(Pull { corner, at, weight: (area * weight) as f32 });
        }
    }
    debug_assert_eq!(encode(home), level.bricks.codes[brick]);
    out
}

/// Whether a corner of the cell carries an unknown of the brick.
fn touches(unknown: &[u64; EDGE], cell: [isize; 3]) -> bool {
    let span = |axis: usize| cell[axis].max(0)..(cell[axis] + 2).min(EDGE as isize);
    span(2).any(|z| span(1).any(|y| span(0).any(|x| unknown[z as usize] >> (8 * y + x) & 1 == 1)))
}
