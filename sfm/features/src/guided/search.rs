//! Comparison within windows.

use super::cells::Cells;
use super::distance::{Distances, Widened};
use super::motion::Motion;
use crate::matching::Nearest;
use nalgebra::Vector2;

/// The nearest of each keypoint of either image within the windows, by their indices in the images' lists.
pub(super) struct Found {
    pub of_a: Vec<Nearest>,
    pub of_b: Vec<Nearest>,
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

/// Compares each keypoint of `a` with those of `b` in the window of its cell.
///
/// Distances are integers and ties go to the lower index: every instruction set and every order of the comparisons gives the same result.
pub(super) fn search(a: &Cells, b: &Cells, motion: &Motion, distances: Distances) -> Found {
    let mut of_a = vec![Nearest::NONE; a.keypoints.len()];
    let mut of_b = vec![Two::NONE; b.keypoints.len()];
    let mut buffer = vec![0u32; b.keypoints.len()];
    let side = f64::from(a.side_px);
    for (column, row, members) in a.occupied() {
        let window = motion.window(Vector2::new(column as f64 * side, row as f64 * side), side);
        for member in members {
            let (index, descriptor): (u32, Widened) = (a.keypoints[member], a.descriptors[member].map(i16::from));
            let mut two = Two::NONE;
            for run in b.within(window.low, window.high) {
                let buffer = &mut buffer[..run.len()];
                distances(&descriptor, &b.descriptors[run.clone()], buffer);
                for ((&distance, &j), back) in buffer.iter().zip(&b.keypoints[run.clone()]).zip(&mut of_b[run]) {
                    two.offer(distance, j);
                    back.offer(distance, index);
                }
            }
            of_a[index as usize] = two.nearest();
        }
    }
    // So far in the order of the cells, in which it is written in runs.
    let mut by_index = vec![Nearest::NONE; b.keypoints.len()];
    for (two, &j) in of_b.iter().zip(&b.keypoints) {
        by_index[j as usize] = two.nearest();
    }
    Found { of_a, of_b: by_index }
}
