//! Every kind of file that is read, against the formula that made its pixels.

use imaging::{ImageFormat, ImagingError, apply_orientation, decode_grey, decode_grey_u8, decode_rgb, grey_from_rgb, probe};
use scene::Raster;
use std::io::Cursor;

const SIZE: (usize, usize) = (37, 29);

fn file(name: &str) -> Vec<u8> {
    std::fs::read(format!("{}/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))).expect("part of the repository")
}

/// The picture that tests/data/make.py draws.
fn truth() -> Raster<[u8; 3]> {
    let (w, h) = SIZE;
    let pixels = (0..w * h).map(|i| [(6 * (i % w)) as u8, (8 * (i / w)) as u8, 128]).collect();
    Raster::from_vec(w, h, pixels).expect("one value a pixel")
}

fn grey_truth() -> Raster<u8> {
    let (w, h) = SIZE;
    Raster::from_vec(w, h, (0..w * h).map(|i| (3 * (i % w) + 4 * (i / w)) as u8).collect()).expect("one value a pixel")
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn assert_near(name: &str, tolerance_rgb: f32, tolerance_grey: f32) {
    let bytes = file(name);
    let rgb = decode_rgb(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    let grey = decode_grey(&bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    let floats = |r: &Raster<[u8; 3]>| r.data().as_flattened().iter().map(|&v| f32::from(v)).collect::<Vec<_>>();
    let d_rgb = largest_difference(&floats(&rgb), &floats(&truth()));
    let d_grey = 255.0 * largest_difference(grey.data(), grey_from_rgb(&truth()).data());
    assert!(d_rgb <= tolerance_rgb && d_grey <= tolerance_grey, "{name}: colour off by {d_rgb}, grey by {d_grey}");
}

#[test]
fn jpeg_variants() {
    // Grey values of 255. Quality 95 quantises luma by up to a few values; halved chroma blurs this gradient's last, padded columns more.
    assert_near("rgb-444.jpg", 6.0, 3.0);
    assert_near("rgb-422.jpg", 10.0, 3.0);
    assert_near("rgb-420.jpg", 12.0, 3.0);
    assert_near("progressive-420.jpg", 12.0, 3.0);
    assert_near("restarts-420.jpg", 12.0, 3.0);
    assert_near("no-transform.jpg", 6.0, 3.0);
    assert_near("cmyk.jpg", 10.0, 10.0);
}

#[test]
fn webp_variants() {
    assert_near("lossy.webp", 16.0, 8.0);
    // One rounding from bytes to luma in f32.
    assert_near("lossless.webp", 0.0, 1e-4);
}

#[test]
fn grey_jpeg() {
    let found = decode_grey_u8(&file("grey.jpg")).expect("valid");
    let worst = found.data().iter().zip(grey_truth().data()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(worst <= Some(3), "{worst:?}");
    let rgb = decode_rgb(&file("grey.jpg")).expect("valid");
    assert!(rgb.data().iter().zip(found.data()).all(|(p, &v)| *p == [v; 3]));
}

#[test]
fn exif_in_every_format() {
    for (name, format) in
        [("exif.jpg", ImageFormat::Jpeg), ("exif.png", ImageFormat::Png), ("exif.webp", ImageFormat::WebP), ("exif.tif", ImageFormat::Tiff)]
    {
        let bytes = file(name);
        let info = probe(&bytes).expect("valid");
        assert_eq!((info.width, info.height, info.format, info.bits_per_channel, info.exif.orientation), (29, 37, format, 8, 6), "{name}");
        let rgb = decode_rgb(&bytes).expect("valid");
        assert_eq!((rgb.width(), rgb.height()), (29, 37), "{name}");
        // Pillow's own turn of the same file: top left is the stored bottom left.
        let [[r, g, _], [r1, g1, _]] = [rgb[(0, 0)], rgb[(28, 36)]];
        assert!(r <= 6 && g.abs_diff(224) <= 6 && r1.abs_diff(216) <= 6 && g1 <= 6, "{name}: {r} {g} {r1} {g1}");
        let grey = decode_grey(&bytes).expect("valid");
        assert_eq!((grey.width(), grey.height()), (29, 37));
        if format != ImageFormat::Jpeg {
            assert_eq!(rgb, apply_orientation(truth(), 6));
        }
    }
}

#[test]
fn exif_fields() {
    for name in ["exif.jpg", "exif.png", "exif.webp"] {
        let exif = probe(&file(name)).expect("valid").exif;
        assert_eq!(exif.focal_mm, Some(2.4), "{name}");
        assert_eq!(exif.focal_35mm, Some(15.0));
        assert_eq!(exif.make.as_deref(), Some("Maker"));
        assert_eq!(exif.model.as_deref(), Some("Model X"));
        assert_eq!(exif.serial.as_deref(), Some("SN-0042"));
        // date -u -d '2026-11-05 12:34:56' +%s
        assert_eq!(exif.time_secs, Some(1_793_882_096.25));
        let focal = exif.focal_px(29, 37).expect("given");
        assert!((focal - 2.4 * 37.0 / 5.76).abs() < 1e-9, "{focal}");
    }
    assert_eq!(probe(&file("rgb-420.jpg")).expect("valid").exif, imaging::ExifInfo::default());
}

/// Encodes with the `image` crate: the formats that store values exactly.
fn encoded(image: &image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    image.write_to(&mut out, format).expect("encodes");
    out.into_inner()
}

#[test]
fn sixteen_bits_keep_their_precision() {
    let (w, h) = (13u32, 7u32);
    let value = |i: u32| (i * 719 + 3) as u16;
    let grey = image::ImageBuffer::from_fn(w, h, |x, y| image::Luma([value(y * w + x)]));
    let grey_alpha = image::ImageBuffer::from_fn(w, h, |x, y| image::LumaA([value(y * w + x), 7]));
    let rgb = image::ImageBuffer::from_fn(w, h, |x, y| image::Rgb([value(y * w + x); 3]));
    let rgba = image::ImageBuffer::from_fn(w, h, |x, y| image::Rgba([value(y * w + x), value(y * w + x), value(y * w + x), 9]));
    let png = image::ImageFormat::Png;
    let tiff = image::ImageFormat::Tiff;
    for bytes in [
        encoded(&grey.clone().into(), png),
        encoded(&grey.into(), tiff),
        encoded(&grey_alpha.into(), png),
        encoded(&rgb.clone().into(), png),
        encoded(&rgb.into(), tiff),
        encoded(&rgba.into(), png),
    ] {
        assert_eq!(probe(&bytes).expect("valid").bits_per_channel, 16);
        let found = decode_grey(&bytes).expect("valid");
        let bytes_grey = decode_grey_u8(&bytes).expect("valid");
        let colour = decode_rgb(&bytes).expect("valid");
        for i in 0..w * h {
            let expected = f32::from(value(i)) / 65535.0;
            // Weights of luma sum to one but for f32 rounding: far below one step of 16 bits, 1.5e-5.
            assert!((found.data()[i as usize] - expected).abs() < 3e-7);
            let eight = (expected * 255.0).round() as u8;
            assert!(bytes_grey.data()[i as usize].abs_diff(eight) <= 1);
            assert_eq!(colour.data()[i as usize], [eight; 3]);
        }
    }
}

#[test]
fn alpha_is_ignored() {
    let rgba = image::ImageBuffer::from_fn(5, 4, |x, y| image::Rgba([x as u8, y as u8, 3, 0]));
    let la = image::ImageBuffer::from_fn(5, 4, |x, y| image::LumaA([(5 * y + x) as u8, 0]));
    for format in [image::ImageFormat::Png, image::ImageFormat::WebP, image::ImageFormat::Tiff] {
        let found = decode_rgb(&encoded(&rgba.clone().into(), format)).expect("valid");
        assert_eq!(found[(4, 3)], [4, 3, 3]);
    }
    assert_eq!(decode_grey_u8(&encoded(&la.into(), image::ImageFormat::Png)).expect("valid").data(), (0..20).collect::<Vec<u8>>());
}

#[test]
fn what_is_no_image_is_named() {
    assert_eq!(decode_rgb(b""), Err(ImagingError::Empty));
    assert_eq!(decode_grey(b"dear diary, today we dived"), Err(ImagingError::NotAnImage));
    assert_eq!(probe(b"").map(|i| i.width), Err(ImagingError::Empty));
    assert_eq!(probe(&[0xFF, 0xD8]).map(|i| i.width), Err(ImagingError::NotAnImage));
    assert_eq!(ImagingError::Empty.to_string(), "empty file");
    assert!(ImagingError::NotAnImage.to_string().starts_with("not an image"));
}
