//! One band of rows of an octave: Gaussian cascade, differences and extrema, streamed row by row through rings that stay in the cache.

use super::blur::{Kernel, ROWS, blur_column, blur_columns, blur_row, difference};
use super::extrema::{column_range, mark_extrema};
use super::refine::{Candidate, MARGIN, Refiner};
use super::simd::Simd;
use std::ops::Range;

/// Rows that the cascade advances by.
const STEP: usize = 8;

/// What all bands of an octave share.
pub(super) struct Octave<'a> {
    /// The image below the lowest level, row after row.
    pub(super) source: &'a [f32],
    /// Columns of `source`.
    pub(super) source_width: usize,
    /// 1, or 2 where every second pixel of every second row is taken.
    pub(super) decimation: usize,
    /// Columns of the octave.
    pub(super) width: usize,
    /// Rows of the octave.
    pub(super) height: usize,
    /// Makes level 0 from the source, or `None` where the source is level 0.
    pub(super) first: Option<&'a Kernel>,
    /// `cascade[k]` makes level k + 1 from level k.
    pub(super) cascade: &'a [Kernel],
    /// Localises extrema.
    pub(super) refiner: Refiner<'a>,
    /// Instruction set.
    pub(super) simd: Simd,
}

/// The latest rows of an image; row y lives at slot y modulo the capacity.
pub(super) struct Ring {
    width: usize,
    capacity: usize,
    data: Vec<f32>,
}

impl Ring {
    fn new(width: usize, capacity: usize) -> Self {
        Self { width, capacity, data: vec![0.0; width * capacity] }
    }

    /// Row `y`, which must be among the latest.
    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.data[y % self.capacity * self.width..][..self.width]
    }

    fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.data[y % self.capacity * self.width..][..self.width]
    }
}

/// Rows of padded scratch space between the vertical and the horizontal pass.
struct Scratch {
    stride: usize,
    data: Vec<f32>,
}

struct Band<'a, 'b> {
    octave: &'b Octave<'a>,
    rows: Range<usize>,
    /// `levels[k]` is level k.
    levels: Vec<Ring>,
    /// `differences[k]` is level k + 1 minus level k.
    differences: Vec<Ring>,
    /// Rows made so far, and rows that are needed, of each level; the last entry serves the differences too.
    made: Vec<usize>,
    needed: Vec<Range<usize>>,
    /// Rows above and below that the levels higher up need of each level.
    reach: Vec<usize>,
    scratch: Scratch,
}

/// Computes rows `rows` of the levels 1, 2, ... into `out` and returns the extrema found there, in order of row and level.
pub(super) fn process(octave: &Octave, rows: Range<usize>, out: &mut [&mut [f32]]) -> Vec<Candidate> {
    let mut band = Band::new(octave, rows.clone());
    let mut search = Search::new(octave);
    // Starting early fills the rings gradually, so that they need not hold the whole reach.
    let lead = band.reach[0] + 2 * MARGIN + STEP;
    let mut target = rows.start as isize - lead as isize;
    while target < rows.end as isize {
        let end = target + STEP as isize;
        band.advance(end + MARGIN as isize, out);
        for y in target.max(rows.start as isize)..end.min(rows.end as isize) {
            search.row(&band.differences, y as usize);
        }
        target = end;
    }
    search.candidates
}

impl<'a, 'b> Band<'a, 'b> {
    fn new(octave: &'b Octave<'a>, rows: Range<usize>) -> Self {
        let top = octave.cascade.len();
        let mut reach = vec![0; top + 1];
        for k in (0..top).rev() {
            reach[k] = reach[k + 1] + octave.cascade[k].radius();
        }
        let needed: Vec<_> =
            reach.iter().map(|&r| rows.start.saturating_sub(MARGIN + r)..(rows.end + MARGIN + r).min(octave.height)).collect();
        let levels = (0..=top)
            .map(|k| {
                let window = octave.cascade.get(k).map_or(0, |kernel| 2 * kernel.radius());
                Ring::new(octave.width, STEP + window.max(reach[k]) + 2 * MARGIN)
            })
            .collect();
        let differences = (0..top).map(|_| Ring::new(octave.width, STEP + 2 * MARGIN)).collect();
        let widest = octave.cascade.iter().chain(octave.first).map(Kernel::radius).max().unwrap_or(0);
        let stride = octave.width + 2 * widest;
        let scratch = Scratch { stride, data: vec![0.0; stride * ROWS] };
        Self { octave, rows, levels, differences, made: needed.iter().map(|n| n.start).collect(), needed, reach, scratch }
    }

    /// Makes all rows that the differences below row `end` need, and those differences.
    fn advance(&mut self, end: isize, out: &mut [&mut [f32]]) {
        let top = self.octave.cascade.len();
        let first_new = self.made[top];
        for k in 0..=top {
            let until = (end + self.reach[k] as isize).clamp(0, self.needed[k].end as isize) as usize;
            while self.made[k] < until {
                let rows = self.made[k]..until.min(self.made[k] + ROWS);
                self.make(k, rows.clone());
                if (1..=out.len()).contains(&k) {
                    for y in rows.clone() {
                        if self.rows.contains(&y) {
                            let at = (y - self.rows.start) * self.octave.width;
                            out[k - 1][at..at + self.octave.width].copy_from_slice(self.levels[k].row(y));
                        }
                    }
                }
                self.made[k] = rows.end;
            }
        }
        for y in first_new..self.made[top] {
            for k in 0..top {
                difference(self.octave.simd, self.levels[k + 1].row(y), self.levels[k].row(y), self.differences[k].row_mut(y));
            }
        }
    }

    /// Makes at most [`ROWS`] rows of level `k`.
    fn make(&mut self, k: usize, rows: Range<usize>) {
        let octave = self.octave;
        if k > 0 {
            let (below, above) = self.levels.split_at_mut(k);
            let below = &below[k - 1];
            filter(octave, &octave.cascade[k - 1], |y| below.row(y), rows, &mut self.scratch, &mut above[0]);
        } else if let Some(kernel) = octave.first {
            let source = |y: usize| &octave.source[y * octave.source_width..][..octave.width];
            filter(octave, kernel, source, rows, &mut self.scratch, &mut self.levels[0]);
        } else {
            for y in rows {
                let row = &octave.source[y * octave.decimation * octave.source_width..][..octave.source_width];
                let out = self.levels[0].row_mut(y);
                match octave.decimation {
                    1 => out.copy_from_slice(row),
                    step => out.iter_mut().zip(row.iter().step_by(step)).for_each(|(o, v)| *o = *v),
                }
            }
        }
    }
}

/// Filters `rows` of an image whose rows `source` gives; the image continues with its border values.
fn filter<'r>(
    octave: &Octave,
    kernel: &Kernel,
    source: impl Fn(usize) -> &'r [f32],
    rows: Range<usize>,
    scratch: &mut Scratch,
    out: &mut Ring,
) {
    let (radius, width, stride) = (kernel.radius(), octave.width, scratch.stride);
    let covered = (rows.start..rows.end + 2 * radius).map(|y| source(y.saturating_sub(radius).min(octave.height - 1)));
    let covered: Vec<&[f32]> = covered.collect();
    if rows.len() == ROWS {
        blur_columns(octave.simd, &covered, kernel.weights(), &mut scratch.data[radius..], stride, width);
    } else {
        for i in 0..rows.len() {
            let window = &covered[i..=i + 2 * radius];
            blur_column(octave.simd, window, kernel.weights(), &mut scratch.data[radius + i * stride..], stride, width);
        }
    }
    for (i, y) in rows.enumerate() {
        let padded = &mut scratch.data[i * stride..][..width + 2 * radius];
        let (first, last) = (padded[radius], padded[radius + width - 1]);
        padded[..radius].fill(first);
        padded[radius + width..].fill(last);
        blur_row(octave.simd, padded, kernel.half(), out.row_mut(y));
    }
}

/// The scan of the differences, row by row.
struct Search<'a, 'b> {
    octave: &'b Octave<'a>,
    highest: Vec<Vec<f32>>,
    lowest: Vec<Vec<f32>>,
    max: Vec<f32>,
    min: Vec<f32>,
    found: Vec<u32>,
    candidates: Vec<Candidate>,
}

impl<'a, 'b> Search<'a, 'b> {
    fn new(octave: &'b Octave<'a>) -> Self {
        let row = || vec![0.0; octave.width];
        let rows = || (0..octave.cascade.len()).map(|_| row()).collect();
        Self { octave, highest: rows(), lowest: rows(), max: row(), min: row(), found: Vec::new(), candidates: Vec::new() }
    }

    fn row(&mut self, differences: &[Ring], y: usize) {
        if y == 0 || y + 1 >= self.octave.height || self.octave.width < 3 {
            return;
        }
        let simd = self.octave.simd;
        for (k, ring) in differences.iter().enumerate() {
            column_range(simd, [y - 1, y, y + 1].map(|y| ring.row(y)), &mut self.highest[k], &mut self.lowest[k]);
        }
        for level in 1..differences.len() - 1 {
            let highest = [level - 1, level, level + 1].map(|k| &self.highest[k][..]);
            let lowest = [level - 1, level, level + 1].map(|k| &self.lowest[k][..]);
            let threshold = self.octave.refiner.scan_threshold();
            self.found.clear();
            mark_extrema(simd, differences[level].row(y), highest, lowest, threshold, &mut self.max, &mut self.min, &mut self.found);
            for &x in &self.found {
                self.candidates.extend(self.octave.refiner.refine(differences, level, y, x as usize));
            }
        }
    }
}
