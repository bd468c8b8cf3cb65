//! Robust homography.

use super::homography_refinement::{forward, refined};
use super::matches::Matches;
use crate::numeric::null_space::null_space;
use crate::ransac::{Estimator, Msac, Ransac, RansacOptions, UniformSampler, run};
use nalgebra::{Matrix3, Vector2};

/// Three points whose triangle has less than half this area are in line; coordinates are of size 1.
const MIN_DOUBLED_AREA: f64 = 1e-9;

/// Homography between two images, robustly: `x2 ~ H x1` in pixels.
///
/// LO-RANSAC over four pairs on conditioned coordinates. The error is the root of the mean of the squared transfer errors in the
/// first and the second image, in pixels (symmetric transfer error; Hartley & Zisserman, *Multiple View Geometry*, 4.2.2), and local
/// optimisation minimises it, truncated. H has a Frobenius norm of 1 and the sign for which inliers have a positive third
/// coordinate: pairs on the far side of the horizon are outliers. `None` for fewer than four finite pairs, points in
/// one place, when nothing has four inliers, or when all samples hold three points in line.
#[must_use]
pub fn estimate_homography(x1: &[Vector2<f64>], x2: &[Vector2<f64>], o: &RansacOptions) -> Option<Ransac<Matrix3<f64>>> {
    let (matches, conditioning) = Matches::new(x1, x2).conditioned()?;
    let sampler = UniformSampler { len: matches.len() };
    let options = RansacOptions { max_error: o.max_error * conditioning.scale, ..*o };
    let scoring = Msac { max_squared_error: options.max_error * options.max_error };
    let estimator = HomographyEstimator { matches };
    let found = run(&estimator, &sampler, &scoring, &options)?;
    let model = conditioning.second().try_inverse()? * found.model.h * conditioning.first();
    let inliers = found.inliers.iter().map(|&i| estimator.matches.source[i]).collect();
    Some(Ransac { model: model / model.norm(), inliers, iterations: found.iterations })
}

/// Squared error of each pair under a homography `x2 ~ H x1`, as [`estimate_homography`] measures it; infinite for pairs on the far side of the
/// horizon, as the sign of H tells. All are infinite for a matrix without inverse; a longer list is cut to the length of the other.
#[must_use]
pub fn transfer_squared(h: &Matrix3<f64>, x1: &[Vector2<f64>], x2: &[Vector2<f64>]) -> Vec<f64> {
    let Some(model) = Both::new(h) else { return vec![f64::INFINITY; x1.len().min(x2.len())] };
    x1.iter().zip(x2).map(|(a, b)| model.squared_error(a.x, a.y, b.x, b.y)).collect()
}

/// The homography `x2 ~ H x1` of four pairs, by the direct linear transform (Hartley & Zisserman, 4.1),
/// in conditioned coordinates of size about 1.
///
/// Frobenius norm 1, positive third coordinates. `None` when three points are in line or equal in an image, and when the pairs
/// would need a point on the far side of the horizon (Chum, Werner & Matas, *Epipolar geometry estimation via RANSAC benefits
/// from the oriented epipolar constraint*, ICPR 2004, state the constraint for F): no pair of cameras in front of the plane sees that.
#[must_use]
pub fn four_point_homography(x1: &[Vector2<f64>; 4], x2: &[Vector2<f64>; 4]) -> Option<Matrix3<f64>> {
    let mut mirrored = 0;
    for (a, b, c) in [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)] {
        let (first, second) = (doubled_area(x1, a, b, c), doubled_area(x2, a, b, c));
        // Written so that NaN is refused too.
        if !(first.abs() > MIN_DOUBLED_AREA && second.abs() > MIN_DOUBLED_AREA) {
            return None;
        }
        mirrored += usize::from((first > 0.0) != (second > 0.0));
    }
    // Some triangles mirrored and others not: the quadrilateral crosses the horizon.
    if mirrored == 0 || mirrored == 4 { direct(x1, x2) } else { None }
}

fn doubled_area(x: &[Vector2<f64>; 4], a: usize, b: usize, c: usize) -> f64 {
    (x[b] - x[a]).perp(&(x[c] - x[a]))
}

fn direct(x1: &[Vector2<f64>; 4], x2: &[Vector2<f64>; 4]) -> Option<Matrix3<f64>> {
    let mut rows = [[0.0; 9]; 8];
    for (k, (a, b)) in x1.iter().zip(x2).enumerate() {
        rows[2 * k] = [a.x, a.y, 1.0, 0.0, 0.0, 0.0, -b.x * a.x, -b.x * a.y, -b.x];
        rows[2 * k + 1] = [0.0, 0.0, 0.0, a.x, a.y, 1.0, -b.y * a.x, -b.y * a.y, -b.y];
    }
    let [h] = null_space::<8, 9, 1>(rows)?;
    let h = Matrix3::from_row_slice(&h);
    Some(if (h * x1[0].push(1.0)).z < 0.0 { -h } else { h })
}

/// A homography with its inverse.
#[derive(Clone)]
pub(super) struct Both {
    pub h: Matrix3<f64>,
    pub inverse: Matrix3<f64>,
}

impl Both {
    pub(super) fn new(h: &Matrix3<f64>) -> Option<Self> {
        let h = h / h.norm();
        let inverse = h.try_inverse()?;
        inverse.iter().all(|x| x.is_finite()).then_some(Self { h, inverse })
    }

    /// Mean of the squared transfer errors in both images.
    #[inline]
    fn squared_error(&self, x1: f64, y1: f64, x2: f64, y2: f64) -> f64 {
        let (u2, v2, w2) = forward(&self.h, x1, y1);
        let (u1, v1, w1) = forward(&self.inverse, x2, y2);
        let (a, b, c, d) = (u2 - x2, v2 - y2, u1 - x1, v1 - y1);
        let error = 0.5 * (a * a + b * b + c * c + d * d);
        if w1 > 0.0 && w2 > 0.0 { error } else { f64::INFINITY }
    }
}

struct HomographyEstimator {
    matches: Matches,
}

impl Estimator for HomographyEstimator {
    type Model = Both;

    fn sample_size(&self) -> usize {
        4
    }

    fn len(&self) -> usize {
        self.matches.len()
    }

    fn solve(&self, sample: &[usize], models: &mut Vec<Both>) {
        let (x1, x2) = self.matches.sample(sample);
        models.extend(four_point_homography(&x1, &x2).and_then(|h| Both::new(&h)));
    }

    fn squared_errors(&self, model: &Both, start: usize, out: &mut [f64]) {
        let m = &self.matches;
        for (k, e) in out.iter_mut().enumerate() {
            let i = start + k;
            *e = model.squared_error(m.x1[i], m.y1[i], m.x2[i], m.y2[i]);
        }
    }

    fn refine(&self, model: &Both, inliers: &[usize], max_error: f64) -> Option<Both> {
        (inliers.len() >= 4).then(|| refined(model, &self.matches, inliers, max_error))
    }
}
