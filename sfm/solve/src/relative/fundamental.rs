//! Robust fundamental matrix.

use super::matches::{Conditioning, Matches};
use super::sampson;
use super::seven_point::seven_point;
use crate::numeric::minimise::{COARSE, levenberg_marquardt};
use crate::ransac::{Estimator, Msac, Ransac, RansacOptions, UniformSampler, improve, run};
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};

/// Trials of one refinement.
const MAX_STEPS: usize = 10;

/// Fundamental matrix of two images, robustly: `x2^T F x1 = 0` in pixels.
///
/// LO-RANSAC over [`seven_point`] on conditioned coordinates; the limit `o.max_error` is a Sampson distance in pixels. Local
/// optimisation starts from the better of the model and the eight-point solution on its inliers, and minimises
/// the truncated Sampson distances over the seven parameters of `U diag(1, s, 0) V^T` (Bartoli & Sturm, *Nonlinear estimation of the
/// fundamental matrix with minimal parameters*, PAMI 2004). F has rank 2, a Frobenius norm of 1 and a free sign. `None` for fewer than
/// seven finite pairs, points in one place, or when nothing has seven inliers. Does not detect scenes in which most points
/// lie in a plane, where F is unreliable: compare with a homography.
#[must_use]
pub fn estimate_fundamental(x1: &[Vector2<f64>], x2: &[Vector2<f64>], o: &RansacOptions) -> Option<Ransac<Matrix3<f64>>> {
    let (matches, conditioning) = Matches::new(x1, x2).conditioned()?;
    let sampler = UniformSampler { len: matches.len() };
    let options = RansacOptions { max_error: o.max_error * conditioning.scale, ..*o };
    let scoring = Msac { max_squared_error: options.max_error * options.max_error };
    let estimator = FundamentalEstimator { matches };
    Some(estimator.stated(run(&estimator, &sampler, &scoring, &options)?, &conditioning))
}

/// A better fundamental matrix from one that came from elsewhere, such as from fewer matches of the same images: what [`estimate_fundamental`] does with
/// the models of its samples, without samples.
///
/// `None` when fewer than seven finite pairs are within `max_error` of it, and for points in one place.
#[must_use]
pub fn improve_fundamental(
    fundamental: &Matrix3<f64>,
    x1: &[Vector2<f64>],
    x2: &[Vector2<f64>],
    max_error: f64,
) -> Option<Ransac<Matrix3<f64>>> {
    let (matches, conditioning) = Matches::new(x1, x2).conditioned()?;
    let max_error = max_error * conditioning.scale;
    let scoring = Msac { max_squared_error: max_error * max_error };
    let estimator = FundamentalEstimator { matches };
    let model = conditioning.second().transpose().try_inverse()? * fundamental * conditioning.first().try_inverse()?;
    Some(estimator.stated(improve(&estimator, &scoring, model / model.norm(), max_error)?, &conditioning))
}

/// Least-squares fundamental matrix from eight or more pairs, made singular.
///
/// Hartley, *In defence of the 8-point algorithm*, PAMI 1997, with one scale for both images. Frobenius norm 1. `None` for fewer than
/// eight finite pairs or points in one place. Not robust; for points in a plane the result means nothing.
#[must_use]
pub fn eight_point(x1: &[Vector2<f64>], x2: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let (matches, conditioning) = Matches::new(x1, x2).conditioned()?;
    let indices: Vec<usize> = (0..matches.len()).collect();
    let f = conditioning.second().transpose() * linear(&matches, &indices)?.matrix() * conditioning.first();
    Some(f / f.norm())
}

/// The vector of least algebraic error, its rank reduced.
fn linear(matches: &Matches, indices: &[usize]) -> Option<Factors> {
    if indices.len() < 8 {
        return None;
    }
    let mut gram = SMatrix::<f64, 9, 9>::zeros();
    for &i in indices {
        let (a, b) = (matches.first(i), matches.second(i));
        let row = SVector::<f64, 9>::from([b.x * a.x, b.x * a.y, b.x, b.y * a.x, b.y * a.y, b.y, a.x, a.y, 1.0]);
        gram.ger(1.0, &row, &row, 1.0);
    }
    let eigen = gram.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    Factors::new(&Matrix3::from_row_slice(eigen.eigenvectors.column(smallest).as_slice()))
}

/// `F = U diag(1, s, 0) V^T`.
#[derive(Clone)]
struct Factors {
    u: Matrix3<f64>,
    v: Matrix3<f64>,
    s: f64,
}

impl Factors {
    fn new(f: &Matrix3<f64>) -> Option<Self> {
        if !f.iter().all(|x| x.is_finite()) {
            return None;
        }
        let svd = f.svd(true, true);
        let (mut u, mut v_t) = (svd.u?, svd.v_t?);
        // Rotations: the sign of the last columns is free.
        if u.determinant() < 0.0 {
            u.column_mut(2).neg_mut();
        }
        if v_t.determinant() < 0.0 {
            v_t.row_mut(2).neg_mut();
        }
        let s = svd.singular_values[1] / svd.singular_values[0];
        s.is_finite().then(|| Self { u, v: v_t.transpose(), s })
    }

    fn matrix(&self) -> Matrix3<f64> {
        self.u * Matrix3::from_diagonal(&Vector3::new(1.0, self.s, 0.0)) * self.v.transpose()
    }

    fn linearised(&self) -> (Matrix3<f64>, [Matrix3<f64>; 7]) {
        let d = Matrix3::from_diagonal(&Vector3::new(1.0, self.s, 0.0));
        let v_t = self.v.transpose();
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|a| a.cross_matrix());
        let basis = std::array::from_fn(|k| match k {
            0..3 => self.u * axes[k] * d * v_t,
            3..6 => -(self.u * d * axes[k - 3] * v_t),
            _ => self.u.column(1) * self.v.column(1).transpose(),
        });
        (self.u * d * v_t, basis)
    }

    fn moved(&self, step: &SVector<f64, 7>) -> Self {
        let turn = |k: usize| UnitQuaternion::from_scaled_axis(Vector3::new(step[k], step[k + 1], step[k + 2])).to_rotation_matrix();
        Self { u: self.u * turn(0).matrix(), v: self.v * turn(3).matrix(), s: self.s + step[6] }
    }
}

struct FundamentalEstimator {
    matches: Matches,
}

impl FundamentalEstimator {
    /// With the caller's indices and in the caller's coordinates.
    fn stated(&self, mut found: Ransac<Matrix3<f64>>, conditioning: &Conditioning) -> Ransac<Matrix3<f64>> {
        found.inliers.iter_mut().for_each(|i| *i = self.matches.source[*i]);
        let model = conditioning.second().transpose() * found.model * conditioning.first();
        found.model = model / model.norm();
        found
    }
}

impl Estimator for FundamentalEstimator {
    type Model = Matrix3<f64>;

    fn sample_size(&self) -> usize {
        7
    }

    fn len(&self) -> usize {
        self.matches.len()
    }

    fn solve(&self, sample: &[usize], models: &mut Vec<Matrix3<f64>>) {
        let (x1, x2) = self.matches.sample(sample);
        seven_point(&x1, &x2, models);
    }

    fn squared_errors(&self, model: &Matrix3<f64>, start: usize, out: &mut [f64]) {
        sampson::squared_errors(model, &self.matches, start, out);
    }

    fn refine(&self, model: &Matrix3<f64>, inliers: &[usize], max_error: f64) -> Option<Matrix3<f64>> {
        if inliers.len() < 8 {
            return None;
        }
        let linearise = |f: &Factors| {
            let (matrix, basis) = f.linearised();
            Some(sampson::normal_equations(&matrix, &basis, &self.matches, inliers.iter().copied(), max_error))
        };
        let cost = |f: &Factors| linearise(f).map_or(f64::INFINITY, |n| n.cost);
        let current = Factors::new(model)?;
        let start = match linear(&self.matches, inliers) {
            Some(linear) if cost(&linear) < cost(&current) => linear,
            _ => current,
        };
        let f = levenberg_marquardt(&start, MAX_STEPS, COARSE, linearise, Factors::moved).matrix();
        Some(f / f.norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_differences() {
        let factors = Factors::new(&Matrix3::new(0.1, -0.9, 0.3, 0.8, 0.2, -0.5, -0.2, 0.6, 0.05)).unwrap();
        let (_, basis) = factors.linearised();
        for k in 0..7 {
            let h = 1e-6;
            let mut step = SVector::<f64, 7>::zeros();
            step[k] = h;
            let numeric = (factors.moved(&step).matrix() - factors.moved(&-step).matrix()) / (2.0 * h);
            assert!((numeric - basis[k]).norm() < 1e-9, "{k}");
        }
    }
}
