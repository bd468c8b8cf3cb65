//! The inverted index of a dive, and votes for images.

use super::GlobalDescriptor;
use super::hamming::{Popcount, Signature};

/// Hamming distance of signatures from which on features are different.
const DIFFERENT: u8 = 25;
/// Postings that are compared at a time.
const BLOCK: usize = 256;
/// Features that an image counts as having at least: a match of a handful of features says little.
const FEW: usize = 64;

/// The features of all images, by word.
pub(crate) struct Index {
    /// Features of word w: `first[w]..first[w + 1]`.
    first: Vec<usize>,
    /// Their images, ascending in a word.
    images: Vec<u32>,
    signatures: Vec<Signature>,
    /// 256 times the square root of the number of features of each image.
    scales: Vec<u64>,
    popcount: Popcount,
}

impl Index {
    /// The index of all images; those without a description are never voted for.
    pub fn new(described: &[Option<GlobalDescriptor>]) -> Self {
        Self::with(Popcount::best(), described)
    }

    /// [`Index::new`] with a given instruction set.
    pub(super) fn with(popcount: Popcount, described: &[Option<GlobalDescriptor>]) -> Self {
        let all = || described.iter().flatten().flat_map(|d| &d.words);
        let words = all().max().map_or(0, |&last| usize::from(last) + 1);
        let mut first = vec![0; words + 1];
        for &word in all() {
            first[usize::from(word) + 1] += 1;
        }
        for w in 0..words {
            first[w + 1] += first[w];
        }
        let mut next = first.clone();
        let mut images = vec![0; first[words]];
        let mut signatures = vec![Signature(0); images.len()];
        for (image, one) in described.iter().enumerate() {
            let features = one.iter().flat_map(|d| d.words.iter().zip(&d.signatures));
            for (&word, &signature) in features {
                let at = &mut next[usize::from(word)];
                (images[*at], signatures[*at]) = (image as u32, signature);
                *at += 1;
            }
        }
        let scale = |one: &Option<GlobalDescriptor>| ((one.as_ref().map_or(0, GlobalDescriptor::len).max(FEW) as u64) << 16).isqrt();
        Self { first, images, signatures, scales: described.iter().map(scale).collect(), popcount }
    }

    /// How much each image has in common with one, into `scores`: votes by the square of what their signatures' distance falls short of
    /// being different, the best of each feature of the query, over the square root of the number of features. Twice the same image
    /// scores most; the number depends on the query, so only scores of one query compare.
    pub fn scores(&self, query: &GlobalDescriptor, scores: &mut [u64]) {
        scores.fill(0);
        let mut distances = [0; BLOCK];
        for (&word, &signature) in query.words.iter().zip(&query.signatures) {
            let word = usize::from(word);
            if word + 1 >= self.first.len() {
                continue;
            }
            let all = self.first[word]..self.first[word + 1];
            let (mut image, mut best) = (0, 0);
            for start in all.clone().step_by(BLOCK) {
                let block = start..(start + BLOCK).min(all.end);
                self.popcount.distances(signature, &self.signatures[block.clone()], &mut distances);
                for (&distance, &posting) in distances.iter().zip(&self.images[block]).filter(|(distance, _)| **distance < DIFFERENT) {
                    let vote = u64::from(DIFFERENT - distance).pow(2);
                    if posting == image {
                        best = best.max(vote);
                    } else {
                        scores[image as usize] += best;
                        (image, best) = (posting, vote);
                    }
                }
            }
            if best > 0 {
                scores[image as usize] += best;
            }
        }
        for (score, scale) in scores.iter_mut().zip(&self.scales) {
            *score = (*score << 20) / scale;
        }
    }
}
