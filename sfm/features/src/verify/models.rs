//! Robust epipolar geometry of the matches of a pair.

use super::VerifyOptions;
use super::chance::log10_false_alarms;
use super::verdict::ImageForPair;
use nalgebra::{Matrix3, Vector2};
use scene::{Camera, KeypointIndex};
use solve::ransac::{Ransac, RansacOptions};
use solve::relative::{
    estimate_essential, estimate_fundamental, estimate_homography, improve_essential, improve_fundamental, sampson_squared,
    transfer_squared,
};

type Positions = Vec<Vector2<f64>>;
type Estimate = fn(&[Vector2<f64>], &[Vector2<f64>], &RansacOptions) -> Option<Ransac<Matrix3<f64>>>;
type Improve = fn(&Matrix3<f64>, &[Vector2<f64>], &[Vector2<f64>], f64) -> Option<Ransac<Matrix3<f64>>>;

/// Samples that are drawn in any case.
const MIN_ITERATIONS: usize = 30;
/// Inliers beyond which a pair needs no count of the fewest that mean something.
const FEW: usize = 60;
/// Samples of the homography: at 0.9999, enough for half of the matches in a plane. It only has to recognise four fifths.
const HOMOGRAPHY_ITERATIONS: usize = 100;
/// Matches that it is estimated from, evenly spread: a plane is known to a small part of the largest error from far fewer.
const HOMOGRAPHY_MATCHES: usize = 200;
/// Agreement is also looked at for these shares of the largest error: right matches agree better than chance needs.
const ERROR_SHARES: [f64; 3] = [1.0, 0.5, 0.25];

/// Pixel positions of the matches of a pair.
pub(super) struct Pixels {
    pub a: Positions,
    pub b: Positions,
}

impl Pixels {
    pub(super) fn new(a: &ImageForPair<'_>, b: &ImageForPair<'_>, matches: &[(KeypointIndex, KeypointIndex)]) -> Self {
        let pixel = |image: &ImageForPair<'_>, k: KeypointIndex| {
            let keypoint = &image.features.keypoints[k.index()];
            Vector2::new(f64::from(keypoint.x), f64::from(keypoint.y))
        };
        Self { a: matches.iter().map(|m| pixel(a, m.0)).collect(), b: matches.iter().map(|m| pixel(b, m.1)).collect() }
    }
}

/// Matches to estimate an epipolar geometry from.
pub(super) struct Epipolar {
    x1: Positions,
    x2: Positions,
    /// In the unit of the positions.
    max_error: f64,
    /// Probability for a random match to be within the largest error.
    chance: f64,
    /// Matches of a minimal sample, and most models that come from it.
    minimal: (usize, usize),
    estimate: Estimate,
    improve: Improve,
}

/// An epipolar geometry.
#[derive(Clone)]
pub(super) struct Fit {
    pub model: Matrix3<f64>,
    /// Positions of all matches that agree, rising.
    pub inliers: Vec<usize>,
}

impl Epipolar {
    /// In pixels, for a fundamental matrix.
    pub(super) fn uncalibrated(pixels: &Pixels, cameras: [&Camera; 2], options: &VerifyOptions) -> Self {
        Self {
            x1: pixels.a.clone(),
            x2: pixels.b.clone(),
            max_error: options.max_error_px,
            chance: chance(cameras, options.max_error_px),
            minimal: (7, 3),
            estimate: estimate_fundamental,
            improve: improve_fundamental,
        }
    }

    /// In undistorted normalised coordinates, for an essential matrix.
    pub(super) fn calibrated(pixels: &Pixels, cameras: [&Camera; 2], options: &VerifyOptions) -> Self {
        // Pixels beyond the fold of the distortion have no ray: not a number, never an inlier.
        let rays =
            |camera: &Camera, pixels: &Positions| pixels.iter().map(|p| camera.unproject(p).unwrap_or(Vector2::repeat(f64::NAN))).collect();
        let focal_px = 0.5 * (cameras[0].mean_focal() + cameras[1].mean_focal());
        Self {
            x1: rays(cameras[0], &pixels.a),
            x2: rays(cameras[1], &pixels.b),
            max_error: options.max_error_px / focal_px,
            chance: chance(cameras, options.max_error_px),
            minimal: (5, 10),
            estimate: estimate_essential,
            improve: improve_essential,
        }
    }

    /// Estimates from the matches `among`, and takes in all others that agree. `Err` holds the number of inliers where they are fewer than
    /// wanted or mean nothing.
    pub(super) fn fit(&self, among: &[usize], options: &VerifyOptions, seed: u64) -> Result<Fit, usize> {
        let least = self.fewest_meaningful(among.len(), options.min_inliers);
        if among.len() < least {
            return Err(0);
        }
        let first = self.run(among, self.samples(least, among.len(), options), options, seed).ok_or(0usize)?;
        if first.inliers.len() < least.min(options.min_inliers) {
            return Err(first.inliers.len());
        }
        let mut best = self.extended(first.model);
        if best.inliers.len() > first.inliers.len()
            && let Some(again) = self.run(&best.inliers, MIN_ITERATIONS, options, seed)
        {
            let again = self.extended(again.model);
            if again.inliers.len() >= best.inliers.len() {
                best = again;
            }
        }
        self.judged(best, among, options)
    }

    /// As [`Epipolar::fit`], from a model of fewer matches of the pair instead of samples.
    pub(super) fn improved(&self, model: &Matrix3<f64>, among: &[usize], options: &VerifyOptions) -> Result<Fit, usize> {
        let agreeing = self.extended(*model).inliers;
        let at = |x: &Positions| -> Positions { agreeing.iter().map(|&i| x[i]).collect() };
        let found = (self.improve)(model, &at(&self.x1), &at(&self.x2), self.max_error).ok_or(agreeing.len())?;
        self.judged(self.extended(found.model), among, options)
    }

    fn judged(&self, best: Fit, among: &[usize], options: &VerifyOptions) -> Result<Fit, usize> {
        let inliers = best.inliers.len();
        let everything = 0..self.x1.len();
        let meaningful = self.means_something(&best.model, among.iter().copied()) || self.means_something(&best.model, everything);
        if inliers >= options.min_inliers && meaningful { Ok(best) } else { Err(inliers) }
    }

    /// Number of inliers among some matches, for the best model of this kind on them, in as many samples as `inliers` of them need.
    pub(super) fn count(&self, among: &[usize], inliers: usize, options: &VerifyOptions, seed: u64) -> usize {
        self.run(among, self.samples(inliers, among.len(), options), options, seed).map_or(0, |r| r.inliers.len())
    }

    /// Whether a match agrees with a model.
    pub(super) fn agrees(&self, model: &Matrix3<f64>, i: usize) -> bool {
        sampson_squared(model, &self.x1[i], &self.x2[i]) < self.max_error * self.max_error
    }

    fn run(&self, among: &[usize], max_iterations: usize, options: &VerifyOptions, seed: u64) -> Option<Ransac<Matrix3<f64>>> {
        let x1: Positions = among.iter().map(|&i| self.x1[i]).collect();
        let x2: Positions = among.iter().map(|&i| self.x2[i]).collect();
        let min_iterations = MIN_ITERATIONS.min(max_iterations);
        let o = RansacOptions { max_error: self.max_error, confidence: options.confidence, min_iterations, max_iterations, seed };
        (self.estimate)(&x1, &x2, &o)
    }

    fn extended(&self, model: Matrix3<f64>) -> Fit {
        Fit { model, inliers: (0..self.x1.len()).filter(|&i| self.agrees(&model, i)).collect() }
    }

    /// Fewest inliers among `tentative` that could mean something, when they agree as well as right matches do.
    fn fewest_meaningful(&self, tentative: usize, min_inliers: usize) -> usize {
        let finest = self.chance * ERROR_SHARES[ERROR_SHARES.len() - 1];
        let (sample, models) = self.minimal;
        let means = |k: usize| k > tentative || log10_false_alarms(tentative, k, sample, models, finest) < 0.0;
        (min_inliers..min_inliers.max(FEW)).find(|&k| means(k)).unwrap_or(min_inliers.max(FEW))
    }

    /// Samples after which one free of outliers was drawn with the wanted confidence, if there are as many inliers.
    fn samples(&self, inliers: usize, tentative: usize, options: &VerifyOptions) -> usize {
        let share = (inliers as f64 / tentative as f64).min(0.99);
        let success = share.powi(self.minimal.0 as i32);
        let needed = (1.0 - options.confidence).max(f64::MIN_POSITIVE).ln() / (-success).ln_1p();
        needed.ceil().max(MIN_ITERATIONS as f64).min(options.max_iterations as f64) as usize
    }

    fn means_something(&self, model: &Matrix3<f64>, among: impl ExactSizeIterator<Item = usize> + Clone) -> bool {
        let (sample, models) = self.minimal;
        ERROR_SHARES.iter().any(|share| {
            let limit = (share * self.max_error).powi(2);
            let close = among.clone().filter(|&i| sampson_squared(model, &self.x1[i], &self.x2[i]) < limit).count();
            // As many alarms again for each error that is tried.
            log10_false_alarms(among.len(), close, sample, models * ERROR_SHARES.len(), share * self.chance) < 0.0
        })
    }
}

/// A homography of some matches in pixels, and how many of them agree.
pub(super) fn homography(pixels: &Pixels, among: &[usize], options: &VerifyOptions, seed: u64) -> Option<(Matrix3<f64>, usize)> {
    let at = |some: &[usize], x: &Positions| -> Positions { some.iter().map(|&i| x[i]).collect() };
    let few: Vec<usize> = among.iter().copied().step_by(among.len().div_ceil(HOMOGRAPHY_MATCHES).max(1)).collect();
    let found = estimate_homography(
        &at(&few, &pixels.a),
        &at(&few, &pixels.b),
        &RansacOptions {
            max_error: options.max_error_px,
            confidence: options.confidence,
            min_iterations: MIN_ITERATIONS.min(options.max_iterations),
            max_iterations: HOMOGRAPHY_ITERATIONS.min(options.max_iterations),
            seed,
        },
    )?;
    let limit = options.max_error_px * options.max_error_px;
    let errors = transfer_squared(&found.model, &at(among, &pixels.a), &at(among, &pixels.b));
    Some((found.model, errors.iter().filter(|e| **e < limit).count()))
}

/// Share of the image within the distance of a line: the band as long as the diagonal. A Sampson distance is shared by both images,
/// which makes the distance in one larger by the root of 2.
fn chance(cameras: [&Camera; 2], error_px: f64) -> f64 {
    let band = |camera: &Camera| {
        let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
        2.0 * std::f64::consts::SQRT_2 * error_px * width.hypot(height) / (width * height)
    };
    band(cameras[0]).max(band(cameras[1]))
}
