//! The octaves of an image: what to keep of each, and the extrema in all of them.

use super::SiftOptions;
use super::band::{Octave, process};
use super::blur::Kernel;
use super::refine::{Candidate, Refiner};
use super::simd::Simd;
use rayon::prelude::*;
use scene::{Mask, Raster};

/// Octaves end before a side gets shorter than this: no keypoint fits in.
const SHORTEST_SIDE: usize = 12;
/// Rows of a band at most. A band computes some rows around itself again, so it must not be low.
const BAND_ROWS: usize = 512;

/// The Gaussian levels of an octave that keypoints are described on.
pub(super) struct Levels {
    /// Columns.
    pub(super) width: usize,
    /// Rows.
    pub(super) height: usize,
    /// Pixels of the image in a pixel of the octave.
    pub(super) pixel: f32,
    /// `images[k]` is level k + 1.
    pub(super) images: Vec<Vec<f32>>,
}

/// All octaves, the largest first.
pub(super) struct Pyramid {
    pub(super) octaves: Vec<Levels>,
    /// Standard deviation of level k, in pixels of the octave.
    pub(super) sigmas: Vec<f64>,
    /// Extrema, sorted by octave, level, row and column of their sample; each once.
    pub(super) candidates: Vec<Candidate>,
}

/// Builds the pyramid of an image and finds the extrema.
pub(super) fn build(grey: &Raster<f32>, mask: Option<&Mask>, options: &SiftOptions, simd: Simd) -> Pyramid {
    let layers = options.octave_layers;
    let first_sigma = f64::from(options.first_sigma_px);
    let sigmas: Vec<f64> = (0..layers + 3).map(|k| first_sigma * 2f64.powf(k as f64 / layers as f64)).collect();
    let cascade: Vec<Kernel> = sigmas.windows(2).map(|s| Kernel::gaussian((s[1] * s[1] - s[0] * s[0]).sqrt())).collect();

    let doubled = options.double_image.then(|| double(grey));
    let base = doubled.as_ref().unwrap_or(grey);
    let mut pixel = if options.double_image { 0.5 } else { 1.0 };
    let missing = first_sigma.powi(2) - (f64::from(options.camera_sigma_px) / pixel).powi(2);
    // Below a tenth of a pixel a sampled kernel is a single weight.
    let first = (missing > 0.01).then(|| Kernel::gaussian(missing.sqrt()));

    let mut pyramid = Pyramid { octaves: Vec::new(), sigmas, candidates: Vec::new() };
    let (mut width, mut height) = (base.width(), base.height());
    while width.min(height) >= SHORTEST_SIDE {
        let number = pyramid.octaves.len();
        let (source, source_width, decimation) = match pyramid.octaves.last() {
            None => (base.data(), base.width(), 1),
            Some(previous) => (&previous.images[layers - 1][..], previous.width, 2),
        };
        let refiner = Refiner {
            octave: number,
            width,
            height,
            pixel,
            layers,
            first_sigma,
            contrast: options.lowest_contrast(),
            edge: options.edge_threshold,
            mask,
        };
        let first = if number == 0 { first.as_ref() } else { None };
        let octave = Octave { source, source_width, decimation, width, height, first, cascade: &cascade, refiner, simd };
        let (images, candidates) = run_bands(&octave, layers);
        pyramid.candidates.extend(candidates);
        pyramid.octaves.push(Levels { width, height, pixel: pixel as f32, images });
        (width, height, pixel) = (width.div_ceil(2), height.div_ceil(2), 2.0 * pixel);
    }
    pyramid
}

/// The described levels of an octave and its extrema.
fn run_bands(octave: &Octave, layers: usize) -> (Vec<Vec<f32>>, Vec<Candidate>) {
    let (width, height) = (octave.width, octave.height);
    // An even number of equal bands suits two and four threads; it depends on the image alone.
    let bands = if height <= BAND_ROWS / 2 { 1 } else { 2 * height.div_ceil(2 * BAND_ROWS) };
    let rows = height.div_ceil(bands);
    let mut images: Vec<Vec<f32>> = (0..layers).map(|_| vec![0.0; width * height]).collect();
    let mut jobs: Vec<(usize, Vec<&mut [f32]>)> = (0..height.div_ceil(rows)).map(|b| (b * rows, Vec::new())).collect();
    for image in &mut images {
        for (job, part) in jobs.iter_mut().zip(image.chunks_mut(rows * width)) {
            job.1.push(part);
        }
    }
    let found: Vec<Vec<Candidate>> =
        jobs.into_par_iter().map(|(start, mut out)| process(octave, start..(start + rows).min(height), &mut out)).collect();
    let mut candidates: Vec<Candidate> = found.into_iter().flatten().collect();
    // Neighbouring samples can lead to the same extremum.
    let key = |c: &Candidate| (c.level, c.sample[1], c.sample[0]);
    candidates.sort_by_key(key);
    candidates.dedup_by_key(|c| key(c));
    (images, candidates)
}

/// The image at twice the size: pixel (2 i, 2 j) is pixel (i, j), those between are means, and the last are repeated.
fn double(image: &Raster<f32>) -> Raster<f32> {
    let (width, height) = (image.width(), image.height());
    let mut out = Raster::filled(2 * width, 2 * height, 0.0);
    if width == 0 || height == 0 {
        return out;
    }
    out.data_mut().par_chunks_mut(4 * width).enumerate().for_each(|(y, two_rows)| {
        let (a, b) = (image.row(y), image.row((y + 1).min(height - 1)));
        let (even, odd) = two_rows.split_at_mut(2 * width);
        for x in 0..width {
            let right = (x + 1).min(width - 1);
            even[2 * x] = a[x];
            even[2 * x + 1] = 0.5 * (a[x] + a[right]);
            odd[2 * x] = 0.5 * (a[x] + b[x]);
            odd[2 * x + 1] = 0.25 * ((a[x] + a[right]) + (b[x] + b[right]));
        }
    });
    out
}
