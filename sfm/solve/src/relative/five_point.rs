//! Essential matrix from five point pairs.

use crate::numeric::null_space::null_space;
use crate::numeric::polynomial::real_roots;
use nalgebra::{Matrix3, Vector2, Vector3};

/// Product of two of x, y, z, 1 as index into x2, xy, xz, x, y2, yz, y, z2, z, 1.
const QUADRATIC: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];
/// Product of one of those with x, y, z, 1 as index into Nister's order: x3, y3, x2y, xy2, x2z, x2, y2z, y2, xyz, xy,
/// xz2, xz, x, yz2, yz, y, z3, z2, z, 1.
const CUBIC: [[usize; 4]; 10] = [
    [0, 2, 4, 5],
    [2, 3, 8, 9],
    [4, 8, 10, 11],
    [5, 9, 11, 12],
    [3, 1, 6, 7],
    [8, 6, 13, 14],
    [9, 7, 14, 15],
    [10, 13, 16, 17],
    [11, 14, 17, 18],
    [12, 15, 18, 19],
];

/// Gauss-Newton steps on each solution.
const POLISH_STEPS: usize = 2;

type Linear = [f64; 4];
type Quadratic = [f64; 10];
type Cubic = [f64; 20];

/// Appends the essential matrices, up to ten, that satisfy `x2^T E x1 = 0` for five pairs in normalised coordinates.
///
/// Nister, *An efficient solution to the five-point relative pose problem*, PAMI 2004: E is sought in the null space of the five
/// linear equations as x X + y Y + z Z + W; `det E = 0` and `2 E E^T E = tr(E E^T) E` are ten cubics, whose elimination leaves
/// a polynomial of degree ten in z. Scaled to a Frobenius norm of sqrt 2 (unit translation), the sign is free.
/// Degenerate: equal pairs and other dependent equations (no solution is appended); for points of one plane
/// a second solution exists, for pure rotation any translation fits. With a baseline of a fiftieth
/// of the depth about 3 % of random samples lose the true solution in the elimination (20 % when they lie in a plane). Does not check that points lie in front of the cameras.
pub fn five_point(x1: &[Vector2<f64>; 5], x2: &[Vector2<f64>; 5], out: &mut Vec<Matrix3<f64>>) {
    let rows: [[f64; 9]; 5] = std::array::from_fn(|k| {
        let (a, b) = (&x1[k], &x2[k]);
        [b.x * a.x, b.x * a.y, b.x, b.y * a.x, b.y * a.y, b.y, a.x, a.y, 1.0]
    });
    let Some(basis) = null_space::<5, 9, 4>(rows) else {
        return;
    };
    let constraints = constraints(&basis);
    let Some(rows) = eliminate(constraints) else {
        return;
    };
    // Rows 4 to 9 lead with x2z, x2, y2z, y2, xyz, xy: each pair gives a row without these, in x, y, 1 over polynomials in z.
    let b: [ZRow; 3] = std::array::from_fn(|k| ZRow::difference(&rows[4 + 2 * k], &rows[5 + 2 * k]));
    let determinant = determinant(&b);
    real_roots(&determinant, |z| {
        let at: [Vector3<f64>; 3] = std::array::from_fn(|k| b[k].at(z));
        let candidates = [at[0].cross(&at[1]), at[0].cross(&at[2]), at[1].cross(&at[2])];
        let null = candidates.into_iter().fold(Vector3::zeros(), |best: Vector3<f64>, c| if c.z.abs() > best.z.abs() { c } else { best });
        let [x, y, z] = polished([null.x / null.z, null.y / null.z, z], &constraints);
        let e: [f64; 9] = std::array::from_fn(|i| x * basis[0][i] + y * basis[1][i] + z * basis[2][i] + basis[3][i]);
        let e = Matrix3::from_row_slice(&e);
        let norm = e.norm();
        if norm.is_finite() && norm > 0.0 {
            out.push(e * (std::f64::consts::SQRT_2 / norm));
        }
    });
}

/// Gauss-Newton on the ten cubics: the elimination loses up to half of the digits where its pivots are small.
fn polished(mut at: [f64; 3], constraints: &[Cubic; 10]) -> [f64; 3] {
    let mut previous = f64::INFINITY;
    let mut best = at;
    for _ in 0..=POLISH_STEPS {
        let [x, y, z] = at;
        let (xx, yy, zz, xy, xz, yz) = (x * x, y * y, z * z, x * y, x * z, y * z);
        let monomials =
            [xx * x, yy * y, xx * y, x * yy, xx * z, xx, yy * z, yy, xy * z, xy, x * zz, xz, x, y * zz, yz, y, zz * z, zz, z, 1.0];
        let d_x = [3.0 * xx, 0.0, 2.0 * xy, yy, 2.0 * xz, 2.0 * x, 0.0, 0.0, yz, y, zz, z, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let d_y = [0.0, 3.0 * yy, xx, 2.0 * xy, 0.0, 0.0, 2.0 * yz, 2.0 * y, xz, x, 0.0, 0.0, 0.0, zz, z, 1.0, 0.0, 0.0, 0.0, 0.0];
        let d_z = [0.0, 0.0, 0.0, 0.0, xx, 0.0, yy, 0.0, xy, 0.0, 2.0 * xz, x, 0.0, 2.0 * yz, y, 0.0, 3.0 * zz, 2.0 * z, 1.0, 0.0];
        let dot = |c: &Cubic, m: &Cubic| c.iter().zip(m).map(|(a, b)| a * b).sum::<f64>();
        let (mut hessian, mut gradient, mut cost) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for c in constraints {
            let r = dot(c, &monomials);
            let j = Vector3::new(dot(c, &d_x), dot(c, &d_y), dot(c, &d_z));
            hessian += j * j.transpose();
            gradient += j * r;
            cost += r * r;
        }
        if cost.is_nan() || cost >= previous {
            return best;
        }
        (best, previous) = (at, cost);
        let Some(factor) = hessian.cholesky() else {
            return best;
        };
        let step = factor.solve(&gradient);
        at = [x - step.x, y - step.y, z - step.z];
    }
    best
}

fn multiply_linear(a: &Linear, b: &Linear, out: &mut Quadratic) {
    for i in 0..4 {
        for j in 0..4 {
            out[QUADRATIC[i][j]] += a[i] * b[j];
        }
    }
}

fn multiply_quadratic(a: &Quadratic, b: &Linear, out: &mut Cubic) {
    for i in 0..10 {
        for j in 0..4 {
            out[CUBIC[i][j]] += a[i] * b[j];
        }
    }
}

/// The ten cubic equations.
fn constraints(basis: &[[f64; 9]; 4]) -> [Cubic; 10] {
    let e: [[Linear; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| std::array::from_fn(|k| basis[k][3 * i + j])));
    let mut a = [[[0.0; 10]; 3]; 3];
    for i in 0..3 {
        for j in i..3 {
            for k in 0..3 {
                multiply_linear(&e[i][k], &e[j][k], &mut a[i][j]);
            }
            a[j][i] = a[i][j];
        }
    }
    // E E^T - tr(E E^T) / 2.
    let half_trace: Quadratic = std::array::from_fn(|m| 0.5 * (a[0][0][m] + a[1][1][m] + a[2][2][m]));
    for i in 0..3 {
        for m in 0..10 {
            a[i][i][m] -= half_trace[m];
        }
    }
    let mut out = [[0.0; 20]; 10];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                multiply_quadratic(&a[i][k], &e[k][j], &mut out[3 * i + j]);
            }
        }
    }
    for (i, (j, k)) in [(1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
        let (mut plus, mut minus) = ([0.0; 10], [0.0; 10]);
        multiply_linear(&e[1][j], &e[2][k], &mut plus);
        multiply_linear(&e[1][k], &e[2][j], &mut minus);
        let minor: Quadratic = std::array::from_fn(|m| plus[m] - minus[m]);
        multiply_quadratic(&minor, &e[0][i], &mut out[9]);
    }
    out
}

/// Gauss-Jordan with partial pivoting on the first ten columns; only rows 4 to 9 are made fully reduced, the others are not
/// needed. `None` when the columns are dependent.
fn eliminate(mut m: [Cubic; 10]) -> Option<[Cubic; 10]> {
    for column in 0..10 {
        let pivot = (column..10).fold(column, |best, i| if m[i][column].abs() > m[best][column].abs() { i } else { best });
        m.swap(column, pivot);
        let value = m[column][column];
        if value.is_nan() || value.abs() < 1e-13 {
            return None;
        }
        let inverse = 1.0 / value;
        m[column].iter_mut().skip(column).for_each(|x| *x *= inverse);
        let row = m[column];
        for i in (4.min(column)..10).filter(|&i| i != column && (i > column || i >= 4)) {
            let factor = m[i][column];
            for j in column..20 {
                m[i][j] -= factor * row[j];
            }
        }
    }
    Some(m)
}

/// Coefficients of x, y and 1, each a polynomial in z (ascending).
struct ZRow {
    x: [f64; 4],
    y: [f64; 4],
    one: [f64; 5],
}

impl ZRow {
    /// `upper - z lower`.
    fn difference(upper: &Cubic, lower: &Cubic) -> Self {
        let (u, l) = (upper, lower);
        Self {
            x: [u[12], u[11] - l[12], u[10] - l[11], -l[10]],
            y: [u[15], u[14] - l[15], u[13] - l[14], -l[13]],
            one: [u[19], u[18] - l[19], u[17] - l[18], u[16] - l[17], -l[16]],
        }
    }

    fn at(&self, z: f64) -> Vector3<f64> {
        let horner = |c: &[f64]| c.iter().rev().fold(0.0, |value, c| value * z + c);
        Vector3::new(horner(&self.x), horner(&self.y), horner(&self.one))
    }
}

fn determinant(b: &[ZRow; 3]) -> [f64; 11] {
    let mut out = [0.0; 11];
    for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        // one_i (x_j y_k - x_k y_j): expansion along the last column.
        let mut minor = [0.0; 7];
        for p in 0..4 {
            for q in 0..4 {
                minor[p + q] += b[j].x[p] * b[k].y[q] - b[k].x[p] * b[j].y[q];
            }
        }
        for p in 0..5 {
            for q in 0..7 {
                out[p + q] += b[i].one[p] * minor[q];
            }
        }
    }
    out
}
