//! Comparison within windows.

use super::cells::Cells;
use super::distance::Products;
use super::motion::Motion;
use crate::matching::Nearest;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::ops::Range;

/// The nearest of each keypoint of either image within the windows, by their indices in the images' lists.
pub(super) struct Found {
    pub of_a: Vec<Nearest>,
    pub of_b: Vec<Nearest>,
}

/// Where the keypoints of the second image are looked for.
pub(super) struct Where {
    pub motion: Motion,
    /// Within the windows, only here; both images have rays.
    pub band: Option<Band>,
}

/// A band about an epipolar line.
pub(super) struct Band {
    /// Of rays.
    pub essential: Matrix3<f64>,
    /// To either side, in the unit of the rays.
    pub width: f64,
}

impl Band {
    /// The middle of the band of a ray in the first image: its product with a ray in the second is their distance over the width.
    fn line(&self, x: f32, y: f32) -> [f32; 3] {
        let line = self.essential * Vector3::new(f64::from(x), f64::from(y), 1.0);
        let unit = line / (line.xy().norm() * self.width);
        [unit.x as f32, unit.y as f32, unit.z as f32]
    }
}

/// The two nearest so far, distances before indices: ties go to the lower index, in whatever order they come.
#[derive(Clone, Copy)]
struct Two {
    first: u64,
    second: u64,
}

impl Two {
    const NONE: Self = Self { first: u64::MAX, second: u64::MAX };

    #[inline(always)]
    fn offer(&mut self, distance: u32, index: u32) {
        let key = u64::from(distance) << 32 | u64::from(index);
        self.second = self.second.min(self.first.max(key));
        self.first = self.first.min(key);
    }

    fn nearest(self) -> Nearest {
        Nearest { distance: (self.first >> 32) as u32, index: self.first as u32, second: (self.second >> 32) as u32 }
    }
}

/// Compares each keypoint of `a` with those of `b` in the window of its cell and, if there is one, its band.
///
/// Distances are integers and ties go to the lower index: every instruction set and every order of the comparisons gives the same result.
pub(super) fn search(a: &Cells, b: &Cells, place: &Where, products: Products) -> Found {
    let mut of_a = vec![Nearest::NONE; a.keypoints.len()];
    let mut of_b = vec![Two::NONE; b.keypoints.len()];
    let (mut positions, mut found) = (vec![0u32; b.keypoints.len() + 1], vec![0i32; b.keypoints.len()]);
    let side = f64::from(a.side_px);
    for (column, row, members) in a.occupied() {
        let window = place.motion.window(Vector2::new(column as f64 * side, row as f64 * side), side);
        for member in members {
            let line = place.band.as_ref().map(|band| band.line(a.rays[0][member], a.rays[1][member]));
            let mut count = 0;
            for run in b.within(window.low, window.high) {
                count += within(b, run, line, &mut positions[count..]);
            }
            products(&a.descriptors[member].map(i16::from), &b.descriptors, &positions[..count], &mut found[..count]);
            let mut two = Two::NONE;
            for (&product, &position) in found.iter().zip(&positions[..count]) {
                let position = position as usize;
                let distance = (a.squared_norms[member] + b.squared_norms[position] - 2 * product).cast_unsigned();
                two.offer(distance, b.keypoints[position]);
                of_b[position].offer(distance, a.keypoints[member]);
            }
            of_a[a.keypoints[member] as usize] = two.nearest();
        }
    }
    // So far in the order of the cells, in which it is written in runs.
    let mut by_index = vec![Nearest::NONE; b.keypoints.len()];
    for (two, &j) in of_b.iter().zip(&b.keypoints) {
        by_index[j as usize] = two.nearest();
    }
    Found { of_a, of_b: by_index }
}

/// Writes the positions of a run that are within the band about a line, all without one, to a list that is longer than the run; their number.
fn within(b: &Cells, run: Range<usize>, line: Option<[f32; 3]>, to: &mut [u32]) -> usize {
    let Some([l0, l1, l2]) = line else {
        to.iter_mut().zip(run.clone()).for_each(|(to, position)| *to = position as u32);
        return run.len();
    };
    let mut count = 0;
    for ((position, &x), &y) in run.clone().zip(&b.rays[0][run.clone()]).zip(&b.rays[1][run]) {
        // Without a branch: which are within is as good as random. What is no number is not within.
        to[count] = position as u32;
        count += usize::from((l0 * x + l1 * y + l2).abs() <= 1.0);
    }
    count
}
