//! Photographs of real cameras; the folder is named by SFM_DATA.

use imaging::{decode_grey, decode_rgb, grey_from_rgb, probe};
use std::path::{Path, PathBuf};

fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("SFM_DATA").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: SFM_DATA does not name the folder of test data");
    }
    folder
}

fn first_image(folder: &Path) -> Vec<u8> {
    let mut files: Vec<_> = std::fs::read_dir(folder).expect("part of the data").map(|e| e.expect("readable").path()).collect();
    files.sort();
    let is_image = |p: &&PathBuf| p.extension().is_some_and(|e| ["jpg", "JPG", "png", "tif"].iter().any(|k| e == *k));
    std::fs::read(files.iter().find(is_image).expect("holds images")).expect("readable")
}

#[test]
fn photographs_decode() {
    let Some(data) = data() else { return };
    for (folder, size) in [
        ("sceaux", (2832, 2128)),
        ("fountain-p11/images", (3072, 2048)),
        ("haltbrekken/left", (1360, 1024)),
        ("aurlab-tower/left", (1360, 1024)),
        ("kitti-1/image_l", (1226, 370)),
        ("skerki", (576, 384)),
        ("temple", (640, 480)),
    ] {
        let bytes = first_image(&data.join(folder));
        let info = probe(&bytes).unwrap_or_else(|e| panic!("{folder}: {e}"));
        assert_eq!((info.width, info.height), size, "{folder}");
        let grey = decode_grey(&bytes).unwrap_or_else(|e| panic!("{folder}: {e}"));
        let rgb = decode_rgb(&bytes).unwrap_or_else(|e| panic!("{folder}: {e}"));
        assert_eq!((grey.width(), grey.height()), (rgb.width(), rgb.height()));
        // The Y channel of a JPEG is the luma of its colours, but for their rounding and clipping.
        let again = grey_from_rgb(&rgb);
        let difference =
            grey.data().iter().zip(again.data()).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / grey.data().len() as f64;
        assert!(difference < 1.0 / 255.0, "{folder}: {difference}");
        let cut = decode_grey(&bytes[..bytes.len() * 2 / 3]);
        assert!(cut.is_err(), "{folder}: two thirds of a file passed");
    }
}

#[test]
fn the_camera_of_sceaux() {
    let Some(data) = data() else { return };
    let info = probe(&first_image(&data.join("sceaux"))).expect("valid");
    assert!(info.exif.make.as_deref().is_some_and(|m| m.contains("KODAK")));
    // COLMAP's bundle adjustment finds 2973.4 px; EXIF is a start value.
    let focal = info.exif.focal_px(info.width, info.height).expect("given");
    assert!((focal / 2973.4 - 1.0).abs() < 0.1, "{focal} from {:?}", info.exif);
}
