//! Keypoints sorted by where they are.

use super::distance::squared_norm;
use nalgebra::Vector2;
use scene::{Camera, Descriptor, Features};
use std::ops::Range;

/// Keypoints that a cell holds on average.
const PER_CELL: f64 = 2.0;
/// Smallest side of a cell, pixels.
const MIN_SIDE_PX: f32 = 4.0;

/// The keypoints of an image in square cells, row after row, with their descriptors: the cells of a row of cells are one run of memory.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    pub side_px: f32,
    columns: usize,
    rows: usize,
    /// Where each cell begins in the lists below; one more at the end.
    starts: Vec<u32>,
    /// Index of each keypoint in the list of the image.
    pub keypoints: Vec<u32>,
    /// Its descriptor.
    pub descriptors: Vec<Descriptor>,
    /// The square of its length.
    pub squared_norms: Vec<i32>,
    /// Undistorted normalised coordinates, for images of known interior orientation; not numbers where there are none. Else empty.
    pub rays: [Vec<f32>; 2],
}

impl Cells {
    /// Keypoints beyond the image, and those without a finite place, come into the nearest cell.
    pub(super) fn new(features: &Features, camera: &Camera, camera_known: bool) -> Self {
        let (width, height) = (camera.width().max(1) as f32, camera.height().max(1) as f32);
        let count = features.len().max(1) as f64;
        let side_px = ((PER_CELL * f64::from(width) * f64::from(height) / count).sqrt() as f32).max(MIN_SIDE_PX);
        let along = |length: f32| (length / side_px).ceil().max(1.0) as usize;
        let (columns, rows) = (along(width), along(height));
        let mut starts = vec![0u32; columns * rows + 1];
        let cell = |k: &scene::Keypoint| at(k.y / side_px, rows) * columns + at(k.x / side_px, columns);
        let of: Vec<usize> = features.keypoints.iter().map(cell).collect();
        of.iter().for_each(|&c| starts[c + 1] += 1);
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut keypoints: Vec<u32> = (0..features.len() as u32).collect();
        keypoints.sort_by_key(|&k| of[k as usize]);
        let descriptors = keypoints.iter().map(|&k| features.descriptors[k as usize]).collect();
        let squared_norms = keypoints.iter().map(|&k| squared_norm(&features.descriptors[k as usize])).collect();
        let mut rays = [Vec::new(), Vec::new()];
        for &k in keypoints.iter().filter(|_| camera_known) {
            let pixel = &features.keypoints[k as usize];
            let ray = camera.unproject(&Vector2::new(f64::from(pixel.x), f64::from(pixel.y))).unwrap_or(Vector2::repeat(f64::NAN));
            rays[0].push(ray.x as f32);
            rays[1].push(ray.y as f32);
        }
        Self { side_px, columns, rows, starts, keypoints, descriptors, squared_norms, rays }
    }

    /// The cells that hold keypoints: column, row, positions in the lists.
    pub(super) fn occupied(&self) -> impl Iterator<Item = (usize, usize, Range<usize>)> {
        let cells = (0..self.rows).flat_map(move |row| (0..self.columns).map(move |column| (column, row)));
        cells.map(|(column, row)| (column, row, self.run(row, column, column))).filter(|(_, _, run)| !run.is_empty())
    }

    /// Positions in the lists, a run for each row of cells, of the cells that a box of pixels touches; none for a box beside the image.
    pub(super) fn within(&self, low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = Range<usize>> {
        let side = f64::from(self.side_px);
        let span = |axis: usize, n: usize| {
            let last = (high[axis] / side).floor();
            let beside = !(last >= 0.0 && low[axis] / side < n as f64);
            (at((low[axis] / side) as f32, n), if beside { None } else { Some(at(last as f32, n)) })
        };
        let ((left, right), (top, bottom)) = (span(0, self.columns), span(1, self.rows));
        let rows = match (right, bottom) {
            (Some(_), Some(bottom)) => top..bottom + 1,
            _ => 0..0,
        };
        rows.map(move |row| self.run(row, left, right.unwrap_or(left))).filter(|run| !run.is_empty())
    }

    fn run(&self, row: usize, left: usize, right: usize) -> Range<usize> {
        let first = row * self.columns;
        self.starts[first + left] as usize..self.starts[first + right + 1] as usize
    }
}

/// The cell of a coordinate in cells, of `n`. What is not a number comes into the first.
fn at(coordinate: f32, n: usize) -> usize {
    (coordinate.max(0.0) as usize).min(n - 1)
}
