//! Features of images: extraction, matching and geometric verification.

mod error;
mod guided;
mod harris;
mod matching;
pub mod pairs;
mod random;
mod retrieval;
mod sift;
mod verify;

pub use error::FeatureError;
pub use guided::{GuidedOptions, MatchImage, match_pair};
pub use harris::{HarrisOptions, NccOptions, extract_harris, match_guided};
pub use matching::{MatchOptions, match_descriptors};
pub use retrieval::{Codebook, GlobalDescriptor, RetrievalOptions};
pub use sift::{SiftOptions, extract};
pub use verify::{
    ImageForPair, InteriorEstimate, PairForInterior, PairVerdict, Rejection, VerifyOptions, interior_from_pairs, verify_pair,
};
