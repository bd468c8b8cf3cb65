//! The verdict on a pair.

use super::VerifyOptions;
use super::coherent::coherent;
use super::models::{Epipolar, Fit, Pixels, homography};
use super::still::{along_the_border, still};
use super::verdict::{ImageForPair, PairVerdict, Rejection};
use crate::random;
use nalgebra::Matrix3;
use scene::{KeypointIndex, PairConfiguration, VerifiedPair};

/// Matches that are enough to tell whether a fundamental matrix explains more than an essential one.
const ENOUGH_TO_COMPARE: usize = 500;
/// Inliers by which a fundamental matrix exceeds an essential one for no other reason than its two more degrees of freedom.
const FREE_INLIERS: usize = 4;

/// Verifies the tentative matches of a pair.
///
/// LO-RANSAC, first on the matches whose keypoints turn alike, then on all that agree: the essential matrix (five points, undistorted
/// coordinates) when both interior orientations are known, else the fundamental matrix (seven points, pixels as they are). The inliers must be
/// more than chance explains (Moisan & Stival, IJCV 2004). If a homography explains nearly as many, no relative position can be trusted and
/// the pair is planar or panoramic. If both interior orientations are known, but a fundamental matrix explains clearly more, the pair is
/// uncalibrated.
///
/// Matches that do not move are left out where the others move otherwise; alone they count, as from two images of the same view, unless
/// they keep to the border.
///
/// The order of the two images does not matter; the smaller id comes first in the result. Matches of keypoints that do not exist are
/// ignored. The result depends on the arguments alone. Runs on one thread.
#[must_use]
pub fn verify_pair(
    a: &ImageForPair<'_>,
    b: &ImageForPair<'_>,
    tentative: &[(KeypointIndex, KeypointIndex)],
    options: &VerifyOptions,
) -> PairVerdict {
    verify_from(a, b, tentative, None, options)
}

/// [`verify_pair`] from the geometry of fewer matches of the pair, where there is one, instead of samples.
pub(crate) fn verify_from(
    a: &ImageForPair<'_>,
    b: &ImageForPair<'_>,
    tentative: &[(KeypointIndex, KeypointIndex)],
    guess: Option<&Guess>,
    options: &VerifyOptions,
) -> PairVerdict {
    match Pair::new(a, b, tentative, options).and_then(|pair| Ok((pair.decide(guess)?, pair))) {
        Ok((geometry, pair)) => PairVerdict::Verified(pair.verified(geometry)),
        Err(rejection) => PairVerdict::Rejected(rejection),
    }
}

/// What some of the matches of a pair say of it.
pub(crate) struct Guess {
    /// Those that agree, the keypoint of the image with the lower id first.
    pub matches: Vec<(KeypointIndex, KeypointIndex)>,
    model: Matrix3<f64>,
    essential: bool,
}

impl Guess {
    /// The essential matrix, where it is one that describes the pair.
    pub(crate) fn essential(&self) -> Option<Matrix3<f64>> {
        self.essential.then_some(self.model)
    }
}

/// The geometry that [`verify_pair`] would find; `None` where it rejects the pair.
pub(crate) fn guess(
    a: &ImageForPair<'_>,
    b: &ImageForPair<'_>,
    tentative: &[(KeypointIndex, KeypointIndex)],
    options: &VerifyOptions,
) -> Option<Guess> {
    let pair = Pair::new(a, b, tentative, options).ok()?;
    let Geometry { fit, essential } = pair.decide(None).ok()?;
    Some(Guess { matches: fit.inliers.iter().map(|&i| pair.matches[i]).collect(), model: fit.model, essential })
}

/// A stream of its own for each pair.
fn pair_seed(seed: u64, a: u32, b: u32) -> u64 {
    random::mix(seed.wrapping_add((u64::from(a) << 32 | u64::from(b)).wrapping_mul(random::STEP)))
}

struct Pair<'a> {
    a: &'a ImageForPair<'a>,
    b: &'a ImageForPair<'a>,
    matches: Vec<(KeypointIndex, KeypointIndex)>,
    pixels: Pixels,
    options: &'a VerifyOptions,
    seed: u64,
}

/// An epipolar geometry and its kind.
struct Geometry {
    fit: Fit,
    essential: bool,
}

impl<'a> Pair<'a> {
    fn new(
        a: &'a ImageForPair<'a>,
        b: &'a ImageForPair<'a>,
        tentative: &[(KeypointIndex, KeypointIndex)],
        options: &'a VerifyOptions,
    ) -> Result<Self, Rejection> {
        let swapped = a.id > b.id;
        let (a, b) = if swapped { (b, a) } else { (a, b) };
        let mut matches: Vec<_> = tentative.iter().map(|&(i, j)| if swapped { (j, i) } else { (i, j) }).collect();
        matches.retain(|&(i, j)| i.index() < a.features.keypoints.len() && j.index() < b.features.keypoints.len());
        matches.sort_unstable();
        if matches.len() < options.min_inliers.max(1) {
            return Err(Rejection::FewMatches { tentative: matches.len() });
        }
        let seed = pair_seed(options.seed, a.id.0, b.id.0);
        Ok(Self { a, b, pixels: Pixels::new(a, b, &matches), matches, options, seed })
    }

    /// The geometry of the pair, from that of some of its matches where there is one.
    fn decide(&self, guess: Option<&Guess>) -> Result<Geometry, Rejection> {
        let all: Vec<usize> = (0..self.matches.len()).collect();
        let cameras = [self.a.camera, self.b.camera];
        let found = self.geometry(&all, guess);
        let still = still(&self.pixels, cameras, self.options.max_still_px);
        let inliers = found.as_ref().map_or_else(|inliers| *inliers, |g| g.fit.inliers.len());
        let still_inliers = match &found {
            Ok(g) => still.iter().filter(|i| g.fit.inliers.binary_search(i).is_ok()).count(),
            Err(_) => still.len(),
        };
        let mut found = found;
        if 2 * still_inliers > inliers {
            let moving: Vec<usize> = all.iter().copied().filter(|i| still.binary_search(i).is_err()).collect();
            match self.geometry(&moving, None) {
                // Far points hardly move and agree; the vehicle does not, unless it only translates, where it does no harm.
                Ok(moved) if 2 * self.count_agreeing(&moved, &still) < still.len() => found = Ok(self.without(moved, &still)),
                Ok(_) => {}
                Err(_) if still.len() >= self.options.min_inliers && along_the_border(&still, &self.pixels, self.a.camera) => {
                    return Err(Rejection::Still { still: still.len(), tentative: all.len() });
                }
                Err(_) => {}
            }
        }
        found.map_err(|inliers| Rejection::FewInliers { inliers, tentative: all.len() })
    }

    fn epipolar(&self, essential: bool) -> Epipolar {
        let cameras = [self.a.camera, self.b.camera];
        if essential {
            Epipolar::calibrated(&self.pixels, cameras, self.options)
        } else {
            Epipolar::uncalibrated(&self.pixels, cameras, self.options)
        }
    }

    /// The epipolar geometry of some matches, or the number of inliers that were too few.
    fn geometry(&self, some: &[usize], guess: Option<&Guess>) -> Result<Geometry, usize> {
        let tentative: Vec<_> = some.iter().map(|&i| self.matches[i]).collect();
        let among: Vec<usize> = coherent(self.a.features, self.b.features, &tentative).into_iter().map(|k| some[k]).collect();
        let free = self.epipolar(false);
        let fit = |epipolar: &Epipolar, essential: bool| match guess {
            Some(guess) if guess.essential == essential => epipolar.improved(&guess.model, &among, self.options),
            _ => epipolar.fit(&among, self.options, self.seed),
        };
        let fundamental = || fit(&free, false).map(|fit| Geometry { fit, essential: false });
        if !(self.a.camera_known && self.b.camera_known) {
            return fundamental();
        }
        match fit(&self.epipolar(true), true) {
            Ok(fit) if self.is_calibrated(&fit, &free, &among) => Ok(Geometry { fit, essential: true }),
            Ok(fit) => match fundamental() {
                Ok(other) if !self.explains_as_much(fit.inliers.len(), other.fit.inliers.len()) => Ok(other),
                _ => Ok(Geometry { fit, essential: true }),
            },
            Err(inliers) => fundamental().map_err(|others| inliers.max(others)),
        }
    }

    /// Whether an essential matrix explains as much as a fundamental matrix, as far as an even choice of matches tells.
    fn is_calibrated(&self, essential: &Fit, free: &Epipolar, among: &[usize]) -> bool {
        let few: Vec<usize> = among.iter().copied().step_by(among.len().div_ceil(ENOUGH_TO_COMPARE)).collect();
        let inliers = few.iter().filter(|i| essential.inliers.binary_search(i).is_ok()).count();
        // No fundamental matrix can explain more than all of them.
        self.explains_as_much(inliers, few.len())
            || self.explains_as_much(inliers, free.count(&few, inliers.max(7), self.options, self.seed))
    }

    fn explains_as_much(&self, essential: usize, fundamental: usize) -> bool {
        essential as f64 >= self.options.min_essential_share * fundamental.saturating_sub(FREE_INLIERS) as f64
    }

    fn count_agreeing(&self, geometry: &Geometry, some: &[usize]) -> usize {
        let epipolar = self.epipolar(geometry.essential);
        some.iter().filter(|&&i| epipolar.agrees(&geometry.fit.model, i)).count()
    }

    fn without(&self, mut geometry: Geometry, still: &[usize]) -> Geometry {
        geometry.fit.inliers.retain(|i| still.binary_search(i).is_err());
        geometry
    }

    fn verified(&self, geometry: Geometry) -> VerifiedPair {
        let inliers = &geometry.fit.inliers;
        let homography = homography(&self.pixels, inliers, self.options, self.seed);
        let homography_inliers = homography.as_ref().map_or(0, |h| h.1);
        let configuration = match homography {
            Some((homography, count)) if count as f64 >= self.options.min_planar_share * inliers.len() as f64 => {
                PairConfiguration::PlanarOrPanoramic { homography }
            }
            _ if geometry.essential => PairConfiguration::Calibrated { essential: geometry.fit.model },
            _ => PairConfiguration::Uncalibrated { fundamental: geometry.fit.model },
        };
        let matches = inliers.iter().map(|&i| self.matches[i]).collect();
        VerifiedPair { images: (self.a.id, self.b.id), matches, configuration, homography_inliers }
    }
}
