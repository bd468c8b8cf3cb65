//! Matches that agree with one two-view geometry.

use nalgebra::{Matrix3, Vector2};
use scene::{Camera, Features, ImageId, KeypointIndex, PairConfiguration, VerifiedPair};
use solve::ransac::{Ransac, RansacOptions};
use solve::relative::{estimate_essential, estimate_fundamental, estimate_homography};

/// Above this share of the inliers a homography explains the pair too (COLMAP's rule): a plane, or a camera that only
/// turned.
const PLANAR_SHARE: f64 = 0.8;
/// Iterations of the homography, which only has to tell planar pairs from others.
const HOMOGRAPHY_ITERATIONS: usize = 500;

/// Options of [`verify_pair`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerifyOptions {
    /// Largest distance from the epipolar geometry, pixels.
    pub max_error_px: f64,
    /// Least number of inliers.
    pub min_inliers: usize,
    /// Least share of inliers among the tentative matches.
    pub min_inlier_share: f64,
    /// Iterations of RANSAC at most.
    pub max_iterations: usize,
    /// Seed; every pair draws by its own ids.
    pub seed: u64,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        Self { max_error_px: 4.0, min_inliers: 15, min_inlier_share: 0.1, max_iterations: 3000, seed: 0 }
    }
}

/// An image of a pair.
#[derive(Clone, Copy, Debug)]
pub struct ImageForPair<'a> {
    /// Its id.
    pub id: ImageId,
    /// Its interior orientation.
    pub camera: &'a Camera,
    /// The interior orientation is a calibration and not a guess.
    pub camera_known: bool,
    /// Its features.
    pub features: &'a Features,
}

/// What came of a pair.
#[derive(Clone, Debug, PartialEq)]
pub enum PairVerdict {
    /// Enough matches agree.
    Verified(VerifiedPair),
    /// So few matches agree that chance explains them.
    Rejected {
        /// Matches that agree.
        inliers: usize,
    },
}

/// Verifies the tentative matches of a pair, `a.id < b.id`.
///
/// With both interior orientations known by the essential matrix (five points), else by the fundamental matrix (seven
/// points), each in LO-RANSAC; then a homography tells planar and panoramic pairs. The result depends on the arguments
/// alone.
#[must_use]
pub fn verify_pair(
    a: &ImageForPair<'_>,
    b: &ImageForPair<'_>,
    tentative: &[(KeypointIndex, KeypointIndex)],
    options: &VerifyOptions,
) -> PairVerdict {
    if tentative.len() < options.min_inliers {
        return PairVerdict::Rejected { inliers: 0 };
    }
    let pixel = |f: &Features, k: KeypointIndex| {
        let k = &f.keypoints[k.index()];
        Vector2::new(f64::from(k.x), f64::from(k.y))
    };
    let xa: Vec<Vector2<f64>> = tentative.iter().map(|m| pixel(a.features, m.0)).collect();
    let xb: Vec<Vector2<f64>> = tentative.iter().map(|m| pixel(b.features, m.1)).collect();
    let ransac = RansacOptions {
        max_error: options.max_error_px,
        confidence: 0.9999,
        min_iterations: 50,
        max_iterations: options.max_iterations,
        seed: options.seed ^ (u64::from(a.id.0) << 32) ^ u64::from(b.id.0),
    };
    let calibrated = a.camera_known && b.camera_known;
    let found = if calibrated { essential(a.camera, b.camera, &xa, &xb, &ransac) } else { estimate_fundamental(&xa, &xb, &ransac) };
    let inliers = found.as_ref().map_or(0, |f| f.inliers.len());
    let Some(found) = found.filter(|_| enough(inliers, tentative.len(), options)) else { return PairVerdict::Rejected { inliers } };
    let few = RansacOptions { max_iterations: HOMOGRAPHY_ITERATIONS, ..ransac };
    let homography = estimate_homography(&xa, &xb, &few);
    let homography_inliers = homography.as_ref().map_or(0, |h| h.inliers.len());
    let matches = found.inliers.iter().map(|&i| tentative[i]).collect();
    let configuration = match homography {
        Some(h) if homography_inliers as f64 >= PLANAR_SHARE * inliers as f64 => {
            PairConfiguration::PlanarOrPanoramic { homography: h.model }
        }
        _ if calibrated => PairConfiguration::Calibrated { essential: found.model },
        _ => PairConfiguration::Uncalibrated { fundamental: found.model },
    };
    PairVerdict::Verified(VerifiedPair { images: (a.id, b.id), matches, configuration, homography_inliers })
}

fn enough(inliers: usize, tentative: usize, options: &VerifyOptions) -> bool {
    inliers >= options.min_inliers && inliers as f64 >= options.min_inlier_share * tentative as f64
}

/// The essential matrix of undistorted coordinates; inliers are indices of the given matches.
fn essential(a: &Camera, b: &Camera, xa: &[Vector2<f64>], xb: &[Vector2<f64>], ransac: &RansacOptions) -> Option<Ransac<Matrix3<f64>>> {
    let (mut index, mut ya, mut yb) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (pa, pb)) in xa.iter().zip(xb).enumerate() {
        // Pixels beyond the fold of the distortion have no ray and cannot be inliers.
        if let (Some(ua), Some(ub)) = (a.unproject(pa), b.unproject(pb)) {
            index.push(i);
            ya.push(ua);
            yb.push(ub);
        }
    }
    let max_error = ransac.max_error / ((a.mean_focal() + b.mean_focal()) / 2.0);
    let mut found = estimate_essential(&ya, &yb, &RansacOptions { max_error, ..*ransac })?;
    for i in &mut found.inliers {
        *i = index[*i];
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Keypoint;
    use synthetic::survey::{SurveyOptions, survey};

    fn features(positions: &[[f32; 2]]) -> Features {
        let keypoints = positions.iter().map(|&[x, y]| Keypoint { x, y, scale: 2.0, orientation: 0.0 }).collect();
        Features { keypoints, descriptors: Vec::new() }
    }

    #[test]
    fn right_matches_stay_and_wrong_ones_go() {
        let made = survey(&SurveyOptions { exposures: 3, points: 800, outlier_share: 0.6, noise_px: 0.5, ..SurveyOptions::default() });
        for pair in &made.pairs {
            let (a, b) = pair.images;
            let (fa, fb) = (features(&made.truth.keypoints[a.index()]), features(&made.truth.keypoints[b.index()]));
            let right = pair.matches.len() as f64 / 1.6;
            for known in [true, false] {
                let camera = &made.truth.cameras[0];
                let image = |id, features| ImageForPair { id, camera, camera_known: known, features };
                let PairVerdict::Verified(found) = verify_pair(&image(a, &fa), &image(b, &fb), &pair.matches, &VerifyOptions::default())
                else {
                    panic!("{a} and {b} are rejected");
                };
                // Some wrong matches lie on their epipolar line by chance: a strip of 8 of 600 px.
                assert!(found.matches.len() as f64 >= 0.97 * right, "{} of {right}", found.matches.len());
                assert!(found.matches.len() as f64 <= 1.06 * right, "{} of {right}", found.matches.len());
                let again = verify_pair(&image(a, &fa), &image(b, &fb), &pair.matches, &VerifyOptions::default());
                assert_eq!(again, PairVerdict::Verified(found));
            }
        }
    }

    #[test]
    fn chance_is_rejected() {
        let mut random = synthetic::Random::new(3);
        let mut positions =
            || -> Vec<[f32; 2]> { (0..200).map(|_| [random.range(0.0, 960.0) as f32, random.range(0.0, 600.0) as f32]).collect() };
        let (fa, fb) = (features(&positions()), features(&positions()));
        let tentative: Vec<_> = (0..200).map(|i| (KeypointIndex(i), KeypointIndex(i))).collect();
        let camera = SurveyOptions::default().camera;
        let image = |id, features| ImageForPair { id: ImageId(id), camera: &camera, camera_known: false, features };
        let options = VerifyOptions { min_inliers: 30, ..VerifyOptions::default() };
        assert!(matches!(verify_pair(&image(0, &fa), &image(1, &fb), &tentative, &options), PairVerdict::Rejected { .. }));
    }
}
