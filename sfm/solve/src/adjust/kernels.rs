//! The inner loops over small blocks, for every dimension that a block can have.
//!
//! The dimension is a constant in each copy, so that the loops unroll. [`subtract_product`] is the innermost loop of the
//! elimination; its caller is compiled twice, see [`super::schur`].

use super::linearise::{MAX_ROW, ObservationJacobian};

/// Calls a function of one constant parameter with the value of `$dim`, which is at most the last one listed.
macro_rules! with_dimension {
    ($dim:expr, $function:ident $arguments:tt; $($n:literal)*; $last:literal) => {
        match $dim {
            $($n => $function::<$n> $arguments,)*
            _ => $function::<$last> $arguments,
        }
    };
}

/// Adds F^T F (d x d, by columns) and F^T r to `normal`, where F has `d` columns.
#[inline]
pub(super) fn add_view(d: usize, j: &ObservationJacobian, normal: &mut [f64]) {
    if d == 0 {
        return;
    }
    with_dimension!(d, add_view_fixed(j, normal); 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21; 22);
}

#[inline]
fn add_view_fixed<const D: usize>(j: &ObservationJacobian, normal: &mut [f64]) {
    const { assert!(D <= MAX_ROW) };
    let (f0, f1) = (first::<D>(&j.rows[0]), first::<D>(&j.rows[1]));
    let (columns, _) = normal.as_chunks_mut::<D>();
    for k in 0..D {
        add_combination(&mut columns[k], f0, f0[k], f1, f1[k]);
    }
    add_combination(&mut columns[D], f0, j.residual[0], f1, j.residual[1]);
}

/// Adds a x + b y. Through a local copy, which tells the compiler that nothing overlaps.
#[inline(always)]
fn add_combination<const D: usize>(sum: &mut [f64; D], x: &[f64; D], a: f64, y: &[f64; D], b: f64) {
    let mut local = *sum;
    for i in 0..D {
        local[i] += x[i] * a + y[i] * b;
    }
    *sum = local;
}

/// The first D elements.
#[inline(always)]
fn first<const D: usize>(values: &[f64]) -> &[f64; D] {
    &values.as_chunks::<D>().0[0]
}

/// Adds F^T E to W, where F are the `dim` columns of the Jacobian from `start` on.
#[inline]
pub(super) fn add_product(dim: usize, j: &ObservationJacobian, start: usize, w: &mut [f64]) {
    with_dimension!(dim, add_product_fixed(j, start, w); 1 2 3 4 5 6 7 8 9; 10);
}

#[inline]
fn add_product_fixed<const D: usize>(j: &ObservationJacobian, start: usize, w: &mut [f64]) {
    let (f0, f1) = (first::<D>(&j.rows[0][start..]), first::<D>(&j.rows[1][start..]));
    let (columns, _) = w.as_chunks_mut::<D>();
    for k in 0..3 {
        add_combination(&mut columns[k], f0, j.point[0][k], f1, j.point[1][k]);
    }
}

/// Subtracts W Y from the rows at the start of `panel`; W has `dim` rows and stands by columns.
#[inline(always)]
pub(super) fn subtract_product(dim: usize, panel: &mut [f64], stride: usize, w: &[f64], y: &[[f64; 3]]) {
    with_dimension!(dim, subtract_fixed(panel, stride, w, y); 1 2 3 4 5 6 7 8 9; 10);
}

#[inline(always)]
fn subtract_fixed<const D: usize>(panel: &mut [f64], stride: usize, w: &[f64], y: &[[f64; 3]]) {
    let (w, _) = w.as_chunks::<D>();
    let (w0, w1, w2) = (w[0], w[1], w[2]);
    for (k, &[y0, y1, y2]) in y.iter().enumerate() {
        let column = &mut panel[k * stride..k * stride + D].as_chunks_mut::<D>().0[0];
        let mut local = *column;
        for i in 0..D {
            local[i] -= w0[i] * y0 + w1[i] * y1 + w2[i] * y2;
        }
        *column = local;
    }
}
