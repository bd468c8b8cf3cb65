//! What can be wrong with an image or a video.

use crate::ImageFormat;

/// Why an image or a video could not be read or written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ImagingError {
    /// No bytes at all: a copy that was interrupted, or a card that was full.
    #[error("empty file")]
    Empty,
    /// The first bytes belong to none of the formats that are read.
    #[error("not an image: its first bytes are those of no JPEG, PNG, TIFF or WebP file")]
    NotAnImage,
    /// A legal file of a kind that is not read.
    #[error("unsupported {format}: {detail}")]
    Unsupported {
        /// Format of the file.
        format: ImageFormat,
        /// What is not supported.
        detail: String,
    },
    /// The header announces more pixels than [`crate::MAX_PIXELS`].
    #[error("image of {width} x {height} pixels is larger than the limit of {} megapixels", crate::MAX_PIXELS / 1_000_000)]
    TooLarge {
        /// Announced width, pixels.
        width: u32,
        /// Announced height, pixels.
        height: u32,
    },
    /// The data end before the image does.
    #[error("truncated {format}: the file ends before the image does")]
    Truncated {
        /// Format of the file.
        format: ImageFormat,
    },
    /// The data contradict the format.
    #[error("damaged {format}: {detail}")]
    Corrupt {
        /// Format of the file.
        format: ImageFormat,
        /// What the decoder found.
        detail: String,
    },
    /// An image could not be encoded.
    #[error("cannot write a {width} x {height} image as {format}: {detail}")]
    Encode {
        /// Format that was asked for.
        format: ImageFormat,
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// What the encoder says.
        detail: String,
    },
    /// A video could not be opened or read.
    #[error("video {path}: {detail}")]
    Video {
        /// The file.
        path: String,
        /// What is wrong.
        detail: String,
    },
}
