//! Sampson distance, and its normal equations for any parameters of the matrix.

use super::matches::Matches;
use crate::numeric::minimise::Normal;
use nalgebra::{Matrix3, Vector2, Vector3};

/// Squared Sampson distance of a point pair to the epipolar constraint `x2^T M x1 = 0`: to the first order, the squared
/// distance in the four image coordinates to the nearest pair that satisfies it (Sampson, CGIP 1982; Hartley & Zisserman,
/// *Multiple View Geometry*, 11.4.3).
///
/// NaN where both points are on the epipoles.
#[must_use]
pub fn sampson_squared(m: &Matrix3<f64>, x1: &Vector2<f64>, x2: &Vector2<f64>) -> f64 {
    let mut out = [0.0];
    squared(m, &[x1.x], &[x1.y], &[x2.x], &[x2.y], &mut out);
    out[0]
}

/// [`sampson_squared`] of the pairs from `start` on.
pub(super) fn squared_errors(m: &Matrix3<f64>, matches: &Matches, start: usize, out: &mut [f64]) {
    let end = start + out.len();
    squared(m, &matches.x1[start..end], &matches.y1[start..end], &matches.x2[start..end], &matches.y2[start..end], out);
}

/// Straight-line code over arrays of one length, for the compiler to turn into vector instructions.
fn squared(m: &Matrix3<f64>, x1: &[f64], y1: &[f64], x2: &[f64], y2: &[f64], out: &mut [f64]) {
    let [m00, m01, m02] = [m[(0, 0)], m[(0, 1)], m[(0, 2)]];
    let [m10, m11, m12] = [m[(1, 0)], m[(1, 1)], m[(1, 2)]];
    let [m20, m21, m22] = [m[(2, 0)], m[(2, 1)], m[(2, 2)]];
    let n = out.len();
    let (x1, y1, x2, y2) = (&x1[..n], &y1[..n], &x2[..n], &y2[..n]);
    for i in 0..n {
        let a0 = m00 * x1[i] + m01 * y1[i] + m02;
        let a1 = m10 * x1[i] + m11 * y1[i] + m12;
        let a2 = m20 * x1[i] + m21 * y1[i] + m22;
        let b0 = m00 * x2[i] + m10 * y2[i] + m20;
        let b1 = m01 * x2[i] + m11 * y2[i] + m21;
        let c = x2[i] * a0 + y2[i] * a1 + a2;
        out[i] = c * c / (a0 * a0 + a1 * a1 + b0 * b0 + b1 * b1);
    }
}

/// Signed Sampson distance of a pair, and its derivative with respect to the entries of the matrix.
#[inline]
pub(super) fn residual(m: &Matrix3<f64>, x1: &Vector3<f64>, x2: &Vector3<f64>) -> (f64, Matrix3<f64>) {
    let mut a = m * x1;
    let mut b = m.tr_mul(x2);
    let c = x2.dot(&a);
    a.z = 0.0;
    b.z = 0.0;
    let n = a.norm_squared() + b.norm_squared();
    let s = 1.0 / n.sqrt();
    let q = c / n;
    // d (c / sqrt n) = (dc - (c / n) (a . da + b . db)) / sqrt n, with da = dM x1, db = dM^T x2.
    (c * s, ((x2 - a * q) * x1.transpose() - x2 * (b * q).transpose()) * s)
}

/// Normal equations of the squared Sampson distances, truncated at `max_error`, in parameters whose derivatives of the matrix
/// are `basis`.
pub(super) fn normal_equations<const N: usize>(
    m: &Matrix3<f64>,
    basis: &[Matrix3<f64>; N],
    matches: &Matches,
    indices: impl Iterator<Item = usize>,
    max_error: f64,
) -> Normal<N> {
    let mut normal = Normal::zero();
    let limit = max_error * max_error;
    for i in indices {
        let (r, d_matrix) = residual(m, &matches.first(i), &matches.second(i));
        if r * r < limit {
            normal.add(r, &std::array::from_fn(|k| d_matrix.dot(&basis[k])), 1.0);
            normal.cost += r * r;
        } else {
            normal.cost += limit;
        }
    }
    normal
}
