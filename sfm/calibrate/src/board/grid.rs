//! From a patch of corners to all corners of the board.

use super::candidates::Candidate;
use super::graph::Patch;
use super::pattern::correlation;
use crate::saddle::refine;
use nalgebra::Vector2;
use scene::Raster;
use std::collections::BTreeMap;

/// A line of the patch at its border with fewer of its corners is no line of the board.
const MIN_FILLED: f64 = 0.5;
/// How far a corner may be from where its neighbours say, in edge lengths.
const MAX_OFF: f64 = 0.3;
/// Correlation of a corner that is looked for because its neighbours say it is there.
/// It is above that of a place with three bright squares, as the border of the board has: 0.58.
const MIN_CORRELATION: f64 = 0.7;

/// Corners by column and row, columns and rows from 0.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub corners: BTreeMap<(i32, i32), Vector2<f64>>,
    pub columns: i32,
    pub rows: i32,
    /// +1 where the square between growing columns and rows at (0, 0) is bright, else -1.
    bright: f64,
}

/// Column and row of a corner, and its pixel.
type PlacedCorner = ((i32, i32), Vector2<f64>);

impl Grid {
    /// The patch without stray lines at its border.
    pub(super) fn new(patch: &Patch, candidates: &[Candidate], image: &Raster<f32>) -> Option<Self> {
        let mut corners: BTreeMap<(i32, i32), Vector2<f64>> = patch.iter().map(|(&k, &c)| (k, candidates[c].at)).collect();
        while trim(&mut corners, MIN_FILLED) {}
        Self::of(corners, image)
    }

    /// The grid of some corners, in columns and rows from 0.
    fn of(corners: BTreeMap<(i32, i32), Vector2<f64>>, image: &Raster<f32>) -> Option<Self> {
        let (low, high) = bounds(&corners)?;
        let corners = corners.into_iter().map(|((i, j), p)| ((i - low.0, j - low.1), p)).collect();
        let mut grid = Self { corners, columns: high.0 - low.0 + 1, rows: high.1 - low.1 + 1, bright: 1.0 };
        // The sign that most corners agree to.
        let keys: Vec<(i32, i32)> = grid.corners.keys().copied().collect();
        let sum: f64 = keys.iter().filter_map(|&k| grid.looks(image, k, &grid.corners[&k])).sum();
        grid.bright = if sum < 0.0 { -1.0 } else { 1.0 };
        Some(grid)
    }

    /// Without lines at its border that have gaps, as long as it is larger than a board of the given size.
    pub(super) fn shrunk(mut self, image: &Raster<f32>, columns: i32, rows: i32) -> Option<Self> {
        let (long, short) = (columns.max(rows), columns.min(rows));
        while !self.is_full() && (self.columns.max(self.rows) > long || self.columns.min(self.rows) > short) && trim(&mut self.corners, 1.0)
        {
            self = Self::of(self.corners, image)?;
        }
        Some(self)
    }

    pub(super) fn is_full(&self) -> bool {
        self.corners.len() as i32 == self.columns * self.rows
    }

    /// Whether the square between growing columns and rows at a corner is bright.
    pub(super) fn is_bright(&self, (i, j): (i32, i32)) -> bool {
        self.sign((i, j)) > 0.0
    }

    fn sign(&self, (i, j): (i32, i32)) -> f64 {
        if (i + j).rem_euclid(2) == 0 { self.bright } else { -self.bright }
    }

    /// Vector to the next corner along columns (`axis` (1, 0)) or rows, from the nearest pair on the line or beside it.
    fn edge(&self, (i, j): (i32, i32), axis: (i32, i32)) -> Option<Vector2<f64>> {
        let (across_i, across_j) = (axis.1, axis.0);
        for side in [0, 1, -1, 2, -2] {
            for (a, b) in [(-1, 1), (0, 1), (-1, 0), (1, 2), (-2, -1), (2, 3), (-3, -2)] {
                let at = |k: i32| self.corners.get(&(i + k * axis.0 + side * across_i, j + k * axis.1 + side * across_j));
                if let (Some(p), Some(q)) = (at(a), at(b)) {
                    return Some((q - p) / f64::from(b - a));
                }
            }
        }
        None
    }

    /// Correlation of a place with the pattern that the board has at a corner.
    fn looks(&self, image: &Raster<f32>, key: (i32, i32), at: &Vector2<f64>) -> Option<f64> {
        let (u, v) = (self.edge(key, (1, 0))?, self.edge(key, (0, 1))?);
        Some(self.sign(key) * correlation(image, at, &u, &v)?)
    }

    /// Where the neighbours say that a corner is: the mean over lines through it of interpolation or, failing that, extrapolation.
    fn predicted(&self, (i, j): (i32, i32)) -> Option<Vector2<f64>> {
        let at = |di: i32, dj: i32| self.corners.get(&(i + di, j + dj)).copied();
        let mut sum = Vector2::zeros();
        let mut count = 0.0;
        for (di, dj) in [(1, 0), (0, 1)] {
            if let (Some(a), Some(b)) = (at(-di, -dj), at(di, dj)) {
                sum += (a + b) * 0.5;
                count += 1.0;
            }
        }
        if count == 0.0 {
            for (di, dj) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                if let (Some(a), Some(b)) = (at(di, dj), at(2 * di, 2 * dj)) {
                    // The change from edge to edge goes on.
                    let bend = at(3 * di, 3 * dj).map_or_else(Vector2::zeros, |c| a - 2.0 * b + c);
                    sum += 2.0 * a - b + bend;
                    count += 1.0;
                }
            }
        }
        (count > 0.0).then(|| sum / count)
    }

    /// Looks for a corner where its neighbours say it is.
    fn find(&self, image: &Raster<f32>, key: (i32, i32)) -> Option<(Vector2<f64>, f64)> {
        let start = self.predicted(key)?;
        let length = self.edge(key, (1, 0))?.norm().min(self.edge(key, (0, 1))?.norm());
        let found = refine(image, &start, (MAX_OFF * length).max(2.0))?;
        let score = self.looks(image, key, &found)?;
        ((found - start).norm() < MAX_OFF * length && score > MIN_CORRELATION).then_some((found, score))
    }

    /// Looks for the missing corners within.
    pub(super) fn fill(&mut self, image: &Raster<f32>) {
        loop {
            let missing = (0..self.columns).flat_map(|i| (0..self.rows).map(move |j| (i, j))).filter(|k| !self.corners.contains_key(k));
            let found: Vec<_> = missing.filter_map(|k| Some((k, self.find(image, k)?.0))).collect();
            if found.is_empty() {
                return;
            }
            self.corners.extend(found);
        }
    }

    /// Adds the line of corners beyond a border along an axis, on the side where it looks more like one; `false` where all of its
    /// corners are on neither.
    pub(super) fn extend(&mut self, image: &Raster<f32>, along_columns: bool) -> bool {
        let (size, other) = if along_columns { (self.columns, self.rows) } else { (self.rows, self.columns) };
        let line = |side: i32| -> Option<(f64, Vec<PlacedCorner>)> {
            let mut score = 0.0;
            let mut found = Vec::new();
            for k in 0..other {
                let key = if along_columns { (side, k) } else { (k, side) };
                let (p, s) = self.find(image, key)?;
                score += s;
                found.push((key, p));
            }
            Some((score, found))
        };
        let (before, after) = (line(-1), line(size));
        let Some((_, found)) = before.into_iter().chain(after).max_by(|a, b| a.0.total_cmp(&b.0)) else { return false };
        let shift = i32::from(found[0].0.0 < 0 || found[0].0.1 < 0);
        self.corners.extend(found);
        if shift > 0 {
            let by = if along_columns { (1, 0) } else { (0, 1) };
            self.corners = std::mem::take(&mut self.corners).into_iter().map(|((i, j), p)| ((i + by.0, j + by.1), p)).collect();
            self.bright = -self.bright;
        }
        if along_columns {
            self.columns += 1
        } else {
            self.rows += 1
        }
        true
    }

    /// The least and the mean correlation of the corners whose squares lie within the image.
    pub(super) fn quality(&self, image: &Raster<f32>) -> (f64, f64) {
        let scores: Vec<f64> = self.corners.iter().filter_map(|(&k, p)| self.looks(image, k, p)).collect();
        (scores.iter().copied().fold(1.0, f64::min), scores.iter().sum::<f64>() / scores.len().max(1) as f64)
    }
}

fn bounds(corners: &BTreeMap<(i32, i32), Vector2<f64>>) -> Option<((i32, i32), (i32, i32))> {
    let first = *corners.keys().next()?;
    Some(corners.keys().fold((first, first), |(low, high), k| ((low.0.min(k.0), low.1.min(k.1)), (high.0.max(k.0), high.1.max(k.1)))))
}

/// Removes the line at the border of which the smallest share is there, if that is below `least`; `false` when there is none.
fn trim(corners: &mut BTreeMap<(i32, i32), Vector2<f64>>, least: f64) -> bool {
    let Some((low, high)) = bounds(corners) else { return false };
    let lengths = [f64::from(high.1 - low.1 + 1), f64::from(high.0 - low.0 + 1)];
    let lines = [(0, low.0), (0, high.0), (1, low.1), (1, high.1)];
    let on = |axis: usize, value: i32| move |k: &(i32, i32)| [k.0, k.1][axis] == value;
    let filled = |&(axis, value): &(usize, i32)| corners.keys().filter(|k| on(axis, value)(k)).count() as f64 / lengths[axis];
    let worst = lines.iter().map(|l| (filled(l), *l)).min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, (axis, value))) = worst.filter(|(share, _)| *share < least) else { return false };
    corners.retain(|k, _| !on(axis, value)(k));
    true
}
