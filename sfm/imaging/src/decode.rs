//! Decoding of image files.

use crate::colour::luma;
use crate::exif::read_exif;
use crate::orient::exchanges_axes;
use crate::{ExifInfo, ImageFormat, ImageInfo, ImagingError, apply_orientation, jpeg};
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};
use scene::Raster;
use std::io::Cursor;

/// Largest number of pixels that is decoded: 400 megapixels, more than any camera of today. A header that announces more is refused before
/// memory for the pixels is asked for.
pub const MAX_PIXELS: u64 = 400_000_000;

/// What a decoder may allocate beside the pixels: tables, metadata, compressed chunks.
const SIDE_MEMORY: u64 = 256 << 20;

type ImageCursor<'a> = Cursor<&'a [u8]>;

/// Reads what the header of an image file says, without decoding pixels.
///
/// # Errors
/// [`ImagingError::Empty`], [`ImagingError::NotAnImage`], [`ImagingError::TooLarge`], [`ImagingError::Unsupported`],
/// [`ImagingError::Truncated`] and [`ImagingError::Corrupt`] for a header that cannot be read. Damage behind the header is found by decoding only.
pub fn probe(bytes: &[u8]) -> Result<ImageInfo, ImagingError> {
    let format = ImageFormat::of(bytes)?;
    let (width, height, bits) = match format {
        ImageFormat::Jpeg => {
            let header = jpeg::header(bytes)?;
            (header.width, header.height, header.bits)
        }
        _ => {
            let decoder = open(bytes, format)?;
            let (width, height) = decoder.dimensions();
            let colour = decoder.original_color_type();
            (width, height, (colour.bits_per_pixel() / u16::from(colour.channel_count())) as u8)
        }
    };
    check_size((width, height))?;
    let exif = read_exif(bytes);
    let (width, height) = if exchanges_axes(exif.orientation) { (height, width) } else { (width, height) };
    Ok(ImageInfo { width, height, format, bits_per_channel: bits, exif })
}

/// Decodes to grey in 0..=1, upright according to EXIF.
///
/// Colour becomes BT.601 luma (JPEG: the stored Y channel); 16 bits keep their precision; alpha is ignored.
///
/// # Errors
/// Those of [`probe`], and [`ImagingError::Truncated`] or [`ImagingError::Corrupt`] where the pixels are damaged: a partial image is never returned.
pub fn decode_grey(bytes: &[u8]) -> Result<Raster<f32>, ImagingError> {
    match decode(bytes, true)? {
        Pixels::Grey8(raster) => Ok(raster.map(|&v| f32::from(v) / 255.0)),
        Pixels::Rgb8(raster) => Ok(crate::grey_from_rgb(&raster)),
        Pixels::Other(image, format, exif) => {
            let size = (image.width(), image.height());
            let values = match image {
                DynamicImage::ImageLuma16(i) => i.into_raw().into_iter().map(|v| f32::from(v) / 65535.0).collect(),
                DynamicImage::ImageLumaA16(i) => i.as_raw().chunks_exact(2).map(|p| f32::from(p[0]) / 65535.0).collect(),
                DynamicImage::ImageRgb16(i) => i.as_raw().chunks_exact(3).map(luma16).collect(),
                DynamicImage::ImageRgba16(i) => i.as_raw().chunks_exact(4).map(luma16).collect(),
                DynamicImage::ImageRgb32F(i) => i.as_raw().chunks_exact(3).map(luma32).collect(),
                DynamicImage::ImageRgba32F(i) => i.as_raw().chunks_exact(4).map(luma32).collect(),
                other => other.to_luma32f().into_raw(),
            };
            Ok(apply_orientation(raster(format, size, values)?, exif.orientation))
        }
    }
}

/// Decodes to grey bytes, upright according to EXIF: what a mask file holds. 16 bits are rounded to 8; colour becomes luma, alpha is ignored.
///
/// # Errors
/// Those of [`decode_grey`].
pub fn decode_grey_u8(bytes: &[u8]) -> Result<Raster<u8>, ImagingError> {
    match decode(bytes, true)? {
        Pixels::Grey8(raster) => Ok(raster),
        Pixels::Rgb8(raster) => Ok(raster.map(|&[r, g, b]| luma(f32::from(r), f32::from(g), f32::from(b)).round() as u8)),
        Pixels::Other(image, format, exif) => {
            let luma = image.into_luma8();
            let size = luma.dimensions();
            Ok(apply_orientation(raster(format, size, luma.into_raw())?, exif.orientation))
        }
    }
}

/// Decodes to sRGB bytes, upright according to EXIF. Grey is repeated over the channels, 16 bits are rounded to 8, alpha is ignored.
///
/// # Errors
/// Those of [`decode_grey`].
pub fn decode_rgb(bytes: &[u8]) -> Result<Raster<[u8; 3]>, ImagingError> {
    match decode(bytes, false)? {
        Pixels::Grey8(raster) => Ok(raster.map(|&v| [v; 3])),
        Pixels::Rgb8(raster) => Ok(raster),
        Pixels::Other(image, format, exif) => {
            let rgb = image.into_rgb8();
            let size = rgb.dimensions();
            Ok(apply_orientation(raster(format, size, pixels_from_samples(rgb.into_raw()))?, exif.orientation))
        }
    }
}

/// Decoded pixels: the frequent kinds as upright rasters, the rest as the decoder left it.
enum Pixels {
    Grey8(Raster<u8>),
    Rgb8(Raster<[u8; 3]>),
    Other(DynamicImage, ImageFormat, ExifInfo),
}

fn decode(bytes: &[u8], luma: bool) -> Result<Pixels, ImagingError> {
    let format = ImageFormat::of(bytes)?;
    if format == ImageFormat::Jpeg {
        let header = jpeg::header(bytes)?;
        check_size((header.width, header.height))?;
        let size = (header.width, header.height);
        let samples = jpeg::decode(bytes, luma)?;
        let orientation = read_exif(bytes).orientation;
        return Ok(match samples {
            jpeg::Samples::Luma(v) => Pixels::Grey8(apply_orientation(raster(format, size, v)?, orientation)),
            jpeg::Samples::Rgb(v) => Pixels::Rgb8(apply_orientation(raster(format, size, pixels_from_samples(v))?, orientation)),
        });
    }
    let mut decoder = open(bytes, format)?;
    let size = decoder.dimensions();
    check_size(size)?;
    let mut limits = Limits::no_limits();
    // The samples may pass through a second buffer (planes, CMYK), hence twice.
    limits.max_alloc = Some(decoder.total_bytes().saturating_mul(2).saturating_add(SIDE_MEMORY));
    decoder.set_limits(limits).map_err(|e| error(e, format))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|e| error(e, format))?;
    let exif = read_exif(bytes);
    Ok(match image {
        DynamicImage::ImageLuma8(i) => Pixels::Grey8(apply_orientation(raster(format, size, i.into_raw())?, exif.orientation)),
        DynamicImage::ImageLumaA8(i) => {
            let grey = i.as_raw().chunks_exact(2).map(|p| p[0]).collect();
            Pixels::Grey8(apply_orientation(raster(format, size, grey)?, exif.orientation))
        }
        DynamicImage::ImageRgb8(i) => {
            Pixels::Rgb8(apply_orientation(raster(format, size, pixels_from_samples(i.into_raw()))?, exif.orientation))
        }
        DynamicImage::ImageRgba8(i) => {
            let rgb = i.as_raw().chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
            Pixels::Rgb8(apply_orientation(raster(format, size, rgb)?, exif.orientation))
        }
        other => Pixels::Other(other, format, exif),
    })
}

fn open(bytes: &[u8], format: ImageFormat) -> Result<impl ImageDecoder, ImagingError> {
    let kind = match format {
        ImageFormat::Jpeg => image::ImageFormat::Jpeg,
        ImageFormat::Png => image::ImageFormat::Png,
        ImageFormat::Tiff => image::ImageFormat::Tiff,
        ImageFormat::WebP => image::ImageFormat::WebP,
    };
    let cursor: ImageCursor = Cursor::new(bytes);
    ImageReader::with_format(cursor, kind).into_decoder().map_err(|e| error(e, format))
}

fn check_size((width, height): (u32, u32)) -> Result<(), ImagingError> {
    if u64::from(width) * u64::from(height) > MAX_PIXELS { Err(ImagingError::TooLarge { width, height }) } else { Ok(()) }
}

fn raster<T>(format: ImageFormat, (width, height): (u32, u32), values: Vec<T>) -> Result<Raster<T>, ImagingError> {
    // A decoder that returns another number of pixels than its header announces has met damage.
    let count = values.len();
    Raster::from_vec(width as usize, height as usize, values)
        .ok_or_else(|| ImagingError::Corrupt { format, detail: format!("{count} pixels where the header announces {width} x {height}") })
}

/// Groups samples into pixels.
fn pixels_from_samples(samples: Vec<u8>) -> Vec<[u8; 3]> {
    samples.as_chunks::<3>().0.to_vec()
}

fn luma16(p: &[u16]) -> f32 {
    luma(f32::from(p[0]), f32::from(p[1]), f32::from(p[2])) / 65535.0
}

fn luma32(p: &[f32]) -> f32 {
    let v = luma(p[0], p[1], p[2]);
    if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) }
}

fn error(error: ImageError, format: ImageFormat) -> ImagingError {
    let end_of_file = |e: &std::io::Error| e.kind() == std::io::ErrorKind::UnexpectedEof;
    match error {
        ImageError::IoError(e) if end_of_file(&e) => ImagingError::Truncated { format },
        ImageError::Unsupported(e) => ImagingError::Unsupported { format, detail: e.to_string() },
        other => {
            // The decoders wrap the end of the file in their own errors.
            let mut source = std::error::Error::source(&other);
            while let Some(inner) = source {
                if inner.downcast_ref::<std::io::Error>().is_some_and(end_of_file) {
                    return ImagingError::Truncated { format };
                }
                source = inner.source();
            }
            ImagingError::Corrupt { format, detail: other.to_string() }
        }
    }
}
