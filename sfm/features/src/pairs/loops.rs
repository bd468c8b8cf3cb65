//! Pairs of images that are far apart along the path and yet may show the same place.

use crate::retrieval::{GlobalDescriptor, Index};
use rayon::prelude::*;
use scene::ImageId;

/// Candidates that are looked at for each one that is wanted.
const LONGER: usize = 4;

/// Options of [`loop_candidates`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopOptions {
    /// Candidates of an image; those that others find it with come on top.
    pub per_image: usize,
    /// Exposures at most this far apart are left to [`sequential`](super::sequential): its window.
    pub window: u32,
    /// Exposures at most this far apart show one place, of which the first half of the candidates holds one image only: a place passed
    /// slowly does not take all. The other half are the best of the rest.
    pub spread: u32,
}

impl Default for LoopOptions {
    fn default() -> Self {
        Self { per_image: 10, window: 10, spread: 5 }
    }
}

/// An image that another one resembles.
#[derive(Clone, Copy)]
struct Candidate {
    image: usize,
    score: u64,
}

/// Candidates for loops: for each image those that resemble it most of all that are farther than the window along the path. Sorted, each once,
/// the lower id first.
///
/// `exposures[i]` is the exposure of image i. Candidates that have each other on their list come before others. Images without a description
/// or without features have none. Images that have nothing in common are no candidates, however many are wanted. The result has the same
/// bits at any number of threads and for every instruction set.
///
/// The peer: COLMAP's sequential matcher asks with every 10th image for the 50 that resemble it most, in a vocabulary tree learned elsewhere.
#[must_use]
pub fn loop_candidates(described: &[Option<GlobalDescriptor>], exposures: &[u32], options: &LoopOptions) -> Vec<(ImageId, ImageId)> {
    let count = described.len().min(exposures.len());
    let (described, exposures) = (&described[..count], &exposures[..count]);
    let index = Index::new(described);
    let longest = options.per_image.saturating_mul(LONGER);
    let found: Vec<Vec<Candidate>> = (0..count)
        .into_par_iter()
        .map_init(
            || vec![0; count],
            |scores, image| match &described[image] {
                Some(query) if !query.is_empty() => {
                    index.scores(query, scores);
                    let far = |other: &usize| exposures[*other].abs_diff(exposures[image]) > options.window;
                    best((0..count).filter(far).map(|other| Candidate { image: other, score: scores[other] }), longest)
                }
                _ => Vec::new(),
            },
        )
        .collect();
    let mut pairs: Vec<(ImageId, ImageId)> = (0..count)
        .into_par_iter()
        .flat_map_iter(|image| {
            let both = best(found[image].iter().map(|c| mutual(*c, image, &found[c.image])), longest);
            chosen(&both, exposures, options).into_iter().map(move |other| (ImageId::new(image.min(other)), ImageId::new(image.max(other))))
        })
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// The best `longest` of those with a score, best first; ties go to the lower id.
fn best(candidates: impl Iterator<Item = Candidate>, longest: usize) -> Vec<Candidate> {
    let mut candidates: Vec<Candidate> = candidates.filter(|c| c.score > 0).collect();
    let order = |c: &Candidate| (std::cmp::Reverse(c.score), c.image);
    if candidates.len() > longest && longest > 0 {
        candidates.select_nth_unstable_by_key(longest - 1, order);
    }
    candidates.truncate(longest);
    // Thousands of these lists are kept, each made from thousands of candidates.
    candidates.shrink_to_fit();
    candidates.sort_unstable_by_key(order);
    candidates
}

/// A candidate of an image with what the image is to the candidate.
fn mutual(candidate: Candidate, image: usize, back: &[Candidate]) -> Candidate {
    let returned = back.iter().find(|c| c.image == image).map_or(0, |c| c.score);
    Candidate { score: candidate.score + returned, ..candidate }
}

/// The images to compare with: half from different places, the rest as they rank.
fn chosen(ranked: &[Candidate], exposures: &[u32], options: &LoopOptions) -> Vec<usize> {
    let mut places: Vec<usize> = Vec::with_capacity(options.per_image);
    for candidate in ranked {
        if places.len() == options.per_image.div_ceil(2) {
            break;
        }
        let here = exposures[candidate.image];
        if places.iter().all(|&place| exposures[place].abs_diff(here) > options.spread) {
            places.push(candidate.image);
        }
    }
    let rest: Vec<usize> = ranked.iter().map(|c| c.image).filter(|image| !places.contains(image)).collect();
    places.extend(rest.into_iter().take(options.per_image.saturating_sub(places.len())));
    places
}
