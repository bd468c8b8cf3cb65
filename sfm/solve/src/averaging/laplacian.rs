//! Weighted graph Laplacians: sum over the edges of w |x_b - x_a - d|^2, with the first node held.

use crate::numeric::sparse_cholesky::SparseCholesky;
use faer::sparse::linalg::cholesky::SymmetricOrdering;

/// The symbolic analysis of a graph, and workspace.
pub(super) struct Laplacian {
    nodes: usize,
    edges: Vec<(usize, usize)>,
    /// Where each edge's element below the diagonal is stored; none where it meets the held node.
    place: Vec<Option<usize>>,
    values: Vec<f64>,
    cholesky: SparseCholesky,
}

impl Laplacian {
    /// `None` when there is not enough memory. Edges of a node with itself are not allowed.
    pub fn new(nodes: usize, edges: Vec<(usize, usize)>) -> Option<Self> {
        // Node i + 1 is unknown i; columns hold the diagonal first.
        let n = nodes - 1;
        let mut columns: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).collect();
        for &(a, b) in &edges {
            let (low, high) = (a.min(b), a.max(b));
            if low > 0 {
                columns[low - 1].push(high - 1);
            }
        }
        let (mut column_start, mut row_index) = (vec![0], Vec::new());
        for column in &mut columns {
            column.sort_unstable();
            column.dedup();
            row_index.extend_from_slice(column);
            column_start.push(row_index.len());
        }
        let place = |&(a, b): &(usize, usize)| {
            let (low, high) = (a.min(b), a.max(b));
            let column = low.checked_sub(1)?;
            let rows = &row_index[column_start[column]..column_start[column + 1]];
            Some(column_start[column] + rows.partition_point(|&r| r < high - 1))
        };
        let place = edges.iter().map(place).collect();
        let cholesky = SparseCholesky::new(column_start, row_index, SymmetricOrdering::Amd, 3)?;
        Some(Self { nodes, edges, place, values: vec![0.0; cholesky.value_count()], cholesky })
    }

    /// Minimises the sum for each of three coordinates; `None` when the weights do not connect the nodes.
    pub fn solve(&mut self, weights: &[f64], differences: &[[f64; 3]]) -> Option<Vec<[f64; 3]>> {
        let n = self.nodes - 1;
        let mut rhs = vec![0.0; 3 * n];
        self.values.fill(0.0);
        for (((&(a, b), place), &w), d) in self.edges.iter().zip(&self.place).zip(weights).zip(differences) {
            if let Some(place) = place {
                self.values[*place] -= w;
            }
            for (node, sign) in [(a, -1.0), (b, 1.0)] {
                let Some(i) = node.checked_sub(1) else { continue };
                self.values[self.cholesky.column_start[i]] += w;
                for k in 0..3 {
                    rhs[k * n + i] += sign * w * d[k];
                }
            }
        }
        self.cholesky.solve(&self.values, &mut rhs)?;
        let node = |i: usize| if i == 0 { [0.0; 3] } else { [0, 1, 2].map(|k| rhs[k * n + i - 1]) };
        let found: Vec<[f64; 3]> = (0..self.nodes).map(node).collect();
        found.iter().flatten().all(|x| x.is_finite()).then_some(found)
    }
}
