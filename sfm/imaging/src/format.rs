//! Formats that are read, and what a header says about an image.

use crate::{ExifInfo, ImagingError};

/// Format of an image file, told from its first bytes and never from its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageFormat {
    /// JPEG (JFIF or EXIF), baseline and progressive.
    Jpeg,
    /// PNG.
    Png,
    /// TIFF.
    Tiff,
    /// WebP, lossy and lossless.
    WebP,
}

impl std::fmt::Display for ImageFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Jpeg => "JPEG",
            Self::Png => "PNG",
            Self::Tiff => "TIFF",
            Self::WebP => "WebP",
        })
    }
}

impl ImageFormat {
    /// The format whose signature `bytes` start with.
    ///
    /// # Errors
    /// [`ImagingError::Empty`] and [`ImagingError::NotAnImage`].
    pub(crate) fn of(bytes: &[u8]) -> Result<Self, ImagingError> {
        match bytes {
            [] => Err(ImagingError::Empty),
            [0xFF, 0xD8, 0xFF, ..] => Ok(Self::Jpeg),
            [0x89, b'P', b'N', b'G', 0x0D, 0x0A, 0x1A, 0x0A, ..] => Ok(Self::Png),
            [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] | [b'I', b'I', 43, 0, ..] | [b'M', b'M', 0, 43, ..] => Ok(Self::Tiff),
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Ok(Self::WebP),
            _ => Err(ImagingError::NotAnImage),
        }
    }
}

/// What the header of an image file says.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageInfo {
    /// Width after the EXIF orientation, pixels: what [`crate::decode_grey`] returns.
    pub width: u32,
    /// Height after the EXIF orientation, pixels.
    pub height: u32,
    /// Format of the file.
    pub format: ImageFormat,
    /// Bits of one channel as stored: 8, 16, ...
    pub bits_per_channel: u8,
    /// Camera data; empty where the file has none.
    pub exif: ExifInfo,
}
