//! What can be wrong with a mask.

/// Why a mask cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MaskError {
    /// A mask of another size than its image would shift every decision.
    #[error("the mask has {found_width} x {found_height} pixels, its image {expected_width} x {expected_height}")]
    Size {
        /// Width of the mask, pixels.
        found_width: usize,
        /// Height of the mask, pixels.
        found_height: usize,
        /// Width of the image, pixels.
        expected_width: usize,
        /// Height of the image, pixels.
        expected_height: usize,
    },
}
