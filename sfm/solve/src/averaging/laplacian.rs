//! Weighted graph Laplacians: sum over the edges of w |x_b - x_a - d|^2, with the first node held.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// The symbolic analysis of a graph, and workspace.
pub(super) struct Laplacian {
    nodes: usize,
    edges: Vec<(usize, usize)>,
    column_start: Vec<usize>,
    row_index: Vec<usize>,
    /// Where each edge's element below the diagonal is stored; none where it meets the held node.
    place: Vec<Option<usize>>,
    values: Vec<f64>,
    factor: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    memory: MemBuffer,
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
        let structure = SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &row_index);
        let symbolic =
            factorize_symbolic_cholesky(structure, Side::Lower, SymmetricOrdering::Amd, CholeskySymbolicParams::default()).ok()?;
        let request = StackReq::or(
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<f64>(3, Par::Seq),
        );
        let memory = MemBuffer::try_new(request).ok()?;
        let (values, factor) = (vec![0.0; row_index.len()], vec![0.0; symbolic.len_val()]);
        Some(Self { nodes, edges, column_start, row_index, place, values, factor, symbolic, memory })
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
                self.values[self.column_start[i]] += w;
                for k in 0..3 {
                    rhs[k * n + i] += sign * w * d[k];
                }
            }
        }
        let structure = SymbolicSparseColMatRef::new_checked(n, n, &self.column_start, None, &self.row_index);
        let matrix = SparseColMatRef::new(structure, &self.values);
        let stack = MemStack::new(&mut self.memory);
        let factored = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            matrix,
            Side::Lower,
            Default::default(),
            Par::Seq,
            stack,
            Default::default(),
        );
        let factor: LltRef<'_, usize, f64> = factored.ok()?;
        let stack = MemStack::new(&mut self.memory);
        factor.solve_in_place_with_conj(Conj::No, MatMut::from_column_major_slice_mut(&mut rhs, n, 3), Par::Seq, stack);
        let node = |i: usize| if i == 0 { [0.0; 3] } else { [0, 1, 2].map(|k| rhs[k * n + i - 1]) };
        let found: Vec<[f64; 3]> = (0..self.nodes).map(node).collect();
        found.iter().flatten().all(|x| x.is_finite()).then_some(found)
    }
}
