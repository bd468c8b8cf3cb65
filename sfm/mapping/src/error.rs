//! What stops an orientation.

use thiserror::Error;

/// Why no orientation was made.
#[derive(Debug, Error)]
pub enum MapError {
    /// The input contradicts itself.
    #[error("the input of the orientation is inconsistent: {0}")]
    Inconsistent(String),
    /// Nothing to start from.
    #[error(
        "no pair of images gives a start: {candidates} pairs were tried, the best had {best_inliers} inliers (at least {needed} needed). \
         The images may not overlap, or show too little texture"
    )]
    NoInitialPair {
        /// Pairs tried.
        candidates: usize,
        /// Inliers of the best.
        best_inliers: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The bundle adjustment refused its input.
    #[error("bundle adjustment: {0}")]
    Adjust(#[from] solve::adjust::AdjustError),
}
