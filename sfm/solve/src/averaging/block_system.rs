//! A symmetric positive definite system of 3 x 3 blocks between nodes that share a point.

use crate::numeric::sparse_cholesky::SparseCholesky;
use faer::sparse::linalg::cholesky::SymmetricOrdering;
use nalgebra::{Matrix3, Vector3};

/// The pattern, its symbolic analysis, and values.
pub(super) struct BlockSystem {
    values: Vec<f64>,
    /// Nodes of each point, and for each pair i, j of them where the block begins in the first of its three columns; none above the
    /// diagonal.
    groups: Vec<(usize, usize)>,
    places: Vec<Option<(usize, usize)>>,
    cholesky: SparseCholesky,
}

impl BlockSystem {
    /// The system of the nodes that meet in the given groups. `None` when memory runs out.
    pub fn new<G: Iterator<Item = usize>>(nodes: usize, groups: impl Iterator<Item = G>) -> Option<Self> {
        let groups: Vec<Vec<usize>> = groups.map(Iterator::collect).collect();
        let mut columns: Vec<Vec<usize>> = (0..nodes).map(|i| vec![i]).collect();
        for group in &groups {
            for &a in group {
                columns[a].extend(group.iter().copied().filter(|&b| b > a));
            }
        }
        let (mut column_start, mut row_index) = (vec![0], Vec::new());
        for column in &mut columns {
            column.sort_unstable();
            column.dedup();
            for _ in 0..3 {
                row_index.extend(column.iter().flat_map(|&b| 3 * b..3 * b + 3));
                column_start.push(row_index.len());
            }
        }
        let mut places = Vec::new();
        let mut spans = Vec::with_capacity(groups.len());
        for group in &groups {
            spans.push((places.len(), group.len()));
            for &b in group {
                for &a in group {
                    // Block of the rows of b and the columns of a.
                    let place = (b >= a).then(|| (3 * a, 3 * columns[a].partition_point(|&row| row < b)));
                    places.push(place);
                }
            }
        }
        let cholesky = SparseCholesky::new(column_start, row_index, SymmetricOrdering::Amd, 1)?;
        Some(Self { values: vec![0.0; cholesky.value_count()], groups: spans, places, cholesky })
    }

    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds a block between the i-th and the j-th node of a group; those above the diagonal are left out.
    pub fn add(&mut self, group: usize, i: usize, j: usize, block: &Matrix3<f64>) {
        let (first, len) = self.groups[group];
        if let Some((column, offset)) = self.places[first + i * len + j] {
            for c in 0..3 {
                let at = self.cholesky.column_start[column + c] + offset;
                for r in 0..3 {
                    self.values[at + r] += block[(r, c)];
                }
            }
        }
    }

    /// Solves (A + diag(added)) x = rhs; `None` when that is not positive definite.
    pub fn solve(&mut self, added: &[Vector3<f64>], rhs: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
        for (node, added) in added.iter().enumerate() {
            for c in 0..3 {
                // The diagonal block stands first in its columns.
                self.values[self.cholesky.column_start[3 * node + c] + c] += added[c];
            }
        }
        let mut x: Vec<f64> = rhs.iter().flat_map(|v| v.iter().copied()).collect();
        self.cholesky.solve(&self.values, &mut x)?;
        x.iter().all(|v| v.is_finite()).then(|| x.as_chunks::<3>().0.iter().map(|&v| Vector3::from(v)).collect())
    }
}
