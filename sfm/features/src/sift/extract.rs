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
use scene::{Descriptor, Features, Keypoint, Mask, Raster};

/// Keypoints that one task describes.
const TASK: usize = 64;

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

    let oriented: Vec<Vec<(usize, f32)>> = kept
        .par_chunks(TASK)
        .map(|task| {
            let directions = |&i: &usize| {
                let candidate = &pyramid.candidates[i];
                let [x, y] = candidate.position;
                let found = orientations(simd, pyramid.view(candidate), x, y, candidate.sigma, options.max_orientations);
                found.into_iter().map(move |angle| (i, angle))
            };
            task.iter().flat_map(directions).collect()
        })
        .collect();
    let mut oriented = oriented.concat();
    oriented.truncate(options.max_features);

    let descriptors: Vec<Vec<Descriptor>> = oriented
        .par_chunks(TASK)
        .map(|task| {
            let one = |&(i, angle): &(usize, f32)| {
                let candidate = &pyramid.candidates[i];
                let [x, y] = candidate.position;
                describe(simd, pyramid.view(candidate), x, y, candidate.sigma, angle)
            };
            task.iter().map(one).collect()
        })
        .collect();
    let keypoint = |&(i, angle): &(usize, f32)| {
        let candidate = &pyramid.candidates[i];
        let pixel = pixels[candidate.octave];
        let [x, y] = candidate.position.map(|v| v * pixel + 0.5);
        Keypoint { x, y, scale: candidate.sigma * pixel, orientation: angle }
    };
    Ok(Features { keypoints: oriented.iter().map(keypoint).collect(), descriptors: descriptors.concat() })
}

impl Pyramid {
    /// The level whose blur is nearest to the keypoint's.
    fn view(&self, candidate: &Candidate) -> View<'_> {
        let octave = &self.octaves[candidate.octave];
        let distance = |k: usize| (self.sigmas[k].ln() - f64::from(candidate.sigma).ln()).abs();
        let level = (1..=octave.images.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(1);
        View { data: &octave.images[level - 1], width: octave.width, height: octave.height }
    }
}
