//! Null spaces of small systems with fewer equations than unknowns.

/// An orthonormal basis of the null space of `rows` (R equations in C > R unknowns): the last C - R columns of Q in the
/// Householder QR decomposition of the transpose, with pivoting by norm (Golub & Van Loan, *Matrix Computations*, 5.4.2).
///
/// `None` when the equations are dependent: the last pivot is below `1e-10` of the first (three correspondences on top of
/// each other, say, or values that are not finite). `K` must be C - R.
pub(crate) fn null_space<const R: usize, const C: usize, const K: usize>(mut rows: [[f64; C]; R]) -> Option<[[f64; C]; K]> {
    const { assert!(R + K == C) };
    let mut reflectors = [[0.0; C]; R];
    let mut first_pivot = 0.0;
    for step in 0..R {
        let tail = |row: &[f64; C]| row[step..].iter().map(|x| x * x).sum::<f64>();
        let (pivot, norm_squared) =
            (step..R).map(|i| (i, tail(&rows[i]))).fold((step, -1.0), |best, next| if next.1 > best.1 { next } else { best });
        rows.swap(step, pivot);
        let norm = norm_squared.sqrt();
        if step == 0 {
            first_pivot = norm;
        }
        if !(norm > 1e-10 * first_pivot && norm.is_finite()) {
            return None;
        }
        let mut v = [0.0; C];
        v[step..].copy_from_slice(&rows[step][step..]);
        v[step] += norm.copysign(v[step]);
        let scale = (2.0 / v.iter().map(|x| x * x).sum::<f64>()).sqrt();
        v.iter_mut().for_each(|x| *x *= scale);
        for row in &mut rows[step + 1..] {
            reflect(row, &v);
        }
        reflectors[step] = v;
    }
    let mut basis = [[0.0; C]; K];
    for (k, vector) in basis.iter_mut().enumerate() {
        vector[R + k] = 1.0;
        for v in reflectors.iter().rev() {
            reflect(vector, v);
        }
    }
    Some(basis)
}

/// x - v (v . x), where |v|^2 = 2.
fn reflect<const C: usize>(x: &mut [f64; C], v: &[f64; C]) {
    let dot: f64 = x.iter().zip(v).map(|(a, b)| a * b).sum();
    x.iter_mut().zip(v).for_each(|(a, b)| *a -= dot * b);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn dependent_or_bad_equations_have_no_basis() {
        let row = [1.0, 2.0, 3.0, 4.0];
        assert!(null_space::<2, 4, 2>([row, row.map(|x| -3.0 * x)]).is_none());
        assert!(null_space::<2, 4, 2>([row, [f64::NAN; 4]]).is_none());
        assert!(null_space::<2, 4, 2>([[0.0; 4]; 2]).is_none());
    }

    proptest! {
        #[test]
        fn basis_is_orthonormal_and_in_the_null_space(rows in prop::array::uniform5(prop::array::uniform9(-1.0..1.0f64))) {
            let basis: [[f64; 9]; 4] = null_space(rows).unwrap();
            let dot = |a: &[f64; 9], b: &[f64; 9]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            for (i, a) in basis.iter().enumerate() {
                for (j, b) in basis.iter().enumerate() {
                    prop_assert!((dot(a, b) - f64::from(u8::from(i == j))).abs() < 1e-14);
                }
                for row in &rows {
                    prop_assert!(dot(a, row).abs() < 1e-14);
                }
            }
        }
    }
}
