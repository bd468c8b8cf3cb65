//! Extraction of the features of an image.

use super::SiftOptions;
use super::descriptor::describe;
use super::orientation::{View, orientations};
use super::pyramid::{Pyramid, build};
use super::refine::Candidate;
use super::select::select;
use super::simd::Simd;
use crate::FeatureError;
use rayon::prelude::*;
use scene::{Features, Keypoint, Mask, Raster};

/// Keypoints that one task describes at least.
const TASK: usize = 64;
/// Rows of a strip that keypoints are described along: its pixels fit into a core's cache.
const PLACE_ROWS: u32 = 32;

/// Finds SIFT keypoints in a grey image (0..=1) and describes them as RootSIFT; the best come first.
///
/// Positions are in pixels with the centre of the top-left pixel at (0.5, 0.5). Keypoints on pixels where the mask is 0 are dropped before
/// any are counted. Images too small for a keypoint, or without structure, have no features. The result has the same bits at any number
/// of threads and for every instruction set.
///
/// # Errors
/// [`FeatureError::MaskSize`] and [`FeatureError::Option`].
pub fn extract(grey: &Raster<f32>, mask: Option<&Mask>, options: &SiftOptions) -> Result<Features, FeatureError> {
    extract_with(Simd::best(), grey, mask, options)
}

/// [`extract`] with a given instruction set.
pub(super) fn extract_with(simd: Simd, grey: &Raster<f32>, mask: Option<&Mask>, options: &SiftOptions) -> Result<Features, FeatureError> {
    options.check()?;
    let (width, height) = (grey.width(), grey.height());
    if let Some(mask) = mask.filter(|m| (m.width(), m.height()) != (width, height)) {
        return Err(FeatureError::MaskSize { width, height, mask_width: mask.width(), mask_height: mask.height() });
    }
    let pyramid = build(grey, mask, options, simd);
    let pixels: Vec<f32> = pyramid.octaves.iter().map(|o| o.pixel).collect();
    let kept = select(&pyramid.candidates, &pixels, (width, height), options);

    let directions = pyramid.for_each(&kept, |_, candidate, view| {
        let [x, y] = candidate.position;
        orientations(simd, view, x, y, candidate.sigma, options.max_orientations)
    });
    let mut oriented: Vec<(usize, f32)> = Vec::with_capacity(options.max_features.min(2 * kept.len()));
    for (&i, directions) in kept.iter().zip(&directions) {
        oriented.extend(directions.iter().map(|&angle| (i, angle)));
    }
    oriented.truncate(options.max_features);

    let described: Vec<usize> = oriented.iter().map(|&(i, _)| i).collect();
    let descriptors = pyramid.for_each(&described, |n, candidate, view| {
        let [x, y] = candidate.position;
        describe(simd, view, x, y, candidate.sigma, oriented[n].1)
    });
    let keypoint = |&(i, angle): &(usize, f32)| {
        let candidate = &pyramid.candidates[i];
        let pixel = pixels[candidate.octave];
        let [x, y] = candidate.position.map(|v| v * pixel + 0.5);
        Keypoint { x, y, scale: candidate.sigma * pixel, orientation: angle }
    };
    Ok(Features { keypoints: oriented.iter().map(keypoint).collect(), descriptors })
}

impl Pyramid {
    /// What `work` makes of each of the `kept` candidates (its place in `kept`, itself and its level), in the order of `kept`.
    ///
    /// The work goes from place to place: neighbours find each other's pixels in the cache.
    fn for_each<T: Send>(&self, kept: &[usize], work: impl Fn(usize, &Candidate, View) -> T + Sync) -> Vec<T> {
        let place = |&n: &usize| {
            let candidate = &self.candidates[kept[n]];
            (candidate.octave, self.level(candidate), candidate.sample[1] / PLACE_ROWS, candidate.sample[0], n)
        };
        let mut order: Vec<usize> = (0..kept.len()).collect();
        order.sort_by_cached_key(place);
        let one = |&n: &usize| {
            let candidate = &self.candidates[kept[n]];
            (n, work(n, candidate, self.view(candidate)))
        };
        let mut done: Vec<(usize, T)> = order.par_iter().with_min_len(TASK).map(one).collect();
        done.sort_unstable_by_key(|&(n, _)| n);
        done.into_iter().map(|(_, result)| result).collect()
    }

    /// The level whose blur is nearest to the keypoint's.
    fn level(&self, candidate: &Candidate) -> usize {
        let distance = |k: usize| (self.sigmas[k].ln() - f64::from(candidate.sigma).ln()).abs();
        let levels = self.octaves[candidate.octave].images.len();
        (1..=levels).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(1)
    }

    fn view(&self, candidate: &Candidate) -> View<'_> {
        let (octave, level) = (&self.octaves[candidate.octave], self.level(candidate));
        View { data: &octave.images[level - 1], width: octave.width, height: octave.height }
    }
}
