//! The inverse of a large dense symmetric positive definite matrix, in the memory of its lower half.
//!
//! The matrix is cut into groups of columns. Of each group the rows from its first column on are stored, by columns, one group after the
//! other: the lower half, and the upper half of the blocks on the diagonal. Cholesky factor L, its inverse and their product
//! L^-T L^-1 replace each other in place (the blocked algorithms of LAPACK's potrf, trtri and lauum; Golub & Van Loan, *Matrix
//! computations*, 4.2), in n^3 operations, nearly all of them products of large blocks.
//!
//! Groups are the parallel work. Their size does not depend on the number of threads, and each product runs on one thread: no bit depends
//! on the number of threads.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor;
use faer::linalg::matmul::matmul;
use faer::linalg::{triangular_inverse, triangular_solve};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Rows that a thread solves for at once.
const SOLVED_ROWS: usize = 512;

/// Inverts the matrix of which group g has the columns `starts[g]..starts[g + 1]`, in place. The blocks on the diagonal are then whole.
///
/// Read is what lies on and below the diagonal. `None` when the matrix is not positive definite; the values are then lost.
pub(crate) fn invert(starts: &[usize], values: &mut [f64]) -> Option<()> {
    let n = *starts.last()?;
    let mut columns = Vec::with_capacity(starts.len() - 1);
    let mut rest = values;
    for w in starts.windows(2) {
        let (column, others) = rest.split_at_mut((n - w[0]) * (w[1] - w[0]));
        columns.push(column);
        rest = others;
    }
    factorise(starts, &mut columns)?;
    invert_factor(starts, &mut columns);
    multiply_factor(starts, &mut columns);
    Some(())
}

/// Number of values that are stored.
pub(crate) fn stored(starts: &[usize]) -> usize {
    let n = starts.last().copied().unwrap_or(0);
    starts.windows(2).map(|w| (n - w[0]) * (w[1] - w[0])).sum()
}

/// Rows from the diagonal on, and columns.
fn shape(starts: &[usize], group: usize) -> (usize, usize) {
    (starts[starts.len() - 1] - starts[group], starts[group + 1] - starts[group])
}

/// L with L L^T = A. What stands above the diagonal becomes zero.
fn factorise(starts: &[usize], columns: &mut [&mut [f64]]) -> Option<()> {
    for k in 0..columns.len() {
        let (head, tail) = columns.split_at_mut(k + 1);
        let (rows, width) = shape(starts, k);
        let (mut diagonal, below) = MatMut::from_column_major_slice_mut(head[k], rows, width).split_at_row_mut(width);
        let mut memory = MemBuffer::new(factor::cholesky_in_place_scratch::<f64>(width, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut memory);
        factor::cholesky_in_place(diagonal.rb_mut(), Default::default(), Par::Seq, stack, Default::default()).ok()?;
        for j in 1..width {
            diagonal.rb_mut().col_mut(j).subrows_mut(0, j).fill(0.0);
        }
        // X L^T = A, a band of rows at a time.
        let diagonal = diagonal.rb();
        below.par_row_chunks_mut(SOLVED_ROWS).for_each(|band| {
            triangular_solve::solve_lower_triangular_in_place(diagonal, band.transpose_mut(), Par::Seq);
        });
        let column = MatRef::from_column_major_slice(head[k], rows, width);
        tail.par_iter_mut().with_max_len(1).enumerate().for_each(|(i, other)| {
            let (rows, others) = shape(starts, k + 1 + i);
            let from = column.subrows(starts[k + 1 + i] - starts[k], rows);
            let to = MatMut::from_column_major_slice_mut(other, rows, others);
            matmul(to, Accum::Add, from, from.subrows(0, others).transpose(), -1.0, Par::Seq);
        });
    }
    Some(())
}

/// X = L^-1, a group of rows after the other: `X_ij = -X_ii sum_k L_ik X_kj`.
fn invert_factor(starts: &[usize], columns: &mut [&mut [f64]]) {
    for i in 0..columns.len() {
        let (head, tail) = columns.split_at_mut(i);
        let (first, (rows, width)) = (starts[i], shape(starts, i));
        let mut own = Mat::<f64>::zeros(width, width);
        let mut diagonal = MatMut::from_column_major_slice_mut(&mut *tail[0], rows, width).split_at_row_mut(width).0;
        triangular_inverse::invert_lower_triangular(own.as_mut(), diagonal.rb(), Par::Seq);
        diagonal.copy_from(&own);
        // The rows of L that their inverse will replace.
        let mut old = Mat::<f64>::zeros(width, first);
        for (j, column) in head.iter().enumerate() {
            let (rows, others) = shape(starts, j);
            let column = MatRef::from_column_major_slice(column, rows, others);
            old.as_mut().subcols_mut(starts[j], others).copy_from(column.subrows(first - starts[j], width));
        }
        let (old, own) = (old.as_ref(), own.as_ref());
        head.par_iter_mut().with_max_len(1).enumerate().for_each(|(j, column)| {
            let (rows, others) = shape(starts, j);
            let above = first - starts[j];
            let (done, to) = MatMut::from_column_major_slice_mut(column, rows, others).split_at_row_mut(above);
            let mut sum = Mat::<f64>::zeros(width, others);
            matmul(sum.as_mut(), Accum::Replace, old.subcols(starts[j], above), done.rb(), 1.0, Par::Seq);
            matmul(to.subrows_mut(0, width), Accum::Replace, own, sum.as_ref(), -1.0, Par::Seq);
        });
    }
}

/// X^T X, a group of rows after the other: those above are no longer needed.
fn multiply_factor(starts: &[usize], columns: &mut [&mut [f64]]) {
    for i in 0..columns.len() {
        let (head, tail) = columns.split_at_mut(i);
        let (first, (rows, width)) = (starts[i], shape(starts, i));
        let own = MatRef::from_column_major_slice(&*tail[0], rows, width);
        let product = |other: MatRef<'_, f64>| {
            let mut product = Mat::<f64>::zeros(width, other.ncols());
            matmul(product.as_mut(), Accum::Replace, own.transpose(), other, 1.0, Par::Seq);
            product
        };
        let others = || {
            head.par_iter_mut().with_max_len(1).enumerate().for_each(|(j, column)| {
                let (rows, others) = shape(starts, j);
                let above = first - starts[j];
                let column = MatMut::from_column_major_slice_mut(column, rows, others).split_at_row_mut(above).1;
                let product = product(column.rb());
                column.subrows_mut(0, width).copy_from(&product);
            });
        };
        let (square, ()) = rayon::join(|| product(own), others);
        MatMut::from_column_major_slice_mut(&mut *tail[0], rows, width).subrows_mut(0, width).copy_from(&square);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use nalgebra::DMatrix;

    /// The stored part of a matrix.
    fn pack(starts: &[usize], a: &DMatrix<f64>) -> Vec<f64> {
        let n = a.nrows();
        let column = |j: usize, first: usize| (first..n).map(move |i| a[(i, j)]);
        let values: Vec<f64> = starts.windows(2).flat_map(|w| (w[0]..w[1]).flat_map(move |j| column(j, w[0]))).collect();
        assert_eq!(values.len(), stored(starts));
        values
    }

    fn positive(n: usize, seed: u64) -> DMatrix<f64> {
        let mut random = Random::new(seed);
        let e = DMatrix::from_fn(n, n, |_, _| random.normal());
        &e * e.transpose() + DMatrix::identity(n, n)
    }

    #[test]
    fn the_inverse_is_that_of_dense_algebra() {
        for starts in [&[0, 37][..], &[0, 6, 12, 37], &[0, 1, 30, 36, 37], &[0]] {
            let a = positive(starts[starts.len() - 1], 3);
            let inverse = a.clone().try_inverse().expect("positive definite");
            let mut values = pack(starts, &a);
            // What stands above the diagonal is not read.
            for w in starts.windows(2) {
                let rows = a.nrows() - w[0];
                let first = stored(starts) - stored_from(starts, w[0]);
                (1..w[1] - w[0]).for_each(|j| values[first + j * rows..first + j * rows + j].fill(f64::NAN));
            }
            invert(starts, &mut values).expect("positive definite");
            let error = values.iter().zip(pack(starts, &inverse)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            // Condition below 1e3.
            assert!(error < 1e-12, "{starts:?}: {error}");
        }
    }

    fn stored_from(starts: &[usize], first: usize) -> usize {
        let n = starts[starts.len() - 1];
        starts.windows(2).filter(|w| w[0] >= first).map(|w| (n - w[0]) * (w[1] - w[0])).sum()
    }

    #[test]
    fn an_indefinite_matrix_has_none() {
        let mut a = positive(12, 5);
        a[(9, 9)] = -1.0;
        assert_eq!(invert(&[0, 4, 12], &mut pack(&[0, 4, 12], &a)), None);
    }

    #[test]
    fn threads_change_no_bit() {
        let starts: Vec<usize> = (0..=8).map(|g| 75 * g).collect();
        let a = pack(&starts, &positive(600, 7));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let mut values = a.clone();
            pool.install(|| invert(&starts, &mut values)).expect("positive definite");
            values
        };
        assert!(on(1) == on(2) && on(1) == on(5));
    }
}
