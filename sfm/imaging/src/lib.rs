//! Images in and out: decoding, EXIF, video, colour, resizing, filters and the measurement of circular targets.
//!
//! Every function takes and returns plain values; nothing here knows a path but the video reader, which OpenCV forces to.
//! Pixels follow [`scene::Raster`]: row-major, the centre of the top-left pixel at (0.5, 0.5). Grey is f32 in 0..=1, colour
//! is sRGB bytes. Colour profiles and gamma are left as they are: feature detection, masks and dense matching work on encoded values.

mod blur;
mod colour;
mod decode;
mod encode;
mod error;
mod exif;
mod format;
mod hash;
mod jpeg;
mod orient;
mod resize;
mod target;
#[cfg(feature = "video")]
pub mod video;

pub use blur::{gaussian_blur, gaussian_kernel};
pub use colour::grey_from_rgb;
pub use decode::{MAX_PIXELS, decode_grey, decode_grey_u8, decode_rgb, probe};
pub use encode::{encode_jpeg_rgb, encode_png_grey, encode_png_grey16, encode_png_rgb};
pub use error::ImagingError;
pub use exif::{ExifInfo, FocalEstimate, FocalRule};
pub use format::{ImageFormat, ImageInfo};
pub use hash::{ContentHash, content_hash};
pub use orient::apply_orientation;
pub use resize::{resize_area_grey, resize_area_rgb, resize_nearest};
pub use target::{CircleTarget, NoTarget, measure_circle};
