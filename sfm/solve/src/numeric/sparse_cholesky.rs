//! Sparse Cholesky factorisation by faer, with one symbolic analysis for all matrices of a pattern.
//!
//! Everything runs on one thread: faer's sparse factorisation is slower on two, and its single-column solve gives other bits.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// A pattern, its symbolic analysis, the factor of the last matrix, and workspace.
pub(crate) struct SparseCholesky {
    /// Where each column begins in the values, and the end.
    pub column_start: Vec<usize>,
    row_index: Vec<usize>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    workspace: MemBuffer,
    /// Number of right-hand sides.
    count: usize,
}

impl SparseCholesky {
    /// Analyses a pattern in compressed columns, rows ascending in each; elements above the diagonal are ignored. `count`
    /// is the number of right-hand sides. `None` when memory runs out.
    pub fn new(column_start: Vec<usize>, row_index: Vec<usize>, order: SymmetricOrdering<'_, usize>, count: usize) -> Option<Self> {
        let n = column_start.len() - 1;
        let structure = SymbolicSparseColMatRef::new_checked(n, n, &column_start, None, &row_index);
        let symbolic = factorize_symbolic_cholesky(structure, Side::Lower, order, CholeskySymbolicParams::default()).ok()?;
        let request = StackReq::or(
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<f64>(count, Par::Seq),
        );
        let workspace = MemBuffer::try_new(request).ok()?;
        let factor = vec![0.0; symbolic.len_val()];
        Some(Self { column_start, row_index, symbolic, factor, workspace, count })
    }

    /// Number of values of a matrix of the pattern.
    pub fn value_count(&self) -> usize {
        self.row_index.len()
    }

    /// Factorises the matrix of these values and solves for the right-hand sides, by columns, in place; `None` when it is not positive
    /// definite. Allocates nothing.
    pub fn solve(&mut self, values: &[f64], columns: &mut [f64]) -> Option<()> {
        let n = self.column_start.len() - 1;
        let structure = SymbolicSparseColMatRef::new_checked(n, n, &self.column_start, None, &self.row_index);
        let matrix = SparseColMatRef::new(structure, values);
        let (factor, stack) = (&mut self.factor, MemStack::new(&mut self.workspace));
        let factored =
            self.symbolic.factorize_numeric_llt(factor, matrix, Side::Lower, Default::default(), Par::Seq, stack, Default::default());
        let factor: LltRef<'_, usize, f64> = factored.ok()?;
        let rhs = MatMut::from_column_major_slice_mut(columns, n, self.count);
        factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut self.workspace));
        Some(())
    }

    /// Solves with the factor of the last matrix for `count` more right-hand sides; `None` when memory runs out.
    pub fn solve_again(&self, columns: &mut [f64], count: usize) -> Option<()> {
        let n = self.column_start.len() - 1;
        let mut memory = MemBuffer::try_new(self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq)).ok()?;
        let rhs = MatMut::from_column_major_slice_mut(columns, n, count);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut memory));
        Some(())
    }
}
