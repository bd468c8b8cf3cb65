//! Solution of the reduced system: Cholesky factorisation by faer, dense or sparse with one symbolic analysis for all iterations, or
//! conjugate gradients.
//!
//! Everything runs on one thread: faer's single-column solve gives other bits on several, and its sparse factorisation
//! is slower there.

use super::conjugate::{Conjugate, System};
use super::error::AdjustError;
use super::layout::Layout;
use super::pattern::{Kind, Pattern, SparsePattern};
use super::schur::Reduced;
use crate::numeric::sparse_cholesky::SparseCholesky;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, solve};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::SymmetricOrdering;
use faer::{MatMut, Par};

/// Symbolic analysis and workspace.
pub(super) enum Solver {
    Dense(MemBuffer),
    Sparse(SparseCholesky),
    Conjugate(Conjugate),
}

impl Solver {
    pub fn new(layout: &Layout, pattern: &Pattern) -> Result<Self, AdjustError> {
        let unknowns = layout.unknowns();
        let out_of_memory = AdjustError::OutOfMemory { unknowns };
        match &pattern.kind {
            Kind::Dense(_) => {
                let request = factor::cholesky_in_place_scratch::<f64>(unknowns, Par::Seq, Default::default());
                MemBuffer::try_new(request).map(Self::Dense).map_err(|_| out_of_memory)
            }
            Kind::Sparse(rows) => analyse(layout, pattern, rows).map(Self::Sparse).ok_or(out_of_memory),
            Kind::Clusters(clusters) => Ok(Self::Conjugate(Conjugate::new(layout, clusters))),
        }
    }

    /// Turns the right-hand side of `reduced` into the step; false when the matrix is not positive definite.
    pub fn solve(&mut self, system: &System<'_>, reduced: &mut Reduced) -> bool {
        let n = reduced.rhs.len();
        if n == 0 {
            return true;
        }
        match self {
            Self::Dense(workspace) => {
                let stack = MemStack::new(workspace);
                let rhs = MatMut::from_column_major_slice_mut(&mut reduced.rhs, n, 1);
                let mut matrix = MatMut::from_column_major_slice_mut(&mut reduced.values, n, n);
                if factor::cholesky_in_place(matrix.as_mut(), Default::default(), Par::Seq, stack, Default::default()).is_err() {
                    return false;
                }
                solve::solve_in_place(matrix.as_ref(), rhs, Par::Seq, stack);
            }
            Self::Sparse(sparse) => {
                if sparse.solve(&reduced.values, &mut reduced.rhs).is_none() {
                    return false;
                }
            }
            Self::Conjugate(conjugate) => {
                if !conjugate.solve(system, reduced) {
                    return false;
                }
            }
        }
        reduced.rhs.iter().all(|d| d.is_finite())
    }
}

/// The panels as compressed columns: the values of a column of a panel stand one after the other. Those above the
/// diagonal inside a diagonal block are stored and ignored.
pub(super) fn analyse(layout: &Layout, pattern: &Pattern, rows: &SparsePattern) -> Option<SparseCholesky> {
    let n = layout.unknowns();
    let mut column_start = vec![0];
    let mut row_index = Vec::with_capacity(pattern.len());
    for a in 0..layout.block_count() {
        for _ in 0..layout.dim(a) {
            for &(b, _) in &rows.rows[rows.rows_start[a]..rows.rows_start[a + 1]] {
                row_index.extend(layout.offsets[b as usize]..layout.offsets[b as usize + 1]);
            }
            column_start.push(row_index.len());
        }
    }
    let order = rows.unknown_order(layout);
    let mut inverse = vec![0; n];
    order.iter().enumerate().for_each(|(i, &u)| inverse[u] = i);
    let order = SymmetricOrdering::Custom(PermRef::new_checked(&order, &inverse, n));
    SparseCholesky::new(column_start, row_index, order, 1)
}
