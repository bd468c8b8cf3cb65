//! The inverse of the reduced system: that of a sparse one where it has blocks, that of a dense one whole.

use super::layout::Layout;
use super::pattern::{Kind, Pattern};
use super::schur::Reduced;
use super::solve_reduced::analyse;
use crate::numeric::packed_inverse;
use nalgebra::{DMatrix, Matrix3, Matrix6};
use rayon::prelude::*;

/// Columns of the inverse of a sparse system that are solved for at once.
const BATCH: usize = 48;
/// A parameter of which the others explain all but this share of its weight is not determined: the world floats.
const SINGULAR_SHARE: f64 = 1e-12;

/// The blocks of the inverse, in the panels of the system.
pub(super) struct Inverse {
    pattern: Pattern,
    values: Vec<f64>,
}

impl Inverse {
    /// `None` when the system does not determine all parameters, or is one of conjugate gradients.
    pub fn new(layout: &Layout, reduced: Reduced) -> Option<Self> {
        let Reduced { pattern, mut values, .. } = reduced;
        let weights = diagonal(layout, &pattern, &values);
        match &pattern.kind {
            Kind::Dense(groups) => packed_inverse::invert(&groups.starts, &mut values)?,
            Kind::Sparse(_) => values = of_sparse(layout, &pattern, &values)?,
            Kind::Clusters(_) => return None,
        }
        // The part of each parameter that the others do not explain, against all of it.
        let is_told = |(variance, weight): (f64, f64)| variance > 0.0 && variance.is_finite() && variance * weight * SINGULAR_SHARE < 1.0;
        let variances = diagonal(layout, &pattern, &values);
        variances.into_iter().zip(weights).all(is_told).then_some(Self { pattern, values })
    }

    /// Where the block of the rows of `b` and the columns of `a`, which is not behind `b`, begins, and its stride.
    fn block(&self, a: usize, b: usize) -> Option<(usize, usize)> {
        Some((self.pattern.panel_start[a] + self.pattern.row(a, b as u32)?, self.pattern.stride[a]))
    }

    /// v^T Cov u, for parts v and u of two blocks that meet.
    pub fn product(&self, (a, u): (usize, &[f64]), (b, v): (usize, &[f64])) -> f64 {
        let ((low, of_low), (high, of_high)) = if a <= b { ((a, u), (b, v)) } else { ((b, v), (a, u)) };
        let Some((start, stride)) = self.block(low, high) else { return 0.0 };
        let column = |j: usize| of_high.iter().zip(&self.values[start + j * stride..]).map(|(v, c)| v * c).sum::<f64>();
        of_low.iter().enumerate().map(|(j, u)| u * column(j)).sum()
    }

    /// V^T Cov U of two blocks that meet, b not before a, and three columns each.
    pub fn weighted(&self, a: usize, u: &[f64], b: usize, v: &[f64]) -> Matrix3<f64> {
        let Some((start, stride)) = self.block(a, b) else { return Matrix3::zeros() };
        let (dim_a, dim_b) = (u.len() / 3, v.len() / 3);
        let mut product = Matrix3::zeros();
        for j in 0..dim_a {
            let column = &self.values[start + j * stride..][..dim_b];
            for i in 0..3 {
                let sum: f64 = v[i * dim_b..(i + 1) * dim_b].iter().zip(column).map(|(v, c)| v * c).sum();
                for k in 0..3 {
                    product[(i, k)] += sum * u[k * dim_a + j];
                }
            }
        }
        product
    }

    /// [`Inverse::between`] of two frames.
    pub fn of_frames(&self, layout: &Layout, a: usize, b: usize) -> Option<Matrix6<f64>> {
        debug_assert!(layout.dim(a) == 6 && layout.dim(b) == 6);
        let (start, stride) = self.block(a, b)?;
        Some(Matrix6::from_fn(|i, j| self.values[start + j * stride + i]))
    }

    /// The block of the rows of `b` and the columns of `a`, which is not behind `b`.
    pub fn between(&self, layout: &Layout, a: usize, b: usize) -> Option<DMatrix<f64>> {
        let (start, stride) = self.block(a, b)?;
        Some(DMatrix::from_fn(layout.dim(b), layout.dim(a), |i, j| self.values[start + j * stride + i]))
    }
}

/// The diagonal of a matrix in panels.
fn diagonal(layout: &Layout, pattern: &Pattern, values: &[f64]) -> Vec<f64> {
    let of = |a: usize| {
        let first = pattern.panel_start[a] + pattern.diagonal_row(a);
        (0..layout.dim(a)).map(move |j| values[first + j * (pattern.stride[a] + 1)])
    };
    (0..layout.block_count()).flat_map(of).collect()
}

/// The blocks of the inverse of a sparse system where that has any, by its columns.
fn of_sparse(layout: &Layout, pattern: &Pattern, values: &[f64]) -> Option<Vec<f64>> {
    let Kind::Sparse(rows) = &pattern.kind else { return None };
    let n = layout.unknowns();
    let mut cholesky = analyse(layout, pattern, rows)?;
    cholesky.solve(values, &mut vec![0.0; n])?;
    let mut batches = vec![0];
    for a in 0..layout.block_count() {
        if layout.offsets[a + 1] - layout.offsets[batches[batches.len() - 1]] >= BATCH || a + 1 == layout.block_count() {
            batches.push(a + 1);
        }
    }
    // The columns of some blocks, of which the rows of their panels are kept.
    let of_batch = |w: &[usize]| -> Option<Vec<f64>> {
        let (first, columns) = (layout.offsets[w[0]], layout.offsets[w[1]] - layout.offsets[w[0]]);
        let mut x = vec![0.0; n * columns];
        (0..columns).for_each(|j| x[j * n + first + j] = 1.0);
        cholesky.solve_again(&mut x, columns)?;
        let mut panels = Vec::with_capacity(pattern.panel_start[w[1]] - pattern.panel_start[w[0]]);
        for a in w[0]..w[1] {
            for j in 0..layout.dim(a) {
                let column = &x[(layout.offsets[a] + j - first) * n..][..n];
                let blocks = rows.rows[rows.rows_start[a]..rows.rows_start[a + 1]].iter().map(|r| r.0 as usize);
                blocks.for_each(|b| panels.extend_from_slice(&column[layout.offsets[b]..layout.offsets[b + 1]]));
            }
        }
        Some(panels)
    };
    let panels: Vec<Option<Vec<f64>>> = batches.par_windows(2).map(of_batch).collect();
    let mut inverse = Vec::with_capacity(pattern.len());
    for panel in panels {
        inverse.extend(panel?);
    }
    Some(inverse)
}
