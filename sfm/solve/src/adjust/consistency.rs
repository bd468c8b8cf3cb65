//! Whether poses are as far from the truth as their covariance says.

use super::covariance::{Covariance, CovarianceError, CovarianceOptions, Normal};
use super::inverse::Inverse;
use super::layout::{Layout, Owner};
use super::problem::Problem;
use super::schur::Reduced;
use crate::lie::so3_log;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector6};
use rayon::prelude::*;
use scene::Rigid3;

/// Two-sided 95 % of a normal distribution.
const NORMAL_95: f64 = 1.959_964;

/// A normalised estimation error squared (Bar-Shalom, Li & Kirubarajan, *Estimation with applications to tracking and navigation*, 2001,
/// 5.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalisedError {
    /// e^T Cov^-1 e.
    pub value: f64,
    /// What is expected: the number of scalar errors.
    pub expected: f64,
    /// Its variance.
    pub variance: f64,
    /// Where it lies in 95 of 100 cases.
    pub band: [f64; 2],
}

impl NormalisedError {
    /// Of a weighted sum of squares of independent standard normal variables with this mean and this variance, which is taken for a
    /// multiple of a chi-square variable (Satterthwaite, *Biometrics Bulletin* 2, 1946) with the quantiles of Wilson & Hilferty (*PNAS* 17,
    /// 1931), which err by less than a hundredth of the width of the band from 10 degrees of freedom on.
    pub(super) fn new(value: f64, expected: f64, variance: f64) -> Self {
        let degrees = 2.0 * expected * expected / variance;
        let spread = 2.0 / (9.0 * degrees);
        let quantile = |z: f64| expected * (1.0 - spread + z * spread.sqrt()).powi(3);
        Self { value, expected, variance, band: [quantile(-NORMAL_95), quantile(NORMAL_95)] }
    }

    /// Of independent surveys together.
    #[must_use]
    pub fn sum(of: &[Self]) -> Self {
        let sum = |part: fn(&Self) -> f64| of.iter().map(part).sum();
        Self::new(sum(|e| e.value), sum(|e| e.expected), sum(|e| e.variance))
    }

    /// Whether it lies in the band.
    #[must_use]
    pub fn is_in_band(&self) -> bool {
        self.band[0] <= self.value && self.value <= self.band[1]
    }
}

/// Errors of poses against their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Consistency {
    /// What [`super::covariance`] gives.
    pub covariance: Covariance,
    /// Of all poses at once, with all their covariances: chi-square distributed.
    pub joint: NormalisedError,
    /// The sum over the poses of each one's own, with its own covariance. Errors of neighbours are alike, hence the wide band.
    pub single: NormalisedError,
}

/// The covariance of a problem at its optimum, and how the errors of its free frames, of which `truth` has the true `rig_from_world`,
/// compare with it.
///
/// The covariance is that relative to what is held. So the truth is first moved into the world in which it agrees with the first frame that
/// is held; where none is, it is compared as it is. The matrix between all frames is needed, and [`CovarianceOptions::max_bytes`] must allow
/// it whole.
///
/// # Errors
/// [`CovarianceError`].
///
/// # Panics
/// When `truth` has not one pose a frame.
pub fn consistency(problem: &Problem, truth: &[Rigid3], options: &CovarianceOptions) -> Result<Consistency, CovarianceError> {
    let mut system = Normal::new(problem, options)?;
    let reduced = system.reduce(system.packed(options)?);
    let errors = errors(problem, truth, &system.layout);
    let joint = joint(&system.layout, &reduced, &errors).ok_or(CovarianceError::Singular)?;
    let inverse = system.invert_reduced(reduced)?;
    let single = single(&system.layout, &inverse, &errors).ok_or(CovarianceError::Singular)?;
    Ok(Consistency { covariance: system.collect(problem, &inverse, options), joint, single })
}

/// [`Consistency::joint`] alone. It needs the memory of [`consistency`], but no inverse: seconds where that takes an hour.
///
/// # Errors
/// [`CovarianceError`].
///
/// # Panics
/// When `truth` has not one pose a frame.
pub fn joint_consistency(problem: &Problem, truth: &[Rigid3], options: &CovarianceOptions) -> Result<NormalisedError, CovarianceError> {
    let system = Normal::new(problem, options)?;
    let reduced = system.reduce(system.packed(options)?);
    joint(&system.layout, &reduced, &errors(problem, truth, &system.layout)).ok_or(CovarianceError::Singular)
}

/// The step from each free frame to the truth.
fn errors(problem: &Problem, truth: &[Rigid3], layout: &Layout) -> Vec<Vector6<f64>> {
    assert_eq!(truth.len(), problem.frames.len(), "one true pose a frame");
    let held = problem.frames.iter().position(|f| !f.free);
    let moved = held.map_or(Rigid3::identity(), |h| truth[h].inverse() * problem.frames[h].pose);
    let frames = layout.owners.iter().map_while(|o| if let Owner::Frame(i) = o { Some(*i as usize) } else { None });
    let error = |i: usize| {
        let (found, truth) = (problem.frames[i].pose, truth[i] * moved);
        let w = so3_log(&(truth.rotation * found.rotation.inverse()));
        let d = truth.translation - found.translation;
        Vector6::new(w.x, w.y, w.z, d.x, d.y, d.z)
    };
    frames.map(error).collect()
}

/// e^T Cov^-1 e of all frames, where Cov^-1 is what remains of the reduced system once all else is eliminated.
fn joint(layout: &Layout, reduced: &Reduced, errors: &[Vector6<f64>]) -> Option<NormalisedError> {
    let (n, frames) = (layout.unknowns(), 6 * errors.len());
    let mut e = vec![0.0; n];
    e.chunks_exact_mut(6).zip(errors).for_each(|(to, error)| to.copy_from_slice(error.as_slice()));
    let mut product = vec![0.0; n];
    let others = n - frames;
    let mut rest = DMatrix::zeros(others, others);
    for a in 0..layout.block_count() {
        for j in 0..layout.dim(a) {
            let (column, stride) = (layout.offsets[a] + j, reduced.pattern.stride[a]);
            let from = reduced.pattern.panel_start[a] + j * stride + reduced.pattern.diagonal_row(a) + j;
            // From the diagonal on.
            let below = &reduced.values[from..from + n - column];
            product[column] += below.iter().zip(&e[column..]).map(|(s, e)| s * e).sum::<f64>();
            for (p, s) in product[column + 1..].iter_mut().zip(&below[1..]) {
                *p += s * e[column];
            }
            if column >= frames {
                rest.view_mut((column - frames, column - frames), (below.len(), 1)).copy_from_slice(below);
            }
        }
    }
    let (of_frames, of_others) = product.split_at(frames);
    let mut value: f64 = of_frames.iter().zip(&e).map(|(p, e)| p * e).sum();
    if others > 0 {
        let v = DVector::from_column_slice(of_others);
        value -= v.dot(&Cholesky::new(rest)?.solve(&v));
    }
    Some(NormalisedError::new(value, frames as f64, 2.0 * frames as f64))
}

/// The sum of e_f^T Cov_f^-1 e_f. With Cov_f = L_f L_f^T its variance is twice the sum of |L_f^-1 Cov_fg L_g^-T|^2 over all f and g.
fn single(layout: &Layout, inverse: &Inverse, errors: &[Vector6<f64>]) -> Option<NormalisedError> {
    let root = |f: usize| Some(Cholesky::new(inverse.of_frames(layout, f, f)?)?.l());
    let roots: Vec<Matrix6<f64>> = (0..errors.len()).map(root).collect::<Option<_>>()?;
    let value = errors.iter().zip(&roots).map(|(e, l)| l.solve_lower_triangular(e).map(|x| x.norm_squared())).sum::<Option<f64>>()?;
    let correlation = |a: usize, b: usize| {
        let left = roots[b].solve_lower_triangular(&inverse.of_frames(layout, a, b)?)?;
        Some(roots[a].solve_lower_triangular(&left.transpose())?.norm_squared())
    };
    let row = |a: usize| (a..errors.len()).map(|b| Some(if a == b { 1.0 } else { 2.0 } * correlation(a, b)?)).sum::<Option<f64>>();
    let rows: Vec<Option<f64>> = (0..errors.len()).into_par_iter().map(row).collect();
    let variance = 2.0 * rows.into_iter().sum::<Option<f64>>()?;
    Some(NormalisedError::new(value, 6.0 * errors.len() as f64, variance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_those_of_the_tables() {
        // Quantiles 0.025 and 0.975 of chi-square, from tables.
        for (degrees, low, high) in [(10.0, 3.247, 20.483), (60.0, 40.482, 83.298), (100.0, 74.222, 129.561)] {
            let found = NormalisedError::new(degrees, degrees, 2.0 * degrees);
            let most = 0.01 * (high - low);
            assert!((found.band[0] - low).abs() < most && (found.band[1] - high).abs() < most, "{found:?}");
            assert!(found.is_in_band());
        }
    }
}
