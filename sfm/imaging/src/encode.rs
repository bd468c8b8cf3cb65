//! Encoding. The bytes depend on the pixels alone: no time, no host, no version of ours.

use crate::{ImageFormat, ImagingError};
use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};
use scene::Raster;

/// A grey PNG of 8 bits.
///
/// # Errors
/// [`ImagingError::Encode`] for a raster without pixels.
pub fn encode_png_grey(raster: &Raster<u8>) -> Result<Vec<u8>, ImagingError> {
    encode(raster, ImageFormat::Png, |out, w, h| PngEncoder::new(out).write_image(raster.data(), w, h, ExtendedColorType::L8))
}

/// A grey PNG of 16 bits.
///
/// # Errors
/// [`ImagingError::Encode`] for a raster without pixels.
pub fn encode_png_grey16(raster: &Raster<u16>) -> Result<Vec<u8>, ImagingError> {
    let bytes: Vec<u8> = raster.data().iter().flat_map(|v| v.to_ne_bytes()).collect();
    encode(raster, ImageFormat::Png, |out, w, h| PngEncoder::new(out).write_image(&bytes, w, h, ExtendedColorType::L16))
}

/// An RGB PNG of 8 bits a channel.
///
/// # Errors
/// [`ImagingError::Encode`] for a raster without pixels.
pub fn encode_png_rgb(raster: &Raster<[u8; 3]>) -> Result<Vec<u8>, ImagingError> {
    encode(raster, ImageFormat::Png, |out, w, h| {
        PngEncoder::new(out).write_image(raster.data().as_flattened(), w, h, ExtendedColorType::Rgb8)
    })
}

/// A baseline JPEG; `quality` 1 to 100 (0 is taken as 1, more than 100 as 100).
///
/// # Errors
/// [`ImagingError::Encode`] for a raster without pixels, or with a side above 65,535.
pub fn encode_jpeg_rgb(raster: &Raster<[u8; 3]>, quality: u8) -> Result<Vec<u8>, ImagingError> {
    let quality = quality.clamp(1, 100);
    encode(raster, ImageFormat::Jpeg, |out, w, h| {
        JpegEncoder::new_with_quality(out, quality).write_image(raster.data().as_flattened(), w, h, ExtendedColorType::Rgb8)
    })
}

fn encode<T>(
    raster: &Raster<T>,
    format: ImageFormat,
    write: impl FnOnce(&mut Vec<u8>, u32, u32) -> Result<(), ImageError>,
) -> Result<Vec<u8>, ImagingError> {
    let (width, height) = (raster.width(), raster.height());
    let failed = |detail: String| ImagingError::Encode { format, width, height, detail };
    if width == 0 || height == 0 {
        return Err(failed("it has no pixels".to_owned()));
    }
    let (Ok(w), Ok(h)) = (u32::try_from(width), u32::try_from(height)) else {
        return Err(failed("a side exceeds 32 bits".to_owned()));
    };
    let mut out = Vec::new();
    write(&mut out, w, h).map_err(|e| failed(e.to_string()))?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{decode_grey_u8, decode_rgb};

    fn gradient() -> Raster<[u8; 3]> {
        let pixels = (0..40 * 30).map(|i| [(i % 40 * 6) as u8, (i / 40 * 8) as u8, 128]).collect();
        Raster::from_vec(40, 30, pixels).expect("one value a pixel")
    }

    #[test]
    fn png_keeps_every_value() {
        let rgb = gradient();
        let bytes = encode_png_rgb(&rgb).expect("valid");
        assert_eq!(decode_rgb(&bytes).expect("valid"), rgb);
        assert_eq!(encode_png_rgb(&rgb).expect("valid"), bytes, "same pixels, same bytes");
        let mask = rgb.map(|p| if p[0] > 100 { 255 } else { 0 });
        assert_eq!(decode_grey_u8(&encode_png_grey(&mask).expect("valid")).expect("valid"), mask);
    }

    #[test]
    fn png_keeps_sixteen_bits() {
        let depth = gradient().map(|p| u16::from(p[0]) * 257 + u16::from(p[1]));
        let bytes = encode_png_grey16(&depth).expect("valid");
        let back = image::load_from_memory(&bytes).expect("a PNG").into_luma16();
        assert_eq!(back.as_raw(), depth.data());
    }

    #[test]
    fn jpeg_keeps_values_nearly() {
        let rgb = gradient();
        let bytes = encode_jpeg_rgb(&rgb, 95).expect("valid");
        let back = decode_rgb(&bytes).expect("valid");
        let largest = rgb.data().as_flattened().iter().zip(back.data().as_flattened()).map(|(a, b)| a.abs_diff(*b)).max();
        // Quality 95 quantises a smooth gradient to within a few grey values.
        assert!(largest < Some(8), "{largest:?}");
        assert!(encode_jpeg_rgb(&rgb, 10).expect("valid").len() < bytes.len());
        assert!(encode_jpeg_rgb(&rgb, 0).is_ok());
    }

    #[test]
    fn no_pixels_is_an_error() {
        let empty = Raster::filled(0, 5, [0u8; 3]);
        assert!(matches!(encode_png_rgb(&empty), Err(ImagingError::Encode { .. })));
        assert!(matches!(encode_jpeg_rgb(&Raster::filled(70_000, 1, [0; 3]), 90), Err(ImagingError::Encode { .. })));
    }
}
