//! Descriptor matching: exhaustive nearest neighbours with ratio and mutual test.

mod kernel;
mod nearest;

pub use nearest::{MatchOptions, match_descriptors};
