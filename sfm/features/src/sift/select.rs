//! Which keypoints to keep.

use super::SiftOptions;
use super::refine::Candidate;

/// Keypoints that a cell of the grid holds on average when `max_features` are spread evenly.
const PER_CELL: f64 = 32.0;

/// Indices of the keypoints to keep, at most `max_features`.
///
/// The first three quarters are the strongest of the image: they match best. For the last quarter the image is divided into square cells, and those
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
    let strongest = options.max_features * 3 / 4;
    let mut ranked: Vec<(usize, usize)> = kept.iter().map(|&i| (rank(i), i)).collect();
    ranked[strongest..].sort_by_key(|&(rank, _)| rank);
    ranked.truncate(options.max_features);
    ranked.into_iter().map(|(_, i)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Candidates on a grid of 40 x 20 places over 400 x 200 px: strong ones right of the middle, weak ones left.
    fn candidates() -> Vec<Candidate> {
        let at = |i: usize| {
            let position = [(i % 40) as f32 * 10.0 + 5.0, (i / 40) as f32 * 10.0 + 5.0];
            let response = if position[0] < 200.0 { 0.01 } else { 0.1 } + 1e-5 * (i * 7919 % 800) as f32;
            Candidate { octave: 0, level: 1, sample: position.map(|v| v as u32), position, sigma: 2.0, response }
        };
        (0..800).map(at).collect()
    }

    #[test]
    fn strongest_first_and_the_rest_where_little_is() {
        let candidates = candidates();
        let options = SiftOptions { max_features: 200, ..SiftOptions::default() };
        let kept = select(&candidates, &[1.0], (400, 200), &options);
        let is_left = |&&i: &&usize| candidates[i].position[0] < 200.0;
        assert_eq!(kept.len(), 200);
        assert!(kept[..150].windows(2).all(|w| candidates[w[0]].response > candidates[w[1]].response));
        assert_eq!(kept[..150].iter().filter(is_left).count(), 0);
        // By response alone there would be none: 400 on the right are stronger.
        assert!(kept[150..].iter().filter(is_left).count() >= 20, "{kept:?}");
    }

    #[test]
    fn weak_ones_fill_up_to_the_minimum() {
        let candidates = candidates();
        let count = |min_keypoints, contrast_threshold| {
            let options = SiftOptions { min_keypoints, contrast_threshold, ..SiftOptions::default() };
            select(&candidates, &[1.0], (400, 200), &options).len()
        };
        assert_eq!((count(0, 0.05), count(500, 0.05), count(5000, 0.05), count(0, 0.001)), (400, 500, 800, 800));
    }
}
