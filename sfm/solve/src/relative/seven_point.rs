//! Fundamental matrix from seven point pairs.

use crate::numeric::null_space::null_space;
use crate::numeric::polynomial::real_roots;
use nalgebra::{Matrix3, Vector2};

/// Appends the fundamental matrices, up to three, that satisfy `x2^T F x1 = 0` for seven pairs.
///
/// F is sought in the null space of the seven linear equations as `F0 + z F1`; `det F = 0` is a cubic in z (Hartley & Zisserman,
/// *Multiple View Geometry*, 11.1.2). Scaled to a Frobenius norm of 1, the sign is free. Coordinates should be
/// conditioned, of size about 1. Degenerate: six or more points of one plane, pure rotation, dependent equations (no
/// solution is appended when the equations themselves are dependent). The solution at infinite z is left out.
pub fn seven_point(x1: &[Vector2<f64>; 7], x2: &[Vector2<f64>; 7], out: &mut Vec<Matrix3<f64>>) {
    let rows: [[f64; 9]; 7] = std::array::from_fn(|k| {
        let (a, b) = (&x1[k], &x2[k]);
        [b.x * a.x, b.x * a.y, b.x, b.y * a.x, b.y * a.y, b.y, a.x, a.y, 1.0]
    });
    let Some(basis) = null_space::<7, 9, 2>(rows) else {
        return;
    };
    let [f0, f1] = basis.map(|v| Matrix3::from_row_slice(&v));
    let cubic = [f0.determinant(), cofactor(&f0).dot(&f1), cofactor(&f1).dot(&f0), f1.determinant()];
    real_roots(&cubic, |z| {
        let f = f0 + z * f1;
        // The basis is orthonormal, so that the norm is at least 1.
        out.push(f / f.norm());
    });
}

/// The derivative of the determinant.
fn cofactor(m: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b, c) = (m.row(0).transpose(), m.row(1).transpose(), m.row(2).transpose());
    Matrix3::from_rows(&[b.cross(&c).transpose(), c.cross(&a).transpose(), a.cross(&b).transpose()])
}
