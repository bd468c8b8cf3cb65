//! Robust essential matrix, and refinement of a relative pose.

use super::five_point::five_point;
use super::matches::Matches;
use super::pose::{decompose, tangent};
use super::sampson;
use crate::numeric::minimise::{COARSE, FINE, levenberg_marquardt};
use crate::ransac::{Estimator, Msac, Ransac, RansacOptions, UniformSampler, improve, run};
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector2, Vector3};
use scene::Rigid3;

/// Trials of one refinement.
const MAX_STEPS: usize = 10;

/// Essential matrix of two images, robustly: `x2^T E x1 = 0` in normalised undistorted coordinates.
///
/// LO-RANSAC over [`five_point`]; the limit `o.max_error` is a Sampson distance in normalised coordinates (pixels / focal length). Local
/// optimisation minimises the truncated Sampson distances over the five parameters of the relative pose, not over the nine
/// entries. E has singular values (1, 1, 0) and a free sign. `None` for fewer than five finite pairs, when nothing has five
/// inliers, or when all samples are degenerate. For pure rotation some E with an arbitrary translation comes
/// out: compare with a homography. Points in a plane alone leave two solutions, of which one is returned.
#[must_use]
pub fn estimate_essential(x1: &[Vector2<f64>], x2: &[Vector2<f64>], o: &RansacOptions) -> Option<Ransac<Matrix3<f64>>> {
    let matches = Matches::new(x1, x2);
    let sampler = UniformSampler { len: matches.len() };
    let scoring = Msac { max_squared_error: o.max_error * o.max_error };
    let estimator = EssentialEstimator { matches };
    estimator.stated(run(&estimator, &sampler, &scoring, o)?)
}

/// A better essential matrix from one that came from elsewhere, such as from fewer matches of the same images: what [`estimate_essential`] does with the
/// models of its samples, without samples.
///
/// `None` when fewer than five finite pairs are within `max_error` of it.
#[must_use]
pub fn improve_essential(
    essential: &Matrix3<f64>,
    x1: &[Vector2<f64>],
    x2: &[Vector2<f64>],
    max_error: f64,
) -> Option<Ransac<Matrix3<f64>>> {
    let estimator = EssentialEstimator { matches: Matches::new(x1, x2) };
    let scoring = Msac { max_squared_error: max_error * max_error };
    estimator.stated(improve(&estimator, &scoring, *essential, max_error)?)
}

/// Refines `cam2_from_cam1` on point pairs in normalised coordinates: minimises the sum of the squared Sampson distances,
/// each truncated at `max_error`.
///
/// The result has a unit translation. Levenberg-Marquardt over a rotation (3) and the direction of the
/// translation (2), with analytic derivatives. Gives `initial` back where it has no translation or is not finite, and (scaled)
/// where nothing improves it. Pairs that are not finite do not count. Points may end behind a camera: the
/// epipolar constraint does not see it.
#[must_use]
pub fn refine_relative_pose(initial: &Rigid3, x1: &[Vector2<f64>], x2: &[Vector2<f64>], max_error: f64) -> Rigid3 {
    let norm = initial.translation.norm();
    if !(norm > 0.0 && norm.is_finite()) {
        return *initial;
    }
    let matches = Matches::new(x1, x2);
    let motion = Motion { rotation: initial.rotation, t: initial.translation / norm };
    let refined = motion.refined(&matches, || 0..matches.len(), max_error, FINE);
    Rigid3::new(refined.rotation, refined.t)
}

/// A relative pose with unit translation.
#[derive(Clone)]
struct Motion {
    rotation: UnitQuaternion<f64>,
    t: Vector3<f64>,
}

impl Motion {
    fn essential(&self) -> Matrix3<f64> {
        self.t.cross_matrix() * self.rotation.to_rotation_matrix().matrix()
    }

    /// E and its derivatives: R exp(w) moves the rotation, t + B d the translation.
    fn linearised(&self) -> (Matrix3<f64>, [Matrix3<f64>; 5]) {
        let rotation = self.rotation.to_rotation_matrix().into_inner();
        let e = self.t.cross_matrix() * rotation;
        let b = tangent(&self.t);
        let turn = |axis: Vector3<f64>| e * axis.cross_matrix();
        let shift = |k: usize| b[k].cross_matrix() * rotation;
        (e, [turn(Vector3::x()), turn(Vector3::y()), turn(Vector3::z()), shift(0), shift(1)])
    }

    fn moved(&self, step: &SVector<f64, 5>) -> Self {
        let b = tangent(&self.t);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
        let rotation = UnitQuaternion::new_normalize((self.rotation * turn).into_inner());
        Self { rotation, t: (self.t + b[0] * step[3] + b[1] * step[4]).normalize() }
    }

    fn refined<I: Iterator<Item = usize>>(&self, matches: &Matches, indices: impl Fn() -> I, max_error: f64, tolerance: f64) -> Self {
        let linearise = |m: &Motion| {
            let (e, basis) = m.linearised();
            Some(sampson::normal_equations(&e, &basis, matches, indices(), max_error))
        };
        levenberg_marquardt(self, MAX_STEPS, tolerance, linearise, Motion::moved)
    }
}

struct EssentialEstimator {
    matches: Matches,
}

impl EssentialEstimator {
    /// With the caller's indices, and exactly on the manifold, even where no refinement was taken.
    fn stated(&self, mut found: Ransac<Matrix3<f64>>) -> Option<Ransac<Matrix3<f64>>> {
        found.model = decompose(&found.model).map(|(rotation, _, t)| Motion { rotation, t }.essential())?;
        found.inliers.iter_mut().for_each(|i| *i = self.matches.source[*i]);
        Some(found)
    }
}

impl Estimator for EssentialEstimator {
    type Model = Matrix3<f64>;

    fn sample_size(&self) -> usize {
        5
    }

    fn len(&self) -> usize {
        self.matches.len()
    }

    fn solve(&self, sample: &[usize], models: &mut Vec<Matrix3<f64>>) {
        let (x1, x2) = self.matches.sample(sample);
        five_point(&x1, &x2, models);
    }

    fn squared_errors(&self, model: &Matrix3<f64>, start: usize, out: &mut [f64]) {
        sampson::squared_errors(model, &self.matches, start, out);
    }

    fn refine(&self, model: &Matrix3<f64>, inliers: &[usize], max_error: f64) -> Option<Matrix3<f64>> {
        // Any of the four decompositions has the same epipolar geometry.
        let (rotation, _, t) = decompose(model).filter(|_| inliers.len() >= 5)?;
        Some(Motion { rotation, t }.refined(&self.matches, || inliers.iter().copied(), max_error, COARSE).essential())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_differences() {
        let motion = Motion { rotation: UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.5, 0.2)), t: Vector3::new(0.6, 0.0, -0.8) };
        let (x1, x2) = (Vector3::new(0.2, -0.4, 1.0), Vector3::new(-0.3, 0.1, 1.0));
        let (e, basis) = motion.linearised();
        let (_, d_matrix) = sampson::residual(&e, &x1, &x2);
        for k in 0..5 {
            let h = 1e-6;
            let mut step = SVector::<f64, 5>::zeros();
            step[k] = h;
            let plus = sampson::residual(&motion.moved(&step).essential(), &x1, &x2).0;
            let minus = sampson::residual(&motion.moved(&-step).essential(), &x1, &x2).0;
            let analytic = d_matrix.dot(&basis[k]);
            assert!((analytic - (plus - minus) / (2.0 * h)).abs() < 1e-8, "{k}: {analytic}");
        }
    }
}
