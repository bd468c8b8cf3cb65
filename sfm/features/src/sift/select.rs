//! Which keypoints to keep.

use super::SiftOptions;
use super::refine::Candidate;

/// Keypoints that a cell of the grid holds on average when `max_features` are spread evenly.
const PER_CELL: f64 = 32.0;

/// Indices of the keypoints to keep, at most `max_features`.
///
/// The first half are the strongest of the image: they match best. For the second half the image is divided into square cells, and those
/// come first whose cell has kept the fewest stronger ones: cells fill up evenly, and no region monopolises.
pub(super) fn select(candidates: &[Candidate], pixels: &[f32], size: (usize, usize), options: &SiftOptions) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..candidates.len()).collect();
    // Stable, as all sorting here: equal responses stay in the order of the candidates.
    kept.sort_by(|&a, &b| candidates[b].response.total_cmp(&candidates[a].response));
    let strong = kept.partition_point(|&i| candidates[i].response >= options.contrast_threshold);
    kept.truncate(strong.max(options.min_keypoints));
    if kept.len() <= options.max_features {
        return kept;
    }

    let (width, height) = (size.0 as f64, size.1 as f64);
    let side = (width * height * PER_CELL / options.max_features.max(1) as f64).sqrt().max(1.0);
    let (columns, rows) = ((width / side).ceil().max(1.0) as usize, (height / side).ceil().max(1.0) as usize);
    let mut counts = vec![0usize; columns * rows];
    let mut rank = |i: usize| {
        let candidate = &candidates[i];
        let pixel = f64::from(pixels[candidate.octave]);
        let cell = |v: f32, n: usize| ((f64::from(v) * pixel / side) as usize).min(n - 1);
        let count = &mut counts[cell(candidate.position[1], rows) * columns + cell(candidate.position[0], columns)];
        *count += 1;
        *count
    };
    let half = options.max_features * 3 / 4;
    let mut ranked: Vec<(usize, usize)> = kept.iter().map(|&i| (rank(i), i)).collect();
    ranked[half..].sort_by_key(|&(rank, _)| rank);
    ranked.truncate(options.max_features);
    ranked.into_iter().map(|(_, i)| i).collect()
}
