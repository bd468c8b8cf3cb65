//! Cubic cells, for what is occupied.

use crate::EvalError;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Cells an axis may have: 21 bits of a 64-bit key, less two for the neighbours at the ends.
const MAX_CELLS: f64 = ((1u64 << 21) - 4) as f64;

/// Maps positions to cells of one size; keys grow along x first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cells {
    origin: Point3<f64>,
    size: f64,
}

impl Cells {
    /// Cells of `size`, one of them centred on `min`. What lies more than 2^21 cells away counts as being in the last ones.
    pub fn new(min: Point3<f64>, size: f64) -> Self {
        // Centred, so that a flat reference does not lie on a border of cells.
        Self { origin: min.map(|c| c - 1.5 * size), size }
    }

    /// As [`Cells::new`], refused where the cells up to `max` cannot be told apart.
    pub fn distinct(what: &'static str, min: Point3<f64>, max: Point3<f64>, size: f64) -> Result<Self, EvalError> {
        let extent = (max - min).amax();
        if extent / size > MAX_CELLS {
            return Err(EvalError::TooFine { what, cell_m: size, extent_m: extent });
        }
        Ok(Self::new(min, size))
    }

    fn cell(&self, p: &Point3<f64>) -> [u64; 3] {
        // The cast saturates: what lies below the margin falls into cell 0, which is never asked for.
        ((p - self.origin) / self.size).map(|c| (c as u64).min((1 << 21) - 1)).into()
    }

    pub fn key(&self, p: &Point3<f64>) -> u64 {
        key(self.cell(p))
    }

    /// Centre of the cell of a key.
    pub fn centre(&self, key: u64) -> Point3<f64> {
        let index = [0, 21, 42].map(|shift| (key >> shift & ((1 << 21) - 1)) as f64);
        Point3::from(self.origin.coords + (Vector3::from(index).add_scalar(0.5)) * self.size)
    }

    pub fn size(&self) -> f64 {
        self.size
    }
}

fn key([x, y, z]: [u64; 3]) -> u64 {
    x | y << 21 | z << 42
}

/// Keys of the cells that hold a point, ascending.
pub(crate) fn occupied(cells: Cells, points: &[Point3<f64>]) -> Vec<u64> {
    let mut keys: Vec<u64> = points.par_iter().map(|p| cells.key(p)).collect();
    keys.par_sort_unstable();
    keys.dedup();
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_told_apart_and_centred() {
        let cells = Cells::distinct("cells", Point3::origin(), Point3::new(10.0, 10.0, 10.0), 1.0).expect("coarse enough");
        let at = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        let keys = occupied(cells, &[at(5.0, 0.0, 3.0), at(0.0, 0.0, 0.0), at(0.49, -0.49, 0.0), at(0.51, 0.0, 0.0)]);
        assert_eq!(keys.len(), 3);
        assert_eq!(cells.centre(keys[0]), at(0.0, 0.0, 0.0));
        assert_eq!(cells.centre(cells.key(&at(5.2, 0.1, 3.4))), at(5.0, 0.0, 3.0));
        assert!(Cells::distinct("cells", Point3::origin(), at(4e9, 0.0, 0.0), 1.0).is_err());
    }
}
