//! What can go wrong in dense matching.

use scene::{CameraError, ImageId};
use thiserror::Error;

/// Why a dense result could not be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DenseError {
    /// Colours, mask and camera of a view have different sizes.
    #[error("view of image {image}: {what} is {found:?}, the camera {expected:?}")]
    SizeMismatch {
        /// The image.
        image: ImageId,
        /// Which raster.
        what: &'static str,
        /// (width, height) of the camera.
        expected: (usize, usize),
        /// (width, height) of the raster.
        found: (usize, usize),
    },
    /// The range of depths is empty, not positive or not finite.
    #[error("depth range {0} to {1} is not possible")]
    BadRange(f64, f64),
    /// An option has a value that cannot work.
    #[error("option {name}: {why}")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// What is wrong with it.
        why: &'static str,
    },
    /// The lens of a view cannot be represented without distortion.
    #[error("image {image} cannot be made free of distortion")]
    Rectification {
        /// The image.
        image: ImageId,
        /// Why.
        source: CameraError,
    },
    /// The bytes are no depth map of this version, or are damaged.
    #[error("not a usable depth map: {0}")]
    BadBytes(&'static str),
}
