//! Input that is wrong: a clear error, or a warning and a result; never a panic, and nothing that was there is lost.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use serde_json::Value;
use std::process::Command;
use support::Dive;
use synthetic::dive::DiveOptions;

/// Exit code when the images give no result.
const NO_RESULT: i32 = 3;

/// A rendered dive of two cameras, with a dive.toml that orients it.
fn good_dive() -> Dive {
    let (dive, _) = Dive::rendered(&DiveOptions::small(6, 400, 250));
    dive.write("dive.toml", "[[camera]]\nimages = \"frames/C1\"\n[[camera]]\nimages = \"frames/C2\"\n");
    dive
}

/// A dive of one camera, from files.
fn of_files(files: &[(&str, Vec<u8>)]) -> Dive {
    let dive = Dive::empty();
    std::fs::create_dir(dive.path("frames")).unwrap();
    for (name, bytes) in files {
        std::fs::write(dive.path("frames").join(name), bytes).unwrap();
    }
    dive.write("dive.toml", "[[camera]]\nimages = \"frames\"\n");
    dive
}

fn uniform(value: u8) -> Vec<u8> {
    imaging::encode_png_grey(&scene::Raster::filled(320, 200, value)).unwrap()
}

/// The warnings of a run that gives a result, one a line.
fn warnings(dive: &Dive) -> String {
    let report: Value = serde_json::from_str(&dive.ok(&["run", "--until", "orient", "--json"])).unwrap();
    assert!(report["images"]["oriented"].as_u64().unwrap() >= 6, "{report:#}");
    let warnings = report["warnings"].as_array().unwrap().iter();
    warnings.map(|w| format!("{}: {}\n", w["about"].as_str().unwrap(), w["message"].as_str().unwrap())).collect()
}

#[test]
fn an_empty_folder_is_an_error_of_the_file() {
    let dive = of_files(&[]);
    let (code, message) = dive.fails(&["run"]);
    assert_eq!(code, 2);
    assert!(message.contains("dive.toml:2:10: camera.images: no image at"), "{message}");
}

#[test]
fn one_image_gives_no_result() {
    let (code, message) = of_files(&[("a.png", support::png(320, 200, 1))]).fails(&["run"]);
    assert_eq!(code, NO_RESULT);
    assert!(message.contains("one image only"), "{message}");
}

#[test]
fn two_identical_images_give_no_result() {
    let (code, message) = of_files(&[("a.png", support::png(320, 200, 1)), ("b.png", support::png(320, 200, 1))]).fails(&["run"]);
    assert_eq!(code, NO_RESULT);
    assert!(message.contains("one image only"), "{message}");
}

/// The same pixels in files that differ: the position is not known, and is not made up.
#[test]
fn two_images_from_one_place_give_no_result() {
    let (dive, rendered) = Dive::rendered(&DiveOptions::small(1, 320, 200));
    let rgb = &rendered.images[0].rgb;
    std::fs::remove_dir_all(dive.path("frames")).unwrap();
    std::fs::create_dir(dive.path("frames")).unwrap();
    std::fs::write(dive.path("frames/a.png"), imaging::encode_png_rgb(rgb).unwrap()).unwrap();
    std::fs::write(dive.path("frames/b.jpg"), imaging::encode_jpeg_rgb(rgb, 98).unwrap()).unwrap();
    dive.write("dive.toml", "[[camera]]\nimages = \"frames\"\n");
    assert_eq!(dive.fails(&["run"]).0, NO_RESULT);
}

#[test]
fn images_of_nothing_give_no_result() {
    let (code, message) = of_files(&[("a.png", uniform(90)), ("b.png", uniform(91)), ("c.png", uniform(92))]).fails(&["run"]);
    assert_eq!(code, NO_RESULT);
    assert!(message.contains("uniform"), "{message}");
}

/// Images without overlap.
#[test]
fn images_of_different_places_give_no_result() {
    let (code, message) = of_files(&[("a.png", support::png(320, 200, 1)), ("b.png", support::png(320, 200, 2))]).fails(&["run"]);
    assert_eq!(code, NO_RESULT);
    assert!(message.contains("overlap"), "{message}");
}

/// All kinds of bad files among good ones: each is told, and the good ones are used.
#[test]
fn bad_files_among_good_ones_are_warnings() {
    let dive = good_dive();
    let (_, rendered) = Dive::rendered(&DiveOptions::small(1, 400, 250));
    let jpeg = imaging::encode_jpeg_rgb(&rendered.images[1].rgb, 90).unwrap();
    let files: [(&str, Vec<u8>); 5] = [
        ("x1-truncated.jpg", jpeg[..jpeg.len() / 2].to_vec()),
        ("x2-text.jpg", b"dear diary".to_vec()),
        ("x3-empty.png", Vec::new()),
        ("x4-huge.png", huge_png()),
        ("x5-uniform.png", imaging::encode_png_grey(&scene::Raster::filled(400, 250, 128)).unwrap()),
    ];
    for (name, bytes) in &files {
        std::fs::write(dive.path("frames/C1").join(name), bytes).unwrap();
    }
    let told = warnings(&dive);
    for (name, word) in ["truncated", "not an image", "empty file", "larger than the limit", "keypoints"].iter().enumerate() {
        let name = files[name].0;
        assert!(told.lines().any(|line| line.contains(name) && line.contains(word)), "{name}: no {word} in\n{told}");
    }
    assert!(told.contains("C1: 3 images pair with none") || told.contains("C1: 2 images pair with none"), "{told}");
}

/// A PNG that announces 900 megapixels and holds none.
fn huge_png() -> Vec<u8> {
    let size = 30_000u32.to_be_bytes();
    let header = [size.as_slice(), &size, &[8, 2, 0, 0, 0]].concat();
    [b"\x89PNG\r\n\x1a\n".to_vec(), png_chunk(b"IHDR", &header), png_chunk(b"IDAT", &[]), png_chunk(b"IEND", &[])].concat()
}

fn png_chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let body = [kind.as_slice(), data].concat();
    let crc = body.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 })
    });
    [&(data.len() as u32).to_be_bytes(), body.as_slice(), &(!crc).to_be_bytes()].concat()
}

#[test]
fn cameras_with_different_counts_are_a_warning() {
    let dive = good_dive();
    std::fs::remove_file(dive.path("frames/C2/0005.png")).unwrap();
    assert!(warnings(&dive).contains("C1: 0005 pairs with no image of another camera"));
}

#[test]
fn impossible_values_are_errors_of_the_file() {
    let dive = good_dive();
    let good = std::fs::read_to_string(dive.path("dive.toml")).unwrap();
    for (text, expected) in [
        ("[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = -0.4\n", "dive.toml:7:12: rig.baseline.length_m: must be above 0"),
        ("[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = nan\n", "dive.toml:7:12: rig.baseline.length_m: must be a finite"),
        ("[matching]\nratio = nan\n", "dive.toml:6:9: matching.ratio: must be a finite"),
        ("[orient]\nmax_eror_px = 1.0\n", "hint: did you mean `max_error_px`?"),
    ] {
        dive.write("dive.toml", &format!("{good}{text}"));
        let (code, message) = dive.fails(&["run"]);
        assert_eq!(code, 2);
        assert!(message.contains(expected), "{message}");
    }
    assert!(!dive.path("out").exists());
}

/// A folder that may not be written, and a path on which no folder can be.
#[test]
#[cfg(unix)]
fn an_output_that_cannot_be_written_is_an_error() {
    use std::os::unix::fs::PermissionsExt;
    let dive = good_dive();
    let good = std::fs::read_to_string(dive.path("dive.toml")).unwrap();
    dive.write("dive.toml", &format!("[dive]\noutput = \"dive.toml/out\"\n{good}"));
    let (code, message) = dive.fails(&["run"]);
    assert_eq!(code, 1);
    assert!(message.contains("cannot write to the output folder"), "{message}");
    std::fs::create_dir(dive.path("locked")).unwrap();
    std::fs::set_permissions(dive.path("locked"), std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(dive.path("locked/probe"), "").is_ok() {
        eprintln!("skipped the read-only folder: this user may write everywhere");
        return;
    }
    dive.write("dive.toml", &format!("[dive]\noutput = \"locked/out\"\n{good}"));
    let (code, message) = dive.fails(&["run"]);
    assert_eq!(code, 1);
    assert!(message.contains("locked"), "{message}");
}

/// A disk that is full, as far as this process can tell: files may not grow beyond 2 KiB. What an earlier run made stays,
/// and the next run goes on.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_and_loses_nothing() {
    let dive = good_dive();
    dive.ok(&["run", "--until", "mask"]);
    let before = support::tree(&dive.path("out"));
    let script = format!("trap '' XFSZ; ulimit -f 4; exec {} run", env!("CARGO_BIN_EXE_sfm"));
    let output = Command::new("sh").args(["-c", &script]).current_dir(dive.path(".")).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("cannot write") && !message.contains("panicked"), "{message}");
    let after = support::tree(&dive.path("out"));
    for (name, bytes) in &before {
        assert!(after.get(name) == Some(bytes), "{name} is not what it was");
    }
    dive.ok(&["run", "--until", "features"]);
}
