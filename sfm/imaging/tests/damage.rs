//! Damaged files: an error that names the damage, never a panic, never part of a picture.

use imaging::{ImagingError, decode_grey, decode_grey_u8, decode_rgb, encode_png_rgb, probe};
use proptest::prelude::*;
use scene::Raster;
use std::io::Cursor;

fn file(name: &str) -> Vec<u8> {
    std::fs::read(format!("{}/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))).expect("part of the repository")
}

fn small_tiff(compressed: bool) -> Vec<u8> {
    if compressed {
        return file("exif.tif");
    }
    let image = image::RgbImage::from_fn(20, 15, |x, y| image::Rgb([x as u8, y as u8, 9]));
    let mut out = Cursor::new(Vec::new());
    image::DynamicImage::from(image).write_to(&mut out, image::ImageFormat::Tiff).expect("encodes");
    out.into_inner()
}

fn samples() -> Vec<Vec<u8>> {
    let names = [
        "rgb-420.jpg",
        "progressive-420.jpg",
        "restarts-420.jpg",
        "cmyk.jpg",
        "grey.jpg",
        "exif.jpg",
        "exif.png",
        "exif.webp",
        "lossy.webp",
    ];
    let mut all: Vec<_> = names.iter().map(|n| file(n)).collect();
    all.extend([small_tiff(true), small_tiff(false)]);
    all
}

#[test]
fn every_truncated_jpeg_is_refused() {
    for name in ["rgb-444.jpg", "rgb-420.jpg", "progressive-420.jpg", "restarts-420.jpg", "grey.jpg", "cmyk.jpg", "exif.jpg"] {
        let bytes = file(name);
        for end in 3..bytes.len() {
            let found = decode_grey(&bytes[..end]);
            assert!(
                matches!(found, Err(ImagingError::Truncated { .. })),
                "{name} cut at {end} of {}: {:?}",
                bytes.len(),
                found.map(|r| r.width())
            );
        }
    }
}

#[test]
fn truncated_files_of_other_formats_are_refused() {
    // Half of the pixels must never pass. The last bytes may be a trailer that decoders do without (PNG's IEND, EXIF behind WebP's pixels).
    for (name, bytes) in
        [("png", file("exif.png")), ("webp", file("lossless.webp")), ("lossy webp", file("lossy.webp")), ("tiff", small_tiff(false))]
    {
        for end in [bytes.len() / 2, bytes.len() * 3 / 4] {
            assert!(decode_rgb(&bytes[..end]).is_err(), "{name} cut at {end} of {}", bytes.len());
        }
    }
}

#[test]
fn huge_headers_are_refused_before_memory_is_taken() {
    let mut jpeg = file("rgb-444.jpg");
    let sof = jpeg.windows(2).position(|w| w == [0xFF, 0xC0]).expect("baseline");
    jpeg[sof + 5..sof + 9].copy_from_slice(&[0xFF, 0xF0, 0xFF, 0xF0]);
    // IHDR: width and height follow the 8 bytes of signature, 4 of length and 4 of type; its checksum follows its 13 bytes.
    let mut png = encode_png_rgb(&Raster::filled(3, 3, [1, 2, 3])).expect("valid");
    png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let crc = crc32(&png[12..29]).to_be_bytes();
    png[29..33].copy_from_slice(&crc);
    let mut tiff = small_tiff(false);
    patch_tiff_size(&mut tiff, 65_000);
    for bytes in [jpeg, png, tiff] {
        for found in
            [decode_grey(&bytes).map(|r| r.width()), decode_rgb(&bytes).map(|r| r.width()), probe(&bytes).map(|i| i.width as usize)]
        {
            assert!(matches!(found, Err(ImagingError::TooLarge { width, height }) if width >= 65_000 && height >= 65_000), "{found:?}");
        }
    }
}

/// The checksum of PNG chunks, bit by bit (PNG specification, annex D).
fn crc32(bytes: &[u8]) -> u32 {
    !bytes
        .iter()
        .fold(!0u32, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 }))
}

/// Sets width, height and rows per strip (tags 256, 257, 278) of a little-endian file with one directory.
fn patch_tiff_size(tiff: &mut [u8], side: u32) {
    assert_eq!(&tiff[..2], b"II");
    let directory = u32::from_le_bytes(tiff[4..8].try_into().expect("four bytes")) as usize;
    let count = usize::from(u16::from_le_bytes([tiff[directory], tiff[directory + 1]]));
    for entry in (0..count).map(|i| directory + 2 + 12 * i) {
        let tag = u16::from_le_bytes([tiff[entry], tiff[entry + 1]]);
        if matches!(tag, 256 | 257 | 278) {
            tiff[entry + 2..entry + 4].copy_from_slice(&4u16.to_le_bytes());
            tiff[entry + 8..entry + 12].copy_from_slice(&side.to_le_bytes());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// Whatever happens to the bytes, every entry point returns.
    #[test]
    fn mutated_files_never_panic(
        which in 0usize..11,
        cut in prop::option::weighted(0.3, 0.0..1.0f64),
        changes in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..6),
        inserted in prop::option::weighted(0.2, (0.0..1.0f64, prop::collection::vec(any::<u8>(), 1..20))),
    ) {
        let mut bytes = samples().swap_remove(which);
        if let Some(cut) = cut {
            bytes.truncate((bytes.len() as f64 * cut) as usize);
        }
        for (at, value) in changes {
            let at = (bytes.len() as f64 * at) as usize;
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
        }
        if let Some((at, extra)) = inserted {
            let at = (bytes.len() as f64 * at) as usize;
            bytes.splice(at..at, extra);
        }
        let _ = probe(&bytes);
        let _ = decode_grey(&bytes);
        let _ = decode_grey_u8(&bytes);
        let _ = decode_rgb(&bytes);
    }
}
