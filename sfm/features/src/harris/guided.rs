//! Matching along a guess of the motion.

use super::motion::{Motion, estimate};
use super::patch::{UNIT, distance, distance_at};
use crate::matching::{MatchOptions, match_descriptors};
use scene::{Features, Keypoint, KeypointIndex};

/// Corners of each image that the motion is guessed from, the strongest.
const STRONGEST: usize = 1000;
/// Correlation of the matches that the motion is guessed from.
const SURE: f64 = 0.85;
/// Length of a descriptor that [`MatchOptions`] takes for 1.
const OPTIONS_UNIT: f64 = 512.0;
/// The motion is looked for to this share of the diagonal of what the corners cover.
const TOLERANCE: f64 = 0.04;
/// Candidates lie within this many times the spread of the guess.
const REACH: f64 = 2.5;

/// Options of [`match_guided`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NccOptions {
    /// Least normalised cross-correlation of a match, -1 to 1.
    pub min_correlation: f64,
    /// Smallest radius about the predicted place in which a match is looked for, pixels.
    pub min_radius_px: f64,
    /// Seed of the search for the motion.
    pub seed: u64,
}

impl Default for NccOptions {
    fn default() -> Self {
        Self { min_correlation: 0.8, min_radius_px: 16.0, seed: 0 }
    }
}

/// Matches between the corners of two images: pairs of positions in their lists, sorted, one to one.
///
/// The motion of the image as a whole is estimated from the strongest corners; then each corner is compared with those near its predicted place
/// only, and matches are each other's best ones with at least the least correlation. Where no motion is found, all are compared with all. Runs on one
/// thread; the same everywhere.
#[must_use]
pub fn match_guided(a: &Features, b: &Features, options: &NccOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
    let strongest = |f: &Features| f.descriptors[..f.len().min(STRONGEST)].to_vec();
    let sure: Vec<(Keypoint, Keypoint)> = match_descriptors(&strongest(a), &strongest(b), &correlating(SURE.max(options.min_correlation)))
        .into_iter()
        .map(|(i, j)| (a.keypoints[i.index()], b.keypoints[j.index()]))
        .collect();
    match estimate(&sure, TOLERANCE * diagonal(b), options.seed) {
        Some(motion) => near(a, b, &motion, options),
        None => match_descriptors(&a.descriptors, &b.descriptors, &correlating(options.min_correlation)),
    }
}

/// Mutual nearest neighbours with a least correlation, and no other test.
fn correlating(correlation: f64) -> MatchOptions {
    let max_distance = ((2.0 - 2.0 * correlation).max(0.0).sqrt() * UNIT / OPTIONS_UNIT) as f32;
    MatchOptions { max_ratio: 1.0, max_distance, mutual: true }
}

fn diagonal(features: &Features) -> f64 {
    let (x, y) = features.keypoints.iter().fold((0.0f32, 0.0f32), |(x, y), k| (x.max(k.x), y.max(k.y)));
    f64::from(x.hypot(y))
}

fn near(a: &Features, b: &Features, motion: &Motion, options: &NccOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
    let radius = (REACH * motion.spread_px).max(options.min_radius_px).max(1.0);
    let grid = Grid::new(b, radius);
    let limit = distance_at(options.min_correlation);
    let mut best_of_a = vec![(u32::MAX, u32::MAX); a.len()];
    let mut best_of_b = vec![(u32::MAX, u32::MAX); b.len()];
    for (i, (keypoint, descriptor)) in a.keypoints.iter().zip(&a.descriptors).enumerate() {
        let place = motion.apply(keypoint);
        grid.around(place.x, place.y, |j| {
            let k = &b.keypoints[j as usize];
            if (f64::from(k.x) - place.x).hypot(f64::from(k.y) - place.y) <= radius {
                let d = distance(descriptor, &b.descriptors[j as usize]);
                best_of_a[i] = best_of_a[i].min((d, j));
                best_of_b[j as usize] = best_of_b[j as usize].min((d, i as u32));
            }
        });
    }
    let mutual =
        best_of_a.iter().enumerate().filter(|&(i, &(d, j))| j != u32::MAX && f64::from(d) <= limit && best_of_b[j as usize].1 == i as u32);
    mutual.map(|(i, &(_, j))| (KeypointIndex::new(i), KeypointIndex(j))).collect()
}

/// Corners by cells as wide as the radius.
struct Grid {
    cell: f64,
    columns: i64,
    rows: i64,
    /// Where the corners of each cell begin in `members`.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Grid {
    fn new(features: &Features, cell: f64) -> Self {
        let size =
            |pick: fn(&Keypoint) -> f32| (features.keypoints.iter().map(|k| f64::from(pick(k))).fold(0.0, f64::max) / cell) as i64 + 1;
        let (columns, rows) = (size(|k| k.x), size(|k| k.y));
        let of = |k: &Keypoint| ((f64::from(k.y) / cell) as i64 * columns + (f64::from(k.x) / cell) as i64) as usize;
        let mut order: Vec<u32> = (0..features.len() as u32).collect();
        order.sort_by_key(|&i| of(&features.keypoints[i as usize]));
        let mut starts = vec![0u32; (columns * rows) as usize + 1];
        for k in &features.keypoints {
            starts[of(k) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        Self { cell, columns, rows, starts, members: order }
    }

    /// The corners of the nine cells about a place.
    fn around(&self, x: f64, y: f64, mut visit: impl FnMut(u32)) {
        let (column, row) = ((x / self.cell).floor() as i64, (y / self.cell).floor() as i64);
        for j in (row - 1).max(0)..=(row + 1).min(self.rows - 1) {
            for i in (column - 1).max(0)..=(column + 1).min(self.columns - 1) {
                let cell = (j * self.columns + i) as usize;
                self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize].iter().for_each(|&m| visit(m));
            }
        }
    }
}
