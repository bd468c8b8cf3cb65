//! The cells of the last level of a quadtree.

use crate::quadtree::Patch;
use crate::{BitMask, fill_holes, keep_components, remove_specks};
use scene::{Mask, Raster};

/// Values of the cells of one level, row-major: `side` x `side`.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub level: usize,
    pub values: Vec<f32>,
}

impl Grid {
    pub fn side(&self) -> usize {
        1 << self.level
    }

    pub fn at(&self, patch: Patch) -> f32 {
        self.values[patch.row * self.side() + patch.column]
    }

    /// The grids of all levels, from the whole image to this one; each value is the largest of its four quarters: a patch
    /// shows structure where any of its cells does, and looking a quarter up costs nothing.
    pub fn pyramid(self) -> Vec<Self> {
        let mut grids = vec![self];
        while let Some(finer) = grids.last().filter(|g| g.level > 0) {
            let (n, fine) = (finer.side() / 2, finer.side());
            let quarter = |x: usize, y: usize| &finer.values[y * fine + x..][..2];
            let largest = |i: usize| {
                let (x, y) = (2 * (i % n), 2 * (i / n));
                let (above, below) = (quarter(x, y), quarter(x, y + 1));
                above[0].max(above[1]).max(below[0]).max(below[1])
            };
            let coarser = Self { level: finer.level - 1, values: (0..n * n).map(largest).collect() };
            grids.push(coarser);
        }
        grids.reverse();
        grids
    }
}

/// Which cells of a level are structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellMask {
    level: usize,
    bits: BitMask,
}

impl CellMask {
    /// No cell of a level.
    #[must_use]
    pub fn new(level: usize) -> Self {
        Self { level, bits: BitMask::new(1 << level, 1 << level) }
    }

    /// Adds a cell.
    ///
    /// # Panics
    /// When it is of another level.
    pub fn add(&mut self, patch: Patch) {
        assert_eq!(patch.level, self.level, "a cell of this level");
        self.bits.set(patch.column, patch.row);
    }

    /// Share of the cells that are structure.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.bits.count() as f64 / (self.bits.width() * self.bits.height()) as f64
    }

    /// The mask of `width` x `height` pixels.
    #[must_use]
    pub fn to_mask(&self, width: usize, height: usize) -> Mask {
        let mut mask = Raster::filled(width, height, 0);
        for row in 0..self.bits.height() {
            for column in (0..self.bits.width()).filter(|&column| self.bits.get(column, row)) {
                let [left, right, top, bottom] = Patch { level: self.level, column, row }.pixels(width, height);
                (top..bottom).for_each(|y| mask.row_mut(y)[left..right].fill(255));
            }
        }
        mask
    }
}

/// What is done with cells that were classified one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CleanUp {
    /// Structure of less than this share of the image is removed: particles, fish.
    pub min_structure_area: f64,
    /// Holes of less than this share of the image are filled.
    pub min_hole_area: f64,
}

impl Default for CleanUp {
    fn default() -> Self {
        Self { min_structure_area: 0.002, min_hole_area: 0.002 }
    }
}

/// Removes the connected parts that have no cell in common with `core`, if it is given, and those that are too small, then fills small holes.
///
/// The core is hysteresis as in Canny's edge detector (*A computational approach to edge detection*, PAMI 1986): one cell of which the classifier is sure makes it credible that those around
/// are structure too, and haze of which it is sure nowhere goes.
#[must_use]
pub fn clean_up(cells: &CellMask, core: Option<&CellMask>, options: &CleanUp) -> CellMask {
    let all = (cells.bits.width() * cells.bits.height()) as f64;
    let area = |share: f64| (share * all).max(0.0).round() as usize;
    let mut bits = cells.bits.clone();
    if let Some(core) = core {
        bits = keep_components(&bits, &core.bits, |_, common| common > 0);
    }
    bits = remove_specks(&bits, area(options.min_structure_area));
    CellMask { level: cells.level, bits: fill_holes(&bits, area(options.min_hole_area)) }
}
