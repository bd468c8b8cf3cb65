//! Levenberg-Marquardt for a handful of parameters.

use nalgebra::{SMatrix, SVector};

/// Tolerance for a result that is handed out.
pub(crate) const FINE: f64 = 1e-12;
/// Tolerance inside a search: parameters are then within about a thousandth of their standard deviation.
pub(crate) const COARSE: f64 = 1e-6;

/// Normal equations of a sum of squared (weighted) residuals at one point.
#[derive(Clone, Debug)]
pub(crate) struct Normal<const N: usize> {
    /// J^T W J.
    pub hessian: SMatrix<f64, N, N>,
    /// J^T W r.
    pub gradient: SVector<f64, N>,
    /// The (robust) sum of squares.
    pub cost: f64,
}

impl<const N: usize> Normal<N> {
    pub(crate) fn zero() -> Self {
        Self { hessian: SMatrix::zeros(), gradient: SVector::zeros(), cost: 0.0 }
    }

    /// Adds one residual with its derivatives.
    #[inline]
    pub(crate) fn add(&mut self, residual: f64, jacobian: &[f64; N], weight: f64) {
        for i in 0..N {
            let weighted = weight * jacobian[i];
            self.gradient[i] += weighted * residual;
            // Lower triangle, by column.
            for j in 0..=i {
                self.hessian[(i, j)] += weighted * jacobian[j];
            }
        }
    }
}

/// Minimises from `initial`; never returns a model of larger cost, and `initial` itself when nothing better is found.
///
/// Levenberg's damping is scaled by the diagonal (Marquardt, SIAM J. Appl. Math. 1963) and kept above a share of its mean, which also
/// carries a gauge freedom in the parameters. `linearise` gives the lower triangle of the normal equations and the cost
/// of a model, or `None` where the model is impossible; `retract` applies a step. Ends after `max_steps` trials, when the cost
/// falls by less than `tolerance` of itself, or when no damping helps.
pub(crate) fn levenberg_marquardt<M: Clone, const N: usize>(
    initial: &M,
    max_steps: usize,
    tolerance: f64,
    linearise: impl Fn(&M) -> Option<Normal<N>>,
    retract: impl Fn(&M, &SVector<f64, N>) -> M,
) -> M {
    let mut model = initial.clone();
    let Some(mut normal) = linearise(&model).filter(|n| n.cost.is_finite()) else {
        return model;
    };
    let mut damping = 1e-6;
    for _ in 0..max_steps {
        let floor = 1e-9 * normal.hessian.trace() / N as f64;
        let mut damped = normal.hessian;
        for i in 0..N {
            damped[(i, i)] += damping * (damped[(i, i)] + floor) + f64::MIN_POSITIVE;
        }
        let candidate = damped.cholesky().map(|factor| retract(&model, &-factor.solve(&normal.gradient)));
        let next = candidate.and_then(|m| linearise(&m).map(|n| (m, n))).filter(|(_, n)| n.cost < normal.cost);
        match next {
            Some((next_model, next_normal)) => {
                let converged = normal.cost - next_normal.cost <= tolerance * normal.cost;
                (model, normal) = (next_model, next_normal);
                if converged {
                    break;
                }
                damping = (damping * 0.1).max(1e-12);
            }
            None if damping < 1e6 => damping *= 30.0,
            None => break,
        }
    }
    model
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(x: &SVector<f64, 2>) -> Option<Normal<2>> {
        let mut n = Normal::zero();
        let (a, b) = (1.0 - x[0], 10.0 * (x[1] - x[0] * x[0]));
        n.add(a, &[-1.0, 0.0], 1.0);
        n.add(b, &[-20.0 * x[0], 10.0], 1.0);
        n.cost = a * a + b * b;
        Some(n)
    }

    #[test]
    fn curved_valley_is_followed_to_its_end() {
        let x = levenberg_marquardt(&SVector::from([-1.2, 1.0]), 100, 1e-12, rosenbrock, |x, d| x + d);
        assert!((x - SVector::from([1.0, 1.0])).norm() < 1e-10, "{x}");
    }

    #[test]
    fn impossible_start_is_given_back() {
        let start = SVector::from([5.0, 5.0]);
        assert_eq!(levenberg_marquardt(&start, 10, 1e-12, |_| None, |x: &SVector<f64, 2>, d| x + d), start);
        let nan = |_: &SVector<f64, 2>| Some(Normal { cost: f64::NAN, ..Normal::<2>::zero() });
        assert_eq!(levenberg_marquardt(&start, 10, 1e-12, nan, |x, d| x + d), start);
    }
}
