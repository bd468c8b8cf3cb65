//! `sfm calibrate` and `sfm water` as a user meets them, on rendered boards and on OpenCV's photographs.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rayon::prelude::*;
use scene::{Camera, CameraModel, Raster, Rigid3};
use serde_json::Value;
use std::collections::BTreeSet;
use support::{Dive, keys};

const SIZE: (usize, usize) = (480, 360);
/// Inner corners.
const COLUMNS: usize = 9;
const ROWS: usize = 6;
const SQUARE_M: f64 = 0.03;
/// Samples along each side of a pixel.
const SAMPLES: usize = 4;

fn camera(c: usize) -> Camera {
    let d = c as f64;
    let params = [430.0 + 6.0 * d, 236.0 + 5.0 * d, 183.0 - 4.0 * d, -0.12, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0];
    Camera::new(CameraModel::Brown, SIZE.0 as u32, SIZE.1 as u32, &params).unwrap()
}

fn cam_from_rig(c: usize) -> Rigid3 {
    let d = c as f64;
    Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::new(0.01, 0.1, -0.02) * d), Vector3::new(-0.1, 0.01, 0.005) * d)
}

/// Direction of each sample of the image of a camera, row by row of pixels.
fn directions(camera: &Camera) -> Vec<Vector2<f64>> {
    let samples = (0..SIZE.0 * SIZE.1 * SAMPLES * SAMPLES).into_par_iter().map(|k| {
        let (pixel, sample) = (k / (SAMPLES * SAMPLES), k % (SAMPLES * SAMPLES));
        let at = |p: usize, s: usize| p as f64 + (s as f64 + 0.5) / SAMPLES as f64;
        camera.unproject(&Vector2::new(at(pixel % SIZE.0, sample % SAMPLES), at(pixel / SIZE.0, sample / SAMPLES))).unwrap()
    });
    samples.collect()
}

/// A board with its white margin on grey ground, by following rays.
fn image(directions: &[Vector2<f64>], cam_from_board: &Rigid3, seed: u64) -> Raster<u8> {
    let board_from_cam = cam_from_board.inverse();
    let r = board_from_cam.rotation_matrix();
    let centre = board_from_cam.translation;
    let mut random = synthetic::Random::new(seed);
    let noise: Vec<f64> = (0..SIZE.0 * SIZE.1).map(|_| 1.5 * random.normal()).collect();
    let value = |d: &Vector2<f64>| {
        let ray = r * d.push(1.0);
        let at = (centre - ray * (centre.z / ray.z)) / SQUARE_M;
        let (x, y) = (at.x + 1.0, at.y + 1.0);
        let beyond = |v: f64, n: usize, margin: f64| v < -margin || v >= n as f64 + 1.0 + margin;
        if beyond(x, COLUMNS, 0.7) || beyond(y, ROWS, 0.7) {
            return 90.0;
        }
        let dark = !beyond(x, COLUMNS, 0.0) && !beyond(y, ROWS, 0.0) && (x.floor() + y.floor()) as i64 % 2 == 0;
        if dark { 30.0 } else { 210.0 }
    };
    let pixels = directions.chunks(SAMPLES * SAMPLES).zip(&noise).map(|(samples, noise)| {
        let mean = samples.iter().map(value).sum::<f64>() / samples.len() as f64;
        (mean + noise).round().clamp(0.0, 255.0) as u8
    });
    Raster::from_vec(SIZE.0, SIZE.1, pixels.collect()).unwrap()
}

/// Poses of the board in the rig, to all sides.
fn poses(count: usize, seed: u64) -> Vec<Rigid3> {
    let mut place = synthetic::Random::new(seed);
    let middle = Vector3::new((COLUMNS - 1) as f64, (ROWS - 1) as f64, 0.0) * (SQUARE_M / 2.0);
    let pose = |_| {
        let turn = Vector3::new(place.range(-0.5, 0.5), place.range(-0.5, 0.5), place.range(-0.4, 0.4));
        let at = Vector3::new(place.range(-0.01, 0.09), place.range(-0.04, 0.04), place.range(0.42, 0.58));
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        Rigid3::new(rotation, at - rotation * middle)
    };
    (0..count).map(pose).collect()
}

/// Writes images of two cameras, `FOLDER/C1/0000.png` and so on.
fn render(dive: &Dive, folder: &str, poses: &[Rigid3], rig: &[Rigid3], seed: u64) {
    for (c, pose) in rig.iter().enumerate() {
        let directions = directions(&camera(c));
        let path = dive.path(&format!("{folder}/C{}", c + 1));
        std::fs::create_dir_all(&path).unwrap();
        poses.par_iter().enumerate().for_each(|(e, rig_from_board)| {
            let image = image(&directions, &(*pose * *rig_from_board), seed + (1000 * c + e) as u64);
            std::fs::write(path.join(format!("{e:04}.png")), imaging::encode_png_grey(&image).unwrap()).unwrap();
        });
    }
}

fn calib(cameras: &[&str], columns: usize) -> String {
    let mut text = format!("[target]\nkind = \"chequerboard\"\ncolumns = {columns}\nrows = {ROWS}\nsquare_m = {SQUARE_M}\n");
    for (c, images) in cameras.iter().enumerate() {
        let fixed = "interior = { model = \"brown\", fixed = [\"a3\", \"b1\", \"b2\", \"c1\", \"c2\"] }";
        text += &format!("[[camera]]\nname = \"C{}\"\nimages = \"{images}\"\n{fixed}\n", c + 1);
    }
    text
}

fn rig() -> [Rigid3; 2] {
    [cam_from_rig(0), cam_from_rig(1)]
}

/// First cells of the tables of the page, below a heading and above the next.
fn documented(heading: &str) -> BTreeSet<String> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/calibrate.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (_, part) = page.split_once(&format!("\n## {heading}\n")).unwrap();
    let part = part.split("\n## ").next().unwrap();
    part.lines().filter_map(|line| Some(line.strip_prefix("| `")?.split_once("` |")?.0.to_owned())).collect()
}

fn require_documented(heading: &str, figures: &Value) {
    let documented = documented(heading);
    let missing: Vec<String> = keys(figures).into_iter().filter(|key| !documented.contains(key)).collect();
    assert!(missing.is_empty(), "not in docs/calibrate.md: {missing:?}");
}

fn parameter<'a>(record: &'a Value, camera: usize, name: &str) -> &'a Value {
    record["cameras"][camera]["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap()
}

#[test]
fn a_rig_is_calibrated_used_and_checked() {
    let dive = Dive::empty();
    render(&dive, "calib-images", &poses(12, 1), &rig(), 100);
    dive.write("calib.toml", &calib(&["calib-images/C1", "calib-images/C2"], COLUMNS));
    let record: Value = serde_json::from_str(&dive.ok(&["calibrate", "--json"])).unwrap();
    require_documented("calibration.json", &record);
    assert_eq!((&record["images"]["with_target"], &record["exposures"]), (&24.into(), &12.into()));
    // Corners of rendered boards are known to some hundredths of a pixel; the limits are those of the precision that is stated and of the
    // little by which detection is off in one direction.
    let sigma0 = record["sigma0_px"].as_f64().unwrap();
    assert!((0.005..0.08).contains(&sigma0), "{sigma0}");
    for c in 0..2 {
        for (name, truth) in camera(c).model().param_names().iter().zip(camera(c).params()) {
            let p = parameter(&record, c, name);
            let (value, sigma) = (p["value"].as_f64().unwrap(), p["sigma"].as_f64().unwrap());
            let error = (value - truth).abs();
            assert!(error <= 4.0 * sigma, "C{}: {name} {value} +- {sigma}, {truth} is true", c + 1);
            assert_eq!(p["held"], ["a3", "b1", "b2", "c1", "c2"].contains(name), "{name}");
        }
    }
    let (length, sigma) = (record["baselines"][0]["length_m"].as_f64().unwrap(), record["baselines"][0]["sigma_m"].as_f64().unwrap());
    let truth = (cam_from_rig(1).centre() - cam_from_rig(0).centre()).norm();
    assert!((length - truth).abs() < 4.0 * sigma && sigma < 1e-3, "{length} +- {sigma}, {truth} is true");
    assert!(record["rectifications"][0]["rms_px"].as_f64().unwrap() < 4.0 * sigma0, "{}", record["rectifications"][0]);

    // The same bytes with one thread, and over an earlier calibration.
    let written = |name: &str| std::fs::read(dive.path(name)).unwrap();
    let files = ["report.html", "calibration.json", "rig.toml", "calib/C1.toml", "calib/C2.toml"].map(|f| format!("calibration/{f}"));
    let before: Vec<_> = files.iter().map(|f| written(f)).collect();
    dive.ok(&["calibrate", "--threads", "1"]);
    assert_eq!(before, files.iter().map(|f| written(f)).collect::<Vec<_>>());
    let page = String::from_utf8(before[0].clone()).unwrap();
    assert!(page.contains("<svg viewBox=\"0 0 480 360\"") && page.contains("Interior orientation of C2") && !page.contains("http"));

    // A dive.toml takes the files as they are.
    let of = |c: usize| {
        format!("[[camera]]\nname = \"C{c}\"\nimages = \"calib-images/C{c}\"\ninterior.file = \"calibration/calib/C{c}.toml\"\n")
    };
    let text = format!("{}{}[rig]\nfile = \"calibration/rig.toml\"\n", of(1), of(2));
    let config = pipeline::config::parse(&dive.path("dive.toml"), &text).unwrap();
    assert_eq!(config.rig.mode, pipeline::config::RigMode::Rigid);
    assert_eq!((config.rig.baselines[0].length_m, config.rig.baselines[0].sigma_m), (length, sigma));
    let pose = config.rig.poses[1].unwrap();
    assert!((pose.cam_from_rig.centre().norm() - length).abs() < 1e-12 && pose.sigma.unwrap().1 > 0.0);
    assert_eq!(config.cameras[1].interior.params[0], parameter(&record, 1, "c")["value"].as_f64());
    assert_eq!(config.cameras[1].interior.sigmas[0], parameter(&record, 1, "c")["sigma"].as_f64());
    assert!(config.cameras[1].interior.held[5] && !config.cameras[1].interior.held[0]);

    // New images of the same rig, and of one whose second camera was turned by a degree.
    render(&dive, "later", &poses(10, 2), &rig(), 7000);
    let check = |folder: &str| -> Value {
        serde_json::from_str(&dive.ok(&["calibrate", "--check", "calibration/rig.toml", folder, "--json"])).unwrap()
    };
    let holds = check("later");
    require_documented("--check", &holds);
    assert_eq!(holds["verdict"], "holds", "{holds:#}");
    assert!((0.7..1.5).contains(&holds["held"]["ratio"].as_f64().unwrap()), "{holds:#}");
    let turned = Rigid3::new(
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 1f64.to_radians(), 0.0)) * cam_from_rig(1).rotation,
        cam_from_rig(1).translation,
    );
    render(&dive, "knocked", &poses(10, 3), &[cam_from_rig(0), turned], 8000);
    let drifted = check("knocked");
    assert_eq!(drifted["verdict"], "drifted", "{drifted:#}");
    assert!((drifted["cameras"][1]["turned_deg"].as_f64().unwrap() - 1.0).abs() < 0.1, "{drifted:#}");
    assert!(drifted["held"]["ratio"].as_f64().unwrap() > 5.0);
    // Two exposures tell how they fit, and no more.
    render(&dive, "few", &poses(2, 4), &rig(), 9000);
    assert_eq!(check("few")["verdict"], "unknown");
    assert!(dive.ok(&["calibrate", "--check", "calibration/rig.toml", "few"]).contains("too few to tell"));
    let mut rig = String::from_utf8(written("calibration/rig.toml")).unwrap();
    rig += "# edited\n";
    dive.write("calibration/rig.toml", &rig);
    let (code, message) = dive.fails(&["calibrate", "--check", "calibration/rig.toml", "few"]);
    assert!(code == 2 && message.contains("is not as calibration.json beside it has it"), "{message}");
    assert_eq!(dive.fails(&["calibrate", "--check", "calibration/calibration.json", "nowhere"]).0, 2);
}

#[test]
fn what_makes_no_calibration_is_refused_with_the_reason() {
    let dive = Dive::empty();
    render(&dive, "good", &poses(6, 1), &rig(), 100);
    let fails = |text: &str| {
        dive.write("calib.toml", text);
        dive.fails(&["calibrate"])
    };
    let (code, message) = fails(&calib(&["good/C1"], 8));
    assert!(
        code == 2 && message.contains("6 images show a board of 9 x 6 inner corners, C1/0000.png is one, and 0 one of 8 x 6"),
        "{message}"
    );
    let (code, message) = fails(&calib(&["good/C1"], 11));
    assert!(code == 3 && message.contains("a whole board of 11 x 6 inner corners is in none of 6 images"), "{message}");

    // All parallel: the board straight in front at several distances.
    let middle = Vector3::new((COLUMNS - 1) as f64, (ROWS - 1) as f64, 0.0) * (SQUARE_M / 2.0);
    let parallel: Vec<Rigid3> = (0..4)
        .map(|k| Rigid3::new(UnitQuaternion::identity(), Vector3::new(0.01 * f64::from(k), 0.0, 0.4 + 0.05 * f64::from(k)) - middle))
        .collect();
    render(&dive, "parallel", &parallel, &rig()[..1], 200);
    let (code, message) = fails(&calib(&["parallel/C1"], COLUMNS));
    assert!(code == 3 && message.contains("camera C1: the target is turned by") && message.contains("hint: tilt it"), "{message}");

    let (code, message) = fails(&calib(&["good/C1", "good/C2/000[01].png"], COLUMNS));
    assert!(code == 3 && message.contains("camera C2 sees the target in 2 images, 3 are needed"), "{message}");

    // The second camera's images are mirrored, then shuffled in time.
    std::fs::create_dir_all(dive.path("mirrored")).unwrap();
    std::fs::create_dir_all(dive.path("shuffled")).unwrap();
    for e in 0..6 {
        let bytes = std::fs::read(dive.path(&format!("good/C2/{e:04}.png"))).unwrap();
        let grey = imaging::decode_grey_u8(&bytes).unwrap();
        let flipped: Vec<u8> = (0..SIZE.1).flat_map(|y| grey.row(y).iter().rev().copied().collect::<Vec<_>>()).collect();
        let flipped = Raster::from_vec(SIZE.0, SIZE.1, flipped).unwrap();
        std::fs::write(dive.path(&format!("mirrored/{e:04}.png")), imaging::encode_png_grey(&flipped).unwrap()).unwrap();
        std::fs::write(dive.path(&format!("shuffled/{:04}.png", (e + 2) % 6)), bytes).unwrap();
    }
    for folder in ["mirrored", "shuffled"] {
        let (code, message) = fails(&calib(&["good/C1", folder], COLUMNS));
        assert!(code == 3 && message.contains("the cameras contradict each other"), "{folder}: {message}");
    }

    // An image of another size, and one that is none, are left out and told.
    std::fs::write(dive.path("good/C1/9000.png"), support::png(64, 48, 1)).unwrap();
    std::fs::write(dive.path("good/C1/9001.png"), "no image").unwrap();
    dive.write("calib.toml", &calib(&["good/C1"], COLUMNS));
    let record: Value = serde_json::from_str(&dive.ok(&["calibrate", "--json"])).unwrap();
    let told = record["warnings"].to_string();
    assert!(told.contains("it has 64 x 48 pixels, most images of C1 have 480 x 360") && told.contains("C1/9001.png"), "{told}");
    assert!(!dive.path("calibration/rig.toml").exists(), "one camera is no rig");
    // The folder of something else is left alone.
    std::fs::create_dir_all(dive.path("other")).unwrap();
    dive.write("other/thesis.txt", "x");
    let (code, message) = fails(&format!("[calibration]\noutput = \"other\"\n{}", calib(&["good/C1"], COLUMNS)));
    assert!(code == 1 && message.contains("holds no calibration"), "{message}");
}

/// Frames of the first camera as a video of 5 frames a second.
fn video(dive: &Dive, file: &str, poses: &[Rigid3]) {
    use opencv::core::{Mat, MatTraitManual, Size};
    use opencv::videoio::{VideoWriter, VideoWriterTrait};
    let code = VideoWriter::fourcc('M', 'J', 'P', 'G').unwrap();
    let mut writer = VideoWriter::new(dive.path(file), code, 5.0, Size::new(SIZE.0 as i32, SIZE.1 as i32), true).unwrap();
    let directions = directions(&camera(0));
    for (e, pose) in poses.iter().enumerate() {
        let grey = image(&directions, pose, e as u64);
        let mut frame = Mat::new_rows_cols_with_default(SIZE.1 as i32, SIZE.0 as i32, opencv::core::CV_8UC3, 0.0.into()).unwrap();
        frame.data_bytes_mut().unwrap().chunks_mut(3).zip(grey.data()).for_each(|(pixel, value)| pixel.fill(*value));
        writer.write(&frame).unwrap();
    }
    writer.release().unwrap();
}

#[test]
fn a_video_is_searched_frame_by_frame() {
    let dive = Dive::empty();
    video(&dive, "board.avi", &poses(9, 5));
    dive.write("calib.toml", &calib(&["x"], COLUMNS).replace("images = \"x\"", "video = \"board.avi\"\nrate_hz = 5.0"));
    let record: Value = serde_json::from_str(&dive.ok(&["calibrate", "--json"])).unwrap();
    assert_eq!((&record["images"]["found"], &record["images"]["with_target"]), (&9.into(), &9.into()));
    assert_eq!(record["photographs"][8]["name"], "C1/000008");
    assert_eq!((&record["cameras"][0]["sigma0_alone_px"], record["baselines"].as_array().unwrap().len()), (&Value::Null, 0));
    let c = parameter(&record, 0, "c");
    let (value, sigma) = (c["value"].as_f64().unwrap(), c["sigma"].as_f64().unwrap());
    // Compression moves corners a little, the same way in all frames.
    assert!((value - 430.0).abs() < (4.0 * sigma).max(0.5), "{value} +- {sigma}");
    // The one camera is checked by calibration.json, with images in the folder itself.
    render(&dive, "later", &poses(8, 6), &rig()[..1], 300);
    let check = dive.ok(&["calibrate", "--check", "calibration/calibration.json", "later/C1", "--json"]);
    let check: Value = serde_json::from_str(&check).unwrap();
    assert!(check["cameras"][0]["shift_rms_px"].as_f64().unwrap() < 0.3 && check["cameras"][0]["pose"].is_null(), "{check:#}");
}

#[test]
fn a_wrong_calib_toml_is_told_with_its_place() {
    let dive = Dive::of_noise();
    let camera = "[[camera]]\nimages = \"frames/left\"\n";
    let target = "[target]\ncolumns = 9\nrows = 6\nsquare_m = 0.03\n";
    for (text, expected) in [
        (camera.to_owned(), "target: is missing"),
        (format!("{camera}[target]\ncolumns = 9\nrows = 6\n"), "calib.toml:3:1: target.square_m: is missing"),
        (format!("{camera}[target]\ncolumns = 1\nrows = 6\nsquare_m = 0.03\n"), "target.columns: must be from 3 to 100, is 1"),
        (format!("{camera}{target}square = 2\n"), "unknown field `square`"),
        (format!("{camera}interior.model = \"fisheye\"\n{target}"), "\"fisheye\" is not calibrated from targets"),
        (
            format!("{camera}interior = {{ model = \"pinhole\", fx = 2.0, fy = 2.0 }}\n{target}"),
            "parameters are what the calibration finds",
        ),
        (format!("{camera}interior = {{ model = \"brown\", fixed = [\"c\"] }}\n{target}"), "a principal distance has no value to stay at"),
        (target.to_owned(), "no camera is given"),
    ] {
        dive.write("calib.toml", &text);
        let (code, message) = dive.fails(&["calibrate"]);
        assert!(code == 2 && message.contains(expected), "{text}\n{message}");
    }
    assert_eq!(dive.fails(&["calibrate", "nowhere.toml"]).0, 2);
    dive.write("calib.toml", &format!("{camera}{target}"));
    assert_eq!(dive.fails(&["calibrate"]).0, 3, "noise shows no board");
    // rig.file that is missing or wrong.
    dive.write("rig.toml", "[pose.C9]\ntranslation_m = [0, 0, 0]\n");
    let rig = |file: &str| pipeline::config::parse(&dive.path("dive.toml"), &format!("{camera}[rig]\nfile = \"{file}\"\n"));
    assert!(rig("rig.toml").unwrap_err().to_string().contains("there is no camera \"C9\""));
    assert!(rig("no.toml").unwrap_err().to_string().contains("cannot read"));
}

#[test]
fn the_page_describes_every_key_and_its_example_is_accepted() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/calibrate.md");
    let page = std::fs::read_to_string(path).unwrap();
    let example = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let dive = Dive::of_noise();
    dive.write("port.mp4", "x");
    dive.write("calib.toml", example);
    let config = pipeline::config::read_calib(&dive.path("calib.toml")).unwrap();
    assert_eq!((config.cameras.len(), config.target.columns, config.cameras[0].interior.held.iter().filter(|h| **h).count()), (2, 9, 3));
    for key in documented("calib.toml") {
        let name = key.rsplit('.').next().unwrap();
        assert!(example.lines().any(|line| line.split(['.', ' ']).any(|word| word == name)), "no example uses {key}");
    }
}

#[derive(Debug)]
struct OpenCvStereo {
    fx: [f64; 2],
    baseline_m: f64,
    rms_px: f64,
}

/// `cv::calibrateCamera` of each camera, and from there `cv::stereoCalibrate` of all parameters, with the same model, on the corners that we
/// find.
fn stereo_calibrated_by_opencv(folder: &std::path::Path) -> OpenCvStereo {
    use opencv::core::{Mat, MatTraitConst, Point2f, Point3f, Size, TermCriteria, Vector};
    let board: Vector<Point3f> =
        (0..COLUMNS * ROWS).map(|k| Point3f::new((k % COLUMNS) as f32 * 0.025, (k / COLUMNS) as f32 * 0.025, 0.0)).collect();
    let numbers = [1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14];
    let objects: Vector<Vector<Point3f>> = numbers.iter().map(|_| board.clone()).collect();
    let corners = |side: &str| -> Vector<Vector<Point2f>> {
        let of = |n: &i32| {
            let image = imaging::decode_grey(&std::fs::read(folder.join(format!("{side}{n:02}.jpg"))).unwrap()).unwrap();
            let calibrate::BoardFinding::Found(found) = calibrate::detect_board(&image, COLUMNS, ROWS) else { panic!("{side}{n}") };
            found.corners.iter().map(|p| Point2f::new(p.x as f32 - 0.5, p.y as f32 - 0.5)).collect()
        };
        numbers.iter().map(of).collect()
    };
    let (left, right) = (corners("left"), corners("right"));
    let (size, stop) = (Size::new(640, 480), TermCriteria::new(3, 200, 1e-10).unwrap());
    let fixed = opencv::calib3d::CALIB_FIX_K3;
    let single = |seen: &Vector<Vector<Point2f>>| {
        let (mut k, mut d) = (Mat::default(), Mat::default());
        let (mut r, mut t) = (Vector::<Mat>::new(), Vector::<Mat>::new());
        opencv::calib3d::calibrate_camera(&objects, seen, size, &mut k, &mut d, &mut r, &mut t, fixed, stop).unwrap();
        (k, d)
    };
    let ((mut k1, mut d1), (mut k2, mut d2)) = (single(&left), single(&right));
    let (mut r, mut t, mut e, mut f) = (Mat::default(), Mat::default(), Mat::default(), Mat::default());
    let flags = fixed | opencv::calib3d::CALIB_USE_INTRINSIC_GUESS;
    let rms_px = opencv::calib3d::stereo_calibrate(
        &objects, &left, &right, &mut k1, &mut d1, &mut k2, &mut d2, size, &mut r, &mut t, &mut e, &mut f, flags, stop,
    )
    .unwrap();
    let fx = [&k1, &k2].map(|k| *k.at_2d::<f64>(0, 0).unwrap());
    let baseline_m = (0..3).map(|i| t.at_2d::<f64>(i, 0).unwrap().powi(2)).sum::<f64>().sqrt();
    OpenCvStereo { fx, baseline_m, rms_px }
}

#[test]
fn photographs_of_opencv_give_its_calibration() {
    let Some(folder) = std::env::var_os("SFM_DATA").map(|d| std::path::Path::new(&d).join("chequerboard-stereo")).filter(|f| f.is_dir())
    else {
        println!("SFM_DATA has no chequerboard-stereo: not tried");
        return;
    };
    let dive = Dive::empty();
    let camera =
        |name: &str| format!("[[camera]]\nname = \"{name}\"\nimages = \"{}/{name}*.jpg\"\ninterior.model = \"opencv\"\n", folder.display());
    dive.write("calib.toml", &format!("[target]\ncolumns = 9\nrows = 6\nsquare_m = 0.025\n{}{}", camera("left"), camera("right")));
    let record: Value = serde_json::from_str(&dive.ok(&["calibrate", "--json"])).unwrap();
    assert_eq!((&record["images"]["with_target"], &record["exposures"]), (&26.into(), &13.into()));
    let focal = |c: usize| parameter(&record, c, "fx")["value"].as_f64().unwrap();
    let (baseline, rms) = (record["baselines"][0]["length_m"].as_f64().unwrap(), record["rms_px"].as_f64().unwrap());
    let opencv = stereo_calibrated_by_opencv(&folder);
    println!("OpenCV {opencv:?}, ours fx {} {}, baseline {baseline}, RMS {rms}", focal(0), focal(1));
    for (found, reference) in [(focal(0), opencv.fx[0]), (focal(1), opencv.fx[1]), (baseline, opencv.baseline_m)] {
        assert!((found / reference - 1.0).abs() < 1e-3, "{found}, OpenCV {reference}");
    }
    assert!(rms <= opencv.rms_px, "{rms}, OpenCV {}", opencv.rms_px);
    assert!(record["rectifications"][0]["rms_px"].as_f64().unwrap() < 2.0 * rms);

    // Halves of them, taken in one go, show no drift.
    for (k, number) in [1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14].into_iter().enumerate() {
        for side in ["left", "right"] {
            let to = dive.path(["first", "second"][k % 2]).join(side);
            std::fs::create_dir_all(&to).unwrap();
            let file = format!("{side}{number:02}.jpg");
            std::fs::copy(folder.join(&file), to.join(&file)).unwrap();
        }
    }
    let half = |name: &str| format!("[[camera]]\nname = \"{name}\"\nimages = \"first/{name}\"\ninterior.model = \"opencv\"\n");
    dive.write("calib.toml", &format!("[target]\ncolumns = 9\nrows = 6\nsquare_m = 0.025\n{}{}", half("left"), half("right")));
    dive.ok(&["calibrate"]);
    let check: Value = serde_json::from_str(&dive.ok(&["calibrate", "--check", "calibration/rig.toml", "second", "--json"])).unwrap();
    assert!(["holds", "doubtful"].contains(&check["verdict"].as_str().unwrap()), "{check:#}");
    assert!(check["held"]["ratio"].as_f64().unwrap() < 1.5, "{check:#}");
}

#[test]
fn water_has_its_index_and_changes_the_principal_distance() {
    let dive = Dive::empty();
    let reef = ["water", "--depth", "25", "--salinity", "35", "--temperature", "19"];
    let json = |more: &[&str]| -> Value { serde_json::from_str(&dive.ok(&[&reef[..], &["--json"], more].concat())).unwrap() };
    let found = json(&["--principal-distance", "6.7108"]);
    // Hoehle by hand: 1.338 + 4e-5 (486 + 0.075 + 175 - 540 - 19), at the surface without 0.075.
    let hoehle = &found["formulas"][1];
    assert!(
        (hoehle["index"].as_f64().unwrap() - 1.342_083).abs() < 1e-9
            && (hoehle["calibrated_index"].as_f64().unwrap() - 1.342_08).abs() < 1e-9
    );
    let change = hoehle["principal_distance_change"].as_f64().unwrap();
    assert!((change - 6.7108 * 3e-6 / 1.342_08).abs() < 1e-9, "{change}");
    assert_eq!(json(&["--wavelength", "650"])["water"]["wavelength_nm"], 650.0);
    assert!(json(&["--wavelength", "650"])["formulas"][0]["index"].as_f64() < found["formulas"][0]["index"].as_f64(), "red is bent less");
    assert!(dive.ok(&reef).starts_with("Quan & Fry 1995"));
    let (code, message) = dive.fails(&["water", "--depth", "-5", "--salinity", "35", "--temperature", "19"]);
    assert!(code == 2 && message.contains("depth -5 m is not from 0 to 11000"), "{message}");

    // A log: of the temperature a column, of the salinity the option; a line without depth is left out.
    dive.write("sensors.csv", "time_s,depth_m,heading_deg,temperature_degc\n0,25,90,19\n1,,91,\n2,0,92,\n");
    let log = ["water", "--log", "sensors.csv", "--salinity", "35", "--temperature", "12"];
    let table = dive.ok(&[&log[..], &["--principal-distance", "6.7108", "--calibrated-temperature", "19"]].concat());
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!((rows.len(), &rows[0][..4], &rows[1][..4]), (2, &["0", "25", "35", "19"][..], &["2", "0", "35", "12"][..]), "{table}");
    let first: f64 = rows[0][4].parse().unwrap();
    assert!((first - found["formulas"][0]["index"].as_f64().unwrap()).abs() < 1e-8);
    let distance: f64 = rows[0][7].parse().unwrap();
    assert!((distance - 6.7108 - change).abs() < 1e-7, "{table}");
    dive.write("sensors.csv", "time_s,depth_m\n0,deep\n");
    let (code, message) = dive.fails(&log);
    assert!(code == 2 && message.contains("line 2: \"deep\" is no number"), "{message}");
    dive.write("sensors.csv", "time_s,up_m\n0,1\n");
    assert!(dive.fails(&log).1.contains("there is no column depth_m; the columns are time_s, up_m"));
}
