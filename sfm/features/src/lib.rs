//! Features of images: extraction, matching and geometric verification.

mod error;
mod sift;

pub use error::FeatureError;
pub use sift::{SiftOptions, extract};
