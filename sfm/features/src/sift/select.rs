//! Which keypoints to keep.

use super::SiftOptions;
use super::refine::Candidate;

/// Keypoints that a cell of the grid holds on average when `max_features` are spread evenly.
const PER_CELL: f64 = 32.0;

/// Indices of the keypoints to keep, the best first, at most `max_features`.
///
/// The image is divided into square cells. A keypoint's rank is its place in its cell by response, and keypoints are taken by rank: first
/// the strongest of every cell, then every second, and so on. So cells share evenly until a cell has no more, and no region monopolises.
pub(super) fn select(candidates: &[Candidate], pixels: &[f32], size: (usize, usize), options: &SiftOptions) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..candidates.len()).collect();
    // Stable: equal responses stay in the order of the candidates.
    kept.sort_by(|&a, &b| candidates[b].response.total_cmp(&candidates[a].response));
    let strong = kept.partition_point(|&i| candidates[i].response >= options.contrast_threshold);
    kept.truncate(strong.max(options.min_keypoints));

    let (width, height) = (size.0 as f64, size.1 as f64);
    let side = (width * height * PER_CELL / options.max_features.max(1) as f64).sqrt().max(1.0);
    let (columns, rows) = ((width / side).ceil().max(1.0) as usize, (height / side).ceil().max(1.0) as usize);
    let mut counts = vec![0u32; columns * rows];
    let mut ranked: Vec<(u32, usize)> = Vec::with_capacity(kept.len());
    for &i in &kept {
        let candidate = &candidates[i];
        let pixel = f64::from(pixels[candidate.octave]);
        let cell = |v: f32, n: usize| ((f64::from(v) * pixel / side) as usize).min(n - 1);
        let count = &mut counts[cell(candidate.position[1], rows) * columns + cell(candidate.position[0], columns)];
        ranked.push((*count, i));
        *count += 1;
    }
    // Stable: within a rank, the strongest first.
    ranked.sort_by_key(|&(rank, _)| rank);
    ranked.truncate(options.max_features);
    ranked.into_iter().map(|(_, i)| i).collect()
}
