//! JPEG: a walk over its segments that finds size and damage before any decoding, and the decoder itself.
//!
//! Decoders of this format are forgiving: they return a picture that turns grey where the data end. A survey must not match
//! features on that, so a file has to reach its end marker, and the decoder runs in its strict mode. Not found: a picture
//! that was cut and properly closed again with an end marker.

use crate::{ImageFormat, ImagingError};
use zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions};
use zune_jpeg::{JpegDecoder, errors::DecodeErrors};

/// What the frame header says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub width: u32,
    pub height: u32,
    pub bits: u8,
}

const SOI: u8 = 0xD8;
const EOI: u8 = 0xD9;
const SOS: u8 = 0xDA;
const TRUNCATED: ImagingError = ImagingError::Truncated { format: ImageFormat::Jpeg };

fn corrupt(detail: impl Into<String>) -> ImagingError {
    ImagingError::Corrupt { format: ImageFormat::Jpeg, detail: detail.into() }
}

/// Reads up to the frame header (SOF).
///
/// # Errors
/// [`ImagingError::Truncated`], [`ImagingError::Corrupt`], and [`ImagingError::Unsupported`] for lossless, hierarchical and arithmetic-coded files
/// and for more than 8 bits.
pub(crate) fn header(bytes: &[u8]) -> Result<Header, ImagingError> {
    let mut position = 2;
    loop {
        let (marker, body) = next_segment(bytes, &mut position)?;
        let kind = match marker {
            0xC0..=0xC2 => {
                let &[bits, h1, h0, w1, w0, ..] = body else { return Err(corrupt("frame header too short")) };
                let (width, height) = (u32::from(u16::from_be_bytes([w1, w0])), u32::from(u16::from_be_bytes([h1, h0])));
                if width == 0 || height == 0 {
                    return Err(corrupt(format!("frame of {width} x {height} pixels")));
                }
                if bits != 8 {
                    return Err(ImagingError::Unsupported { format: ImageFormat::Jpeg, detail: format!("{bits} bits a sample") });
                }
                return Ok(Header { width, height, bits });
            }
            0xC3 | 0xC7 | 0xCB | 0xCF => "lossless",
            0xC5 | 0xC6 | 0xCD | 0xCE => "hierarchical",
            0xC9 | 0xCA => "arithmetic coding",
            EOI | SOS => return Err(corrupt("no frame header before the picture")),
            _ => continue,
        };
        return Err(ImagingError::Unsupported { format: ImageFormat::Jpeg, detail: kind.to_owned() });
    }
}

/// Checks that the file reaches the end marker of its picture.
///
/// # Errors
/// [`ImagingError::Truncated`] where it does not, [`ImagingError::Corrupt`] where there is no picture before it.
pub(crate) fn check_complete(bytes: &[u8]) -> Result<(), ImagingError> {
    let mut position = 2;
    let mut scans = 0;
    loop {
        match next_segment(bytes, &mut position)?.0 {
            EOI if scans == 0 => return Err(corrupt("no picture before the end marker")),
            EOI => return Ok(()),
            SOS => {
                scans += 1;
                skip_entropy_coded(bytes, &mut position)?;
            }
            _ => {}
        }
    }
}

/// The next marker and its segment; `position` moves behind it. Bytes between segments are skipped, as libjpeg does.
fn next_segment<'a>(bytes: &'a [u8], position: &mut usize) -> Result<(u8, &'a [u8]), ImagingError> {
    loop {
        let start = *position + find_ff(bytes.get(*position..).unwrap_or_default()).ok_or(TRUNCATED)?;
        *position = start + 1;
        match *bytes.get(*position).ok_or(TRUNCATED)? {
            // 0xFF repeats as fill; 0xFF00, restarts and TEM carry no segment.
            0xFF => {}
            0x00 | 0x01 | 0xD0..=0xD7 | SOI => *position += 1,
            EOI => {
                *position += 1;
                return Ok((EOI, &[]));
            }
            marker => {
                let &[high, low] = bytes.get(*position + 1..*position + 3).ok_or(TRUNCATED)? else { return Err(TRUNCATED) };
                let length = usize::from(u16::from_be_bytes([high, low]));
                if length < 2 {
                    return Err(corrupt(format!("segment 0xFF{marker:02X} of length {length}")));
                }
                let body = bytes.get(*position + 3..*position + 1 + length).ok_or(TRUNCATED)?;
                *position += 1 + length;
                return Ok((marker, body));
            }
        }
    }
}

/// Moves `position` to the marker that ends a scan.
fn skip_entropy_coded(bytes: &[u8], position: &mut usize) -> Result<(), ImagingError> {
    loop {
        let start = *position + find_ff(bytes.get(*position..).unwrap_or_default()).ok_or(TRUNCATED)?;
        match *bytes.get(start + 1).ok_or(TRUNCATED)? {
            0x00 | 0xD0..=0xD7 => *position = start + 2,
            0xFF => *position = start + 1,
            _ => {
                *position = start;
                return Ok(());
            }
        }
    }
}

/// Position of the first 0xFF. Sixteen bytes at a time: the compiler makes one comparison of it, and this runs over every byte of a file.
fn find_ff(bytes: &[u8]) -> Option<usize> {
    let whole = bytes.chunks_exact(16).take_while(|chunk| chunk.iter().fold(0u8, |any, &b| any | u8::from(b == 0xFF)) == 0).count() * 16;
    bytes[whole..].iter().position(|&b| b == 0xFF).map(|i| whole + i)
}

/// Decoded samples, row after row.
pub(crate) enum Samples {
    /// One byte a pixel.
    Luma(Vec<u8>),
    /// Three bytes a pixel.
    Rgb(Vec<u8>),
}

/// Decodes as stored (the EXIF orientation is not applied). With `luma`, a colour file gives its Y channel alone, which
/// spares the transforms of the chroma channels; files that have no Y (RGB, CMYK) give RGB nevertheless.
pub(crate) fn decode(bytes: &[u8], luma: bool) -> Result<Samples, ImagingError> {
    check_complete(bytes)?;
    match decode_with(bytes, luma, true) {
        // Bytes between segments harm nothing and some cameras write them; everything else that strict mode finds does.
        Err(DecodeErrors::FormatStatic(detail)) if detail.starts_with("[strict-mode]") => decode_with(bytes, luma, false),
        other => other,
    }
    .map_err(error)
}

fn decode_with(bytes: &[u8], luma: bool, strict: bool) -> Result<Samples, DecodeErrors> {
    let side = usize::from(u16::MAX);
    let options = DecoderOptions::default().set_strict_mode(strict).set_max_width(side).set_max_height(side);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers()?;
    let one_channel = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => true,
        Some(ColorSpace::YCbCr) => luma,
        _ => false,
    };
    let wanted = if one_channel { ColorSpace::Luma } else { ColorSpace::RGB };
    decoder.set_options(options.jpeg_set_out_colorspace(wanted));
    let samples = decoder.decode()?;
    Ok(if one_channel { Samples::Luma(samples) } else { Samples::Rgb(samples) })
}

fn error(error: DecodeErrors) -> ImagingError {
    match error {
        DecodeErrors::ExhaustedData => TRUNCATED,
        DecodeErrors::IoErrors(_) => TRUNCATED,
        DecodeErrors::Unsupported(scheme) => ImagingError::Unsupported { format: ImageFormat::Jpeg, detail: format!("{scheme:?}") },
        other => corrupt(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode_jpeg_rgb;
    use scene::Raster;

    fn picture() -> Vec<u8> {
        let pixels = (0..64 * 48).map(|i| [(i % 64 * 4) as u8, (i * 7 % 256) as u8, (i / 64) as u8]).collect();
        encode_jpeg_rgb(&Raster::from_vec(64, 48, pixels).expect("one value a pixel"), 90).expect("valid")
    }

    #[test]
    fn finds_the_first_ff() {
        for length in 0..70 {
            for at in 0..length {
                let mut bytes = vec![0xFEu8; length];
                bytes[at] = 0xFF;
                assert_eq!(find_ff(&bytes), Some(at));
            }
            assert_eq!(find_ff(&vec![0u8; length]), None);
        }
    }

    #[test]
    fn header_and_end_of_a_whole_file() {
        let bytes = picture();
        assert_eq!(header(&bytes), Ok(Header { width: 64, height: 48, bits: 8 }));
        assert_eq!(check_complete(&bytes), Ok(()));
        // What follows the end marker (a second picture, a maker's trailer) is not ours.
        assert_eq!(check_complete(&[&bytes[..], b"trailer"].concat()), Ok(()));
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = picture();
        for end in 3..bytes.len() {
            assert!(check_complete(&bytes[..end]).is_err(), "cut at {end} of {}", bytes.len());
        }
    }

    #[test]
    fn bytes_between_segments_are_tolerated() {
        let bytes = picture();
        // After SOI comes APP0: insert padding behind it.
        let end = 4 + usize::from(u16::from_be_bytes([bytes[4], bytes[5]]));
        let padded = [&bytes[..end], &[0u8; 9], &bytes[end..]].concat();
        let (Ok(Samples::Rgb(found)), Ok(Samples::Rgb(expected))) = (decode(&padded, false), decode(&bytes, false)) else {
            panic!("both decode to colour")
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn arithmetic_coding_and_12_bits_are_named() {
        let mut bytes = picture();
        let sof = bytes.windows(2).position(|w| w == [0xFF, 0xC0]).expect("baseline");
        bytes[sof + 1] = 0xC9;
        assert!(matches!(header(&bytes), Err(ImagingError::Unsupported { detail, .. }) if detail == "arithmetic coding"));
        bytes[sof + 1] = 0xC1;
        bytes[sof + 4] = 12;
        assert!(matches!(header(&bytes), Err(ImagingError::Unsupported { detail, .. }) if detail.starts_with("12 bits")));
    }
}
