//! How well an image that is not oriented yet sees the model.

/// Levels of the grid: 2, 4, ... 64 cells a side.
const LEVELS: usize = 6;

/// Counts the keypoints of one image that were matched with observations of scene points, and how evenly they lie.
///
/// The score of Schoenberger & Frahm (CVPR 2016, section 4.2): at each level of a grid, an occupied cell counts as many
/// points as the level has cells, so that spread keypoints beat clustered ones.
#[derive(Clone, Debug)]
pub(crate) struct Visibility {
    width: f32,
    height: f32,
    /// Observations of points that each keypoint was matched with.
    seen: Vec<u32>,
    count: usize,
    cells: Vec<u32>,
    score: u64,
}

impl Visibility {
    pub(crate) fn new(width: u32, height: u32, keypoints: usize) -> Self {
        let cells = (1..=LEVELS).map(|l| 1 << (2 * l)).sum();
        Self { width: width as f32, height: height as f32, seen: vec![0; keypoints], count: 0, cells: vec![0; cells], score: 0 }
    }

    /// Number of keypoints that see a point of the model.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Number and spread of these keypoints.
    pub(crate) fn score(&self) -> u64 {
        self.score
    }

    /// A match of keypoint `index` at `position` became an observation of a point.
    pub(crate) fn add(&mut self, index: usize, position: [f32; 2]) {
        self.seen[index] += 1;
        if self.seen[index] == 1 {
            self.count += 1;
            self.for_cells(position, |cell, weight, score| {
                *cell += 1;
                if *cell == 1 {
                    *score += weight;
                }
            });
        }
    }

    /// The opposite of [`Visibility::add`].
    pub(crate) fn remove(&mut self, index: usize, position: [f32; 2]) {
        self.seen[index] -= 1;
        if self.seen[index] == 0 {
            self.count -= 1;
            self.for_cells(position, |cell, weight, score| {
                *cell -= 1;
                if *cell == 0 {
                    *score -= weight;
                }
            });
        }
    }

    fn for_cells(&mut self, [x, y]: [f32; 2], mut f: impl FnMut(&mut u32, u64, &mut u64)) {
        let mut start = 0;
        for level in 1..=LEVELS {
            let side = 1usize << level;
            let column = ((x / self.width * side as f32) as usize).min(side - 1);
            let row = ((y / self.height * side as f32) as usize).min(side - 1);
            f(&mut self.cells[start + row * side + column], (side * side) as u64, &mut self.score);
            start += side * side;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_beats_clustered_and_removal_undoes() {
        let mut clustered = Visibility::new(100, 100, 8);
        let mut spread = Visibility::new(100, 100, 8);
        for i in 0..4 {
            clustered.add(i, [1.0, 1.0 + 0.01 * i as f32]);
            spread.add(i, [20.0 + 60.0 * (i % 2) as f32, 20.0 + 60.0 * (i / 2) as f32]);
        }
        assert_eq!(clustered.count(), spread.count());
        assert!(spread.score() > clustered.score());
        spread.add(0, [20.0, 20.0]);
        assert_eq!(spread.count(), 4);
        spread.remove(0, [20.0, 20.0]);
        for i in 0..4 {
            spread.remove(i, [20.0 + 60.0 * (i % 2) as f32, 20.0 + 60.0 * (i / 2) as f32]);
        }
        assert_eq!((spread.count(), spread.score()), (0, 0));
    }
}
