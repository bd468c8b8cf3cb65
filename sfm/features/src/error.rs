//! What can go wrong in this package.

use thiserror::Error;

/// Errors of feature extraction.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FeatureError {
    /// The mask does not lie over the image pixel by pixel.
    #[error("the mask has {mask_width} x {mask_height} pixels, its image {width} x {height}")]
    MaskSize {
        /// Columns of the image.
        width: usize,
        /// Rows of the image.
        height: usize,
        /// Columns of the mask.
        mask_width: usize,
        /// Rows of the mask.
        mask_height: usize,
    },
    /// An option has a value that no extraction is possible with.
    #[error("option {option} is {value}, but must be {expected}")]
    Option {
        /// Name of the field.
        option: &'static str,
        /// Its value.
        value: String,
        /// What is possible.
        expected: &'static str,
    },
}
