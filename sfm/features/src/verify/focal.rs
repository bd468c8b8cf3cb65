//! Principal distance and radial distortion of a camera of which nothing is known, from its pairs.

use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;
use scene::{Camera, CameraError, CameraModel, Keypoint, PairConfiguration, VerifiedPair};
use solve::ransac::RansacOptions;
use solve::relative::estimate_fundamental;

/// Most pairs that are looked at, and most matches of each.
const MAX_PAIRS: usize = 60;
const MAX_MATCHES: usize = 300;
/// Fewest pairs that decide.
const MIN_PAIRS: usize = 5;
/// Fewest matches of a pair.
const MIN_MATCHES: usize = 40;
/// Distortions that are tried: lowest, step, number.
const DISTORTIONS: (f64, f64, usize) = (-0.4, 0.05, 19);
/// A distortion is taken where its cost is below this share of the cost of none; noise alone changes it by a few hundredths.
const MAX_COST_SHARE: f64 = 0.95;
/// Focal lengths that are tried, over the longer side of the image, and their number.
const FOCALS: (f64, f64, usize) = (0.3, 5.0, 96);
/// Difference of the singular values at which a pair disagrees entirely.
const SATURATION: f64 = 0.1;
/// The cost at half and at twice the focal length must exceed this plus `MIN_RISE` times the least: else the motion says nothing.
const MIN_CONTRAST: f64 = 0.12;
const MIN_RISE: f64 = 1.5;

/// A verified pair of one camera, for [`interior_from_pairs`].
#[derive(Clone, Copy, Debug)]
pub struct PairForInterior<'a> {
    /// The pair.
    pub pair: &'a VerifiedPair,
    /// Keypoints of its first and second image.
    pub keypoints: (&'a [Keypoint], &'a [Keypoint]),
}

/// What the pairs of a camera tell about its interior orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InteriorEstimate {
    /// Columns and rows of the images.
    pub size: (u32, u32),
    /// Principal distance, pixels; `None` where the motion leaves it open (translation alone, axes that meet, a plane).
    pub focal_px: Option<f64>,
    /// Division model with the centre of the image c and its half diagonal R: a pixel x shows the direction of the undistorted pixel
    /// c + (x - c) / (1 + d |x - c|^2 / R^2). 0 where the pairs do not tell it from none.
    pub distortion: f64,
    /// Pairs that were used.
    pub pairs: usize,
    /// Mean disagreement of the pairs at the principal distance, 0..=1; below 0.2 is good.
    pub cost: f64,
    /// The smaller of the disagreements at half and at twice the principal distance: how well it is determined.
    pub contrast: f64,
}

impl InteriorEstimate {
    /// A start for the adjustment: a principal distance, this one or a guess, and the distortion as its lowest term, as far as the model has it.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn with_focal(&self, model: CameraModel, focal_px: f64) -> Result<Camera, CameraError> {
        let mut camera = Camera::from_focal(model, self.size.0, self.size.1, focal_px)?;
        // The two agree at seven tenths of the half diagonal: r_d = r_u (1 + d r_d^2 / R^2) = r_u (1 + k r_u^2 / f^2).
        let stretch = 0.49 * self.distortion;
        let undistorted_squared = 0.49 * half_diagonal_squared(self.size) / (1.0 + stretch).powi(2);
        let k = stretch * focal_px * focal_px / undistorted_squared;
        match model {
            CameraModel::Pinhole => {}
            CameraModel::SimpleRadial | CameraModel::Radial | CameraModel::Brown => camera.params_mut()[3] = k,
            CameraModel::OpenCv => camera.params_mut()[4] = k,
            // In the angle: tan a = a + a^3 / 3 + ...
            CameraModel::Fisheye => camera.params_mut()[4] = k + 1.0 / 3.0,
        }
        Ok(camera)
    }
}

/// Estimates principal distance and distortion of one camera from pairs of its images, with the principal point in the middle, square
/// pixels and one interior orientation for all images. Pairs with images of other cameras do not belong into the list; planar ones are skipped.
///
/// Distortion bends epipolar lines: of the distortions on a grid, the one with the least Sampson errors of fundamental matrices, refined by
/// a parabola (the division model after Fitzgibbon, *Simultaneous linear estimation of multiple view geometry and lens distortion*, CVPR
/// 2001). Then, of the focal lengths f on a logarithmic grid, the one for which the first two singular values s1, s2 of all `K F K`
/// agree best: weighted mean of `min(1, (s1 - s2) / (0.1 s1))` (Mendonca & Cipolla, *A simple technique for self-calibration*, CVPR 1999).
/// Undecided for pure translation, optical axes that meet at equal distance, forward motion, and planes: there the cost hardly changes with f.
///
/// `None` when there are too few pairs. The result depends on the arguments alone, also at any number of threads.
#[must_use]
pub fn interior_from_pairs(pairs: &[PairForInterior<'_>], size: (u32, u32), max_error_px: f64, seed: u64) -> Option<InteriorEstimate> {
    let usable = usable(pairs, size);
    if usable.len() < MIN_PAIRS || half_diagonal_squared(size) <= 0.0 {
        return None;
    }
    let fit = |d: f64| Geometries::new(&usable, d / half_diagonal_squared(size), max_error_px, seed);
    let distortion = distortion(&fit);
    let geometries = fit(distortion);
    let longer = f64::from(size.0.max(size.1));
    let (low, high, count) = FOCALS;
    let step = (high / low).ln() / (count - 1) as f64;
    let focal = |k: f64| longer * low * (step * k).exp();
    let costs: Vec<f64> = (0..count).map(|k| geometries.disagreement(focal(k as f64))).collect();
    let best = (0..count).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;
    let at = best as f64 + vertex(&costs, best);
    let cost = geometries.disagreement(focal(at));
    let contrast = geometries.disagreement(0.5 * focal(at)).min(geometries.disagreement(2.0 * focal(at)));
    let decided = best > 0 && best + 1 < count && contrast > MIN_CONTRAST + MIN_RISE * cost;
    Some(InteriorEstimate { size, focal_px: decided.then(|| focal(at)), distortion, pairs: usable.len(), cost, contrast })
}

fn half_diagonal_squared(size: (u32, u32)) -> f64 {
    0.25 * (f64::from(size.0).powi(2) + f64::from(size.1).powi(2))
}

/// Matches of a pair relative to the centre of the image, and its weight.
struct Usable {
    a: Vec<Vector2<f64>>,
    b: Vec<Vector2<f64>>,
    weight: f64,
}

/// The pairs that say most: many matches, far from a plane.
fn usable(pairs: &[PairForInterior<'_>], size: (u32, u32)) -> Vec<Usable> {
    let centre = Vector2::new(f64::from(size.0), f64::from(size.1)) / 2.0;
    let mut weighted: Vec<(f64, &PairForInterior<'_>)> = pairs
        .iter()
        .filter(|p| !matches!(p.pair.configuration, PairConfiguration::PlanarOrPanoramic { .. }) && p.pair.matches.len() >= MIN_MATCHES)
        .map(|p| {
            let matches = p.pair.matches.len() as f64;
            (matches.sqrt() * (1.0 - p.pair.homography_inliers as f64 / matches).max(0.0), p)
        })
        .filter(|(weight, _)| *weight > 0.0)
        .collect();
    weighted.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.pair.images.cmp(&b.1.pair.images)));
    weighted.truncate(MAX_PAIRS);
    weighted
        .into_iter()
        .map(|(weight, p)| {
            let at = |keypoint: Option<&Keypoint>| keypoint.map(|k| Vector2::new(f64::from(k.x), f64::from(k.y)) - centre);
            let some = p.pair.matches.iter().step_by(p.pair.matches.len().div_ceil(MAX_MATCHES));
            let positions = some.filter_map(|&(i, j)| Some((at(p.keypoints.0.get(i.index()))?, at(p.keypoints.1.get(j.index()))?)));
            let (a, b) = positions.unzip();
            Usable { a, b, weight }
        })
        .collect()
}

/// The distortion with the least cost, or none.
fn distortion(fit: &(impl Fn(f64) -> Geometries + Sync)) -> f64 {
    let (low, step, count) = DISTORTIONS;
    let value = |k: f64| low + step * k;
    let costs: Vec<f64> = (0..count).into_par_iter().map(|k| fit(value(k as f64)).cost).collect();
    let Some(best) = (0..count).min_by(|&a, &b| costs[a].total_cmp(&costs[b])) else { return 0.0 };
    let found = value(best as f64 + vertex(&costs, best));
    if fit(found).cost < MAX_COST_SHARE * fit(0.0).cost { found } else { 0.0 }
}

/// Offset of the vertex of the parabola through a least value and its neighbours, -0.5..=0.5; 0 at the ends.
fn vertex(costs: &[f64], best: usize) -> f64 {
    if best == 0 || best + 1 >= costs.len() {
        return 0.0;
    }
    let (left, middle, right) = (costs[best - 1], costs[best], costs[best + 1]);
    let curvature = left - 2.0 * middle + right;
    if curvature > 0.0 { (0.5 * (left - right) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Squared Sampson distance, in pixels of the image, of a pair of distorted positions to `y2^T F y1 = 0` between straightened ones. In straightened
/// pixels, the distortion that shrinks the image most would win.
fn bent_sampson_squared(f: &Matrix3<f64>, x1: &Vector2<f64>, x2: &Vector2<f64>, per_squared_pixel: f64) -> f64 {
    let (y1, y2) = (straight(x1, per_squared_pixel).push(1.0), straight(x2, per_squared_pixel).push(1.0));
    let (a, b) = (f * y1, f.tr_mul(&y2));
    // y = x / (1 + q): dy = dx / (1 + q) - 2 d x (x . dx) / (1 + q)^2, and the derivative is symmetric.
    let pull = |x: &Vector2<f64>, gradient: Vector2<f64>| {
        let s = 1.0 / (1.0 + per_squared_pixel * x.norm_squared());
        gradient * s - x * (2.0 * per_squared_pixel * s * s * x.dot(&gradient))
    };
    y2.dot(&a).powi(2) / (pull(x2, a.xy()).norm_squared() + pull(x1, b.xy()).norm_squared())
}

fn straight(x: &Vector2<f64>, per_squared_pixel: f64) -> Vector2<f64> {
    x / (1.0 + per_squared_pixel * x.norm_squared())
}

/// Fundamental matrices of all pairs for one distortion, in pixels from the centre.
struct Geometries {
    weighted: Vec<(f64, Matrix3<f64>)>,
    /// Mean squared Sampson distance in pixels of the image, truncated.
    cost: f64,
}

impl Geometries {
    fn new(pairs: &[Usable], per_squared_pixel: f64, max_error_px: f64, seed: u64) -> Self {
        // The matches are inliers already, but for a few.
        let o = RansacOptions { max_error: max_error_px, confidence: 0.999, min_iterations: 20, max_iterations: 50, seed };
        let limit = max_error_px * max_error_px;
        let (mut weighted, mut sum, mut count) = (Vec::with_capacity(pairs.len()), 0.0, 0usize);
        for pair in pairs {
            let [a, b] = [&pair.a, &pair.b].map(|x| x.iter().map(|x| straight(x, per_squared_pixel)).collect::<Vec<_>>());
            count += a.len();
            match estimate_fundamental(&a, &b, &o) {
                Some(found) => {
                    let errors = pair.a.iter().zip(&pair.b).map(|(a, b)| bent_sampson_squared(&found.model, a, b, per_squared_pixel));
                    // Written so that NaN counts in full.
                    sum += errors.map(|e| limit.min(e)).sum::<f64>();
                    weighted.push((pair.weight, found.model));
                }
                None => sum += limit * a.len() as f64,
            }
        }
        Self { weighted, cost: sum / count.max(1) as f64 }
    }

    /// Mean disagreement of the pairs with a focal length, 0..=1.
    fn disagreement(&self, focal_px: f64) -> f64 {
        let k = Matrix3::from_diagonal(&Vector3::new(focal_px, focal_px, 1.0));
        let (mut sum, mut weights) = (0.0, 0.0);
        for (weight, f) in &self.weighted {
            let s = (k * f * k).singular_values();
            let disagreement = (s[0] - s[1]) / (SATURATION * s[0]);
            sum += weight * if disagreement < 1.0 { disagreement } else { 1.0 };
            weights += weight;
        }
        if weights > 0.0 { sum / weights } else { 1.0 }
    }
}
