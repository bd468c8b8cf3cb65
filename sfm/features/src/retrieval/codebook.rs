//! The vocabulary of a dive, and images described in it.

use super::RetrievalOptions;
use super::hamming::Signature;
use super::kmeans::{assign, kmeans};
use crate::FeatureError;
use crate::matching::nearest;
use crate::random::SplitMix64;
use rayon::prelude::*;
use scene::Descriptor;

/// Fewest descriptors of the sample that a word is learned from.
const LEAST_OF_A_WORD: usize = 8;

/// A vocabulary of visual words, learned from a sample of the descriptors of a dive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Codebook {
    /// Centres of the upper level.
    upper: Vec<Descriptor>,
    /// Words of `upper[i]`: `words[first[i]..first[i + 1]]`.
    first: Vec<usize>,
    /// Centres of the words.
    words: Vec<Descriptor>,
    max_features: usize,
}

/// An image in a few kilobytes: the words of its best features and what tells features of one word apart. Sorted by word.
///
/// Only those of one [`Codebook`] can be compared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GlobalDescriptor {
    pub(super) words: Vec<u16>,
    pub(super) signatures: Vec<Signature>,
}

impl GlobalDescriptor {
    /// Number of features.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.len()
    }

    /// Whether the image had no features.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }
}

impl Codebook {
    /// What one image of `images` puts into the sample that [`Codebook::learn`] asks for: an even choice of its best descriptors.
    pub fn share<'a>(descriptors: &'a [Descriptor], images: usize, options: &RetrievalOptions) -> impl Iterator<Item = &'a Descriptor> {
        let best = &descriptors[..descriptors.len().min(options.max_features)];
        let wanted = options.sample.div_ceil(images.max(1)).min(best.len());
        (0..wanted).map(move |i| &best[i * best.len() / wanted])
    }

    /// Learns the vocabulary from descriptors of all parts of the dive, in an order that has to be the same to give the same again.
    ///
    /// A sample too small for all words gives fewer; none at all gives a vocabulary in which every image is empty. The result depends on the
    /// arguments alone.
    ///
    /// # Errors
    /// [`FeatureError::Option`].
    pub fn learn(sample: &[Descriptor], options: &RetrievalOptions, seed: u64) -> Result<Self, FeatureError> {
        options.check()?;
        let mut random = SplitMix64(seed);
        let words_at_most = |descriptors: usize| (descriptors / LEAST_OF_A_WORD).clamp(1, options.branches);
        let upper = kmeans(sample, words_at_most(sample.len()), options.rounds, &mut random);
        let mut members: Vec<Vec<Descriptor>> = vec![Vec::new(); upper.len()];
        for (descriptor, centre) in sample.iter().zip(assign(sample, &upper)) {
            members[centre as usize].push(*descriptor);
        }
        let seeds: Vec<u64> = upper.iter().map(|_| random.next()).collect();
        let lower: Vec<Vec<Descriptor>> = (members.par_iter().zip(&seeds).zip(&upper))
            .map(|((members, &seed), centre)| match members.as_slice() {
                [] => vec![*centre],
                some => kmeans(some, words_at_most(some.len()), options.rounds, &mut SplitMix64(seed)),
            })
            .collect();
        let mut first = vec![0];
        for words in &lower {
            first.push(first[first.len() - 1] + words.len());
        }
        Ok(Self { upper, first, words: lower.concat(), max_features: options.max_features })
    }

    /// Number of words.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.len()
    }

    /// Whether it was learned from nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Describes an image by the best of its features, those that come first. Runs on one thread.
    #[must_use]
    pub fn describe(&self, descriptors: &[Descriptor]) -> GlobalDescriptor {
        let best = &descriptors[..descriptors.len().min(self.max_features)];
        let cells = nearest(best, &self.upper);
        let mut order: Vec<(u32, u32)> = cells.iter().zip(0..).map(|(&cell, feature)| (cell, feature)).collect();
        order.sort_unstable();
        let mut described: Vec<(u16, Signature)> = Vec::with_capacity(best.len());
        for some in order.chunk_by(|a, b| a.0 == b.0) {
            let cell = some[0].0 as usize;
            let words = &self.words[self.first[cell]..self.first[cell + 1]];
            let features: Vec<Descriptor> = some.iter().map(|&(_, feature)| best[feature as usize]).collect();
            for (feature, word) in features.iter().zip(nearest(&features, words)) {
                let signature = Signature::new(feature, &words[word as usize]);
                described.push(((self.first[cell] + word as usize) as u16, signature));
            }
        }
        described.sort_unstable();
        let (words, signatures) = described.into_iter().unzip();
        GlobalDescriptor { words, signatures }
    }
}
