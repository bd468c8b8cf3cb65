//! Real roots of polynomials of small degree.

/// Intervals are not split beyond this depth: below a width of 2^-20 the signs of the Bernstein coefficients around a
/// double root are rounding noise.
const MAX_DEPTH: usize = 20;
/// Roots beyond the inverse of this are taken as infinite.
const SMALLEST_INVERSE_ROOT: f64 = 1e-9;
/// Newton or bisection steps for one root; Newton needs 4 to 6, bisection alone 52.
const MAX_STEPS: usize = 60;

/// Calls `emit` with each real root of `c[0] + c[1] z + ... + c[N - 1] z^(N - 1)`.
///
/// The roots are isolated where |z| <= 1 on the polynomial and elsewhere on the reversed polynomial in 1/z, so that no
/// bound on the roots is needed and leading coefficients may vanish. Isolation is by the variation of signs in the
/// Bernstein basis with bisection (Lane & Riesenfeld, *Bounds on a polynomial*, BIT 1981), then Newton's method kept inside
/// the bracket. Double roots, and pairs closer than about 1e-6 (relative), come out as one value of that accuracy, or not
/// at all where rounding has moved them off the real axis. A polynomial of zeros or with a coefficient that is not finite
/// has no roots here; infinite roots are left out. The order is fixed, but not sorted.
pub(crate) fn real_roots<const N: usize>(c: &[f64; N], mut emit: impl FnMut(f64)) {
    let largest = c.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if !(largest > 0.0 && c.iter().all(|x| x.is_finite())) {
        return;
    }
    for reversed in [false, true] {
        for negative in [false, true] {
            let mut p = *c;
            if reversed {
                p.reverse();
            }
            if negative {
                p.iter_mut().skip(1).step_by(2).for_each(|x| *x = -*x);
            }
            let mut isolation = Isolation { p: &p, last_double: f64::NEG_INFINITY };
            isolation.descend(bernstein(&p), 0.0, 1.0, 0, &mut |s| {
                let size = if reversed { 1.0 / s } else { s };
                if !reversed || s > SMALLEST_INVERSE_ROOT {
                    emit(if negative { -size } else { size });
                }
            });
        }
    }
}

/// Coefficients in the Bernstein basis on \[0, 1\]: b_j = sum over i <= j of binomial(j, i) / binomial(n, i) p_i.
fn bernstein<const N: usize>(p: &[f64; N]) -> [f64; N] {
    let n = N - 1;
    let mut scaled = *p;
    let mut binomial = 1.0;
    for (i, x) in scaled.iter_mut().enumerate() {
        *x /= binomial;
        binomial = binomial * (n - i) as f64 / (i + 1) as f64;
    }
    // Repeated sums give sum over i of binomial(j, i) scaled_i.
    let mut b = scaled;
    for round in 1..N {
        for j in (round..N).rev() {
            b[j] += b[j - 1];
        }
    }
    b
}

struct Isolation<'a, const N: usize> {
    p: &'a [f64; N],
    /// End of the last interval that was reported as a double root: its neighbour sees the same root.
    last_double: f64,
}

impl<const N: usize> Isolation<'_, N> {
    fn descend(&mut self, b: [f64; N], low: f64, high: f64, depth: usize, emit: &mut impl FnMut(f64)) {
        let changes = (1..N).filter(|&i| (b[i - 1] < 0.0) != (b[i] < 0.0)).count();
        if changes == 0 {
            return;
        }
        if changes == 1 {
            emit(self.root(low, high, b[0] < 0.0));
            return;
        }
        if depth == MAX_DEPTH {
            if low > self.last_double {
                emit(0.5 * (low + high));
            }
            self.last_double = high;
            return;
        }
        // de Casteljau: the left diagonal and the last row.
        let (mut left, mut right) = (b, b);
        for round in 1..N {
            for j in 0..N - round {
                right[j] = 0.5 * (right[j] + right[j + 1]);
            }
            left[round] = right[0];
        }
        let middle = 0.5 * (low + high);
        self.descend(left, low, middle, depth + 1, emit);
        self.descend(right, middle, high, depth + 1, emit);
    }

    /// The one root in a bracket, by Newton's method that falls back on bisection.
    fn root(&self, mut low: f64, mut high: f64, low_is_negative: bool) -> f64 {
        let mut z = 0.5 * (low + high);
        for _ in 0..MAX_STEPS {
            let (mut value, mut slope) = (self.p[N - 1], 0.0);
            for &c in self.p[..N - 1].iter().rev() {
                slope = slope * z + value;
                value = value * z + c;
            }
            if (value < 0.0) == low_is_negative {
                low = z;
            } else {
                high = z;
            }
            let newton = z - value / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - z).abs() <= 2e-16 * z.abs() {
                return next;
            }
            z = next;
        }
        z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted_roots<const N: usize>(c: &[f64; N]) -> Vec<f64> {
        let mut roots = Vec::new();
        real_roots(c, |z| roots.push(z));
        roots.sort_by(f64::total_cmp);
        roots
    }

    /// Coefficients of the product of (z - r), ascending.
    fn from_roots<const N: usize>(roots: &[f64]) -> [f64; N] {
        let mut c = [0.0; N];
        c[0] = 1.0;
        for (k, r) in roots.iter().enumerate() {
            for i in (0..=k + 1).rev() {
                c[i] = if i > 0 { c[i - 1] } else { 0.0 } - r * c[i];
            }
        }
        c
    }

    #[test]
    fn vanishing_polynomials_and_bad_coefficients_have_no_roots() {
        assert!(sorted_roots(&[0.0; 5]).is_empty());
        assert!(sorted_roots(&[1.0, f64::NAN, 2.0]).is_empty());
        assert!(sorted_roots(&[f64::INFINITY, 1.0]).is_empty());
        assert!(sorted_roots(&[3.0, 0.0, 0.0]).is_empty());
    }

    #[test]
    fn leading_zeros_and_roots_at_the_joints_are_found_once() {
        let roots = sorted_roots(&[-6.0, 2.0, 0.0, 0.0]);
        assert!(roots.len() == 1 && (roots[0] - 3.0).abs() < 1e-14, "{roots:?}");
        let roots = sorted_roots(&from_roots::<4>(&[-1.0, 0.0, 1.0]));
        assert!(roots.len() == 3 && roots.iter().zip([-1.0, 0.0, 1.0]).all(|(f, r)| (f - r).abs() < 1e-14), "{roots:?}");
    }

    #[test]
    fn a_double_root_is_found_once_and_complex_roots_are_not() {
        let roots = sorted_roots(&from_roots::<4>(&[0.25, 0.25, -4.0]));
        assert!(roots.len() == 2 || roots.len() == 3, "{roots:?}");
        assert!((roots[0] + 4.0).abs() < 1e-12 && roots[1..].iter().all(|r| (r - 0.25).abs() < 1e-5), "{roots:?}");
        assert!(sorted_roots(&[1.0, 0.0, 1.0]).is_empty());
    }

    proptest! {
        #[test]
        fn separate_roots_of_degree_ten_are_found(seeds in prop::collection::vec(0.0..0.5f64, 10)) {
            // Angles of tangents at least 0.5/10 pi apart, over the whole real line.
            let roots: Vec<f64> = seeds.iter().enumerate().map(|(i, s)| (std::f64::consts::PI * ((i as f64 + s) / 10.0 - 0.49)).tan()).collect();
            let found = sorted_roots(&from_roots::<11>(&roots));
            prop_assert_eq!(found.len(), 10);
            for (f, r) in found.iter().zip(&roots) {
                // The condition of the coefficients, not the solver, bounds the accuracy.
                prop_assert!((f - r).abs() < 1e-7 * (1.0 + r * r), "{} {}", f, r);
            }
        }

        #[test]
        fn values_at_the_roots_are_rounding_noise(c in prop::array::uniform11(-1.0..1.0f64)) {
            for z in sorted_roots(&c) {
                let (value, size) = c.iter().enumerate().fold((0.0, 0.0), |(v, s), (i, c)| (v + c * z.powi(i as i32), s + (c * z.powi(i as i32)).abs()));
                // 1e-10 leaves room for double roots, found to 1e-6: the value is of the second order there.
                prop_assert!(value.abs() < 1e-10 * size, "{value} {size}");
            }
        }
    }
}
