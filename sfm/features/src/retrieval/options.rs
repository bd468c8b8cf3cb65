//! Options of the retrieval.

use crate::FeatureError;

/// Options of [`Codebook`](crate::Codebook).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RetrievalOptions {
    /// Branches of both levels of the vocabulary, which has at most this many words squared; 2..=256.
    pub branches: usize,
    /// Rounds of k-means on either level.
    pub rounds: usize,
    /// Descriptors that the vocabulary is learned from, over the whole dive.
    pub sample: usize,
    /// Features of an image that are described, the first ones: extraction puts the best first. 10 bytes each.
    pub max_features: usize,
}

impl Default for RetrievalOptions {
    fn default() -> Self {
        Self { branches: 64, rounds: 8, sample: 1 << 17, max_features: 1024 }
    }
}

impl RetrievalOptions {
    /// Refuses values with which nothing could be learned.
    pub(super) fn check(&self) -> Result<(), FeatureError> {
        let value = self.branches.to_string();
        match self.branches {
            2..=256 => Ok(()),
            _ => Err(FeatureError::Option { option: "branches", value, expected: "between 2 and 256" }),
        }
    }
}
