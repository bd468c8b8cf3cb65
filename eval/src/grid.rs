//! Points sorted into cubic cells, for counts within a radius and for occupied cells.

use crate::EvalError;
use nalgebra::Point3;
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
    /// Cells of `size`, one of them centred on `min`. What lies more than 2^21 cells away counts as being in the last ones,
    /// which costs time but no count, since all distances are checked.
    pub fn new(min: Point3<f64>, size: f64) -> Self {
        // A cell of margin: each cell has neighbours, and a flat reference does not lie on a border of cells.
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

    pub fn size(&self) -> f64 {
        self.size
    }
}

fn key([x, y, z]: [u64; 3]) -> u64 {
    x | y << 21 | z << 42
}

/// Points in the order of their cells.
pub(crate) struct PointGrid {
    cells: Cells,
    keys: Vec<u64>,
    points: Vec<Point3<f64>>,
}

impl PointGrid {
    /// Sorts points into cells whose size is the largest radius to be asked for. No point lies below the first cell.
    pub fn new(points: &[Point3<f64>], cells: Cells) -> Self {
        let mut order: Vec<(u64, u32)> = points.par_iter().enumerate().map(|(i, p)| (cells.key(p), i as u32)).collect();
        order.par_sort_unstable();
        let (keys, points) = order.into_iter().map(|(key, i)| (key, points[i as usize])).unzip();
        Self { cells, keys, points }
    }

    /// Points in the order of their cells.
    pub fn points(&self) -> &[Point3<f64>] {
        &self.points
    }

    /// The runs of points in the 27 cells around `p`: three cells along x are one run.
    fn around(&self, p: &Point3<f64>) -> impl Iterator<Item = &[Point3<f64>]> {
        let [x, y, z] = self.cells.cell(p);
        let last = (1 << 21) - 1;
        let (x, y, z) = (x.clamp(1, last - 1), y.clamp(1, last - 1), z.clamp(1, last - 1));
        (0..9).map(move |i| {
            let (y, z) = (y - 1 + i % 3, z - 1 + i / 3);
            let from = self.keys.partition_point(|&k| k < key([x - 1, y, z]));
            let count = self.keys[from..].partition_point(|&k| k <= key([x + 1, y, z]));
            &self.points[from..from + count]
        })
    }

    /// Number of points within `radius`, at most the size of a cell.
    pub fn count_within(&self, p: &Point3<f64>, radius: f64) -> usize {
        let squared = radius * radius;
        self.around(p).map(|run| run.iter().filter(|q| (*q - p).norm_squared() <= squared).count()).sum()
    }

    /// Whether there is a point within `radius`, at most the size of a cell.
    pub fn any_within(&self, p: &Point3<f64>, radius: f64) -> bool {
        let squared = radius * radius;
        self.around(p).any(|run| run.iter().any(|q| (q - p).norm_squared() <= squared))
    }
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
    use crate::morton::bounds;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn counts_equal_brute_force(points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 1..60), q in prop::array::uniform3(-1.3..1.3f64), size in 0.05..1.0f64, share in 0.1..1.0f64) {
            let points: Vec<_> = points.into_iter().map(Point3::from).collect();
            let min = bounds(&points).0;
            let grid = PointGrid::new(&points, Cells::new(min, size));
            for q in points.iter().copied().chain([Point3::from(q)]) {
                let expected = points.iter().filter(|p| (*p - q).norm() <= share * size).count();
                // Points outside the box are beyond every radius or in the margin.
                prop_assert_eq!(grid.count_within(&q, share * size), expected);
                prop_assert_eq!(grid.any_within(&q, share * size), expected > 0);
            }
        }
    }

    #[test]
    fn far_points_keep_their_neighbours() {
        let far: Vec<_> = [0.0, 1.0, 1e9, 1e9 + 0.5, 2e9].map(|x| Point3::new(x, 0.0, -x)).to_vec();
        let grid = PointGrid::new(&far, Cells::new(bounds(&far).0, 1.0));
        let counts: Vec<_> = far.iter().map(|p| grid.count_within(p, 1.0)).collect();
        assert_eq!(counts, [1, 1, 2, 2, 1]);
        assert!(Cells::distinct("cells", Point3::origin(), far[4], 1.0).is_err());
    }
}
