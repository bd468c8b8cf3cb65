//! `sfm synth`: a folder that runs, with its truth; the same bytes anywhere; nothing of anyone else is touched.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use scene::format::{read_colmap_binary, read_ply_mesh};
use support::{Dive, tree};

/// A coarse scene and tiny frames.
const SCENE: &str = "[world]\ndetail_m = 0.1\nstones = 5\nfish = 2\n[rig]\nwidth = 96\nheight = 64\n[motion]\nframes = 2\n";

fn scene() -> Dive {
    let dive = Dive::empty();
    dive.write("scene.toml", SCENE);
    dive
}

fn synth<'a>(folder: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["synth", "scene.toml", folder], more].concat()
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_one_and_two_threads() {
    let dive = scene();
    dive.ok(&synth("one", &["--threads", "1", "--cameras", "3"]));
    dive.ok(&synth("two", &["--threads", "2", "--cameras", "3"]));
    dive.ok(&synth("other", &["--cameras", "3", "--seed", "8"]));
    let [one, two, other] = ["one", "two", "other"].map(|name| tree(&dive.path(name)));
    // Six frames, masks, label and depth images; dive.toml, sensors.csv; mesh, seen, positions, frames, bars, optics, labels, scene,
    // preview; five files of the model.
    assert_eq!(one.len(), 24 + 2 + 9 + 5, "{:?}", one.keys());
    assert_eq!(one, two);
    for file in ["frames/C1/0000.jpg", "sensors.csv", "truth/mesh.ply", "truth/positions.txt"] {
        assert_ne!(one[file], other[file], "{file}");
    }
    // Frames without loss.
    dive.write("png.toml", &format!("{SCENE}[response]\njpeg_quality = 0\n"));
    dive.ok(&["synth", "png.toml", "lossless"]);
    assert!(dive.path("lossless/frames/C1/0000.png").exists());
    assert!(std::fs::read_to_string(dive.path("lossless/truth/positions.txt")).unwrap().contains("C2/0001.png"));
    // The settings as written down make the same dive again.
    std::fs::copy(dive.path("one/truth/scene.toml"), dive.path("again.toml")).unwrap();
    dive.ok(&["synth", "again.toml", "again", "--preset", "survey"]);
    assert_eq!(tree(&dive.path("again")), one);
}

#[test]
fn what_is_written_runs_and_holds_its_truth() {
    let dive = scene();
    dive.ok(&synth("reef", &["--cameras", "3", "--water", "coastal"]));
    let printed: serde_json::Value = serde_json::from_str(&dive.ok(&["run", "reef/dive.toml", "--until", "ingest", "--json"])).unwrap();
    assert_eq!((&printed["images"]["total"], &printed["frames"]["total"]), (&6.into(), &2.into()));
    assert_eq!(printed["warnings"], serde_json::json!([]));

    let truth = read_colmap_binary(&dive.path("reef/truth/sparse")).unwrap();
    assert_eq!(truth.oriented_images().count(), 6);
    let text = std::fs::read_to_string(dive.path("reef/dive.toml")).unwrap();
    let config: toml::Value = toml::from_str(&text).unwrap();
    for baseline in config["rig"]["baseline"].as_array().unwrap() {
        let camera = |i: usize| baseline["between"][i].as_str().unwrap()[1..].parse::<usize>().unwrap() - 1;
        let [first, second] = [camera(0), camera(1)].map(|c| truth.rigs[0].sensors[c].cam_from_rig.centre());
        // Half of the last digit written.
        assert!(((first - second).norm() - baseline["length_m"].as_float().unwrap()).abs() < 5.1e-6);
    }
    assert_eq!(config["rig"]["baseline"].as_array().unwrap().len(), 3);

    let mesh = |name: &str| read_ply_mesh(std::fs::read(dive.path(name)).unwrap().as_slice()).unwrap().0;
    let (all, seen) = (mesh("reef/truth/mesh.ply"), mesh("reef/truth/seen.ply"));
    assert!(!seen.faces.is_empty() && seen.faces.len() < all.faces.len());
    let read = |name: &str| std::fs::read(dive.path(name)).unwrap();
    let frame = imaging::decode_rgb(&read("reef/frames/C3/0001.jpg")).unwrap();
    assert_eq!((frame.width(), frame.height()), (96, 64));
    let mask = imaging::decode_grey_u8(&read("reef/truth/masks/C1/0001.png")).unwrap();
    let labels = imaging::decode_grey_u8(&read("reef/truth/labels/C1/0001.png")).unwrap();
    for (mask, label) in mask.data().iter().zip(labels.data()) {
        assert_eq!(*mask == 255, (1..=4).contains(label));
    }

    // The bars are as long as they are said to be; the sensors were logged before the first exposure and after the last.
    let bars = String::from_utf8(read("reef/truth/bars.csv")).unwrap();
    for row in bars.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let v: Vec<f64> = cells[2..].iter().map(|c| c.parse().unwrap()).collect();
        let length = ((v[1] - v[4]).powi(2) + (v[2] - v[5]).powi(2) + (v[3] - v[6]).powi(2)).sqrt();
        assert!((length - v[0]).abs() < 3e-6, "{row}");
    }
    let sensors = String::from_utf8(read("reef/sensors.csv")).unwrap();
    let times: Vec<f64> = sensors.lines().skip(1).map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(times[0] < -1.0 && *times.last().unwrap() > 1.0);
    // Sea water at 19 degrees and 35 ppt.
    let index: f64 =
        String::from_utf8(read("reef/truth/frames.csv")).unwrap().lines().nth(1).unwrap().rsplit(',').next().unwrap().parse().unwrap();
    assert!((1.340..1.343).contains(&index), "{index}");
}

#[test]
fn a_folder_that_holds_something_is_left_alone() {
    let dive = scene();
    std::fs::create_dir(dive.path("mine")).unwrap();
    dive.write("mine/notes.txt", "mine");
    let (code, message) = dive.fails(&synth("mine", &[]));
    assert_eq!(code, 1);
    assert!(message.contains("mine is not empty") && message.contains("hint: name a new folder"), "{message}");
    assert_eq!(std::fs::read_dir(dive.path("mine")).unwrap().count(), 1);
    dive.write("file", "mine");
    assert_eq!(dive.fails(&synth("file", &[])).0, 1);
}

#[test]
fn bad_options_exit_with_2_and_a_hint() {
    let dive = scene();
    let bad = [
        (["--frames", "1"], "2..=9999"),
        (["--cameras", "4"], "1..=3"),
        (["--size", "640"], "for example 960x600"),
        (["--size", "0x600"], "from 64 to 8192"),
        (["--noise", "nan"], "from 0 to 100"),
        (["--water", "tea"], "clear, coastal, turbid, none"),
        (["--port", "round"], "flat, known, none"),
        (["--preset", "moon"], "demo, survey, calibration, tank"),
    ];
    for (options, hint) in bad {
        let (code, message) = dive.fails(&[&["synth", "reef"], &options[..]].concat());
        assert_eq!(code, 2, "{options:?}");
        assert!(message.contains(hint), "{options:?}: {message}");
        assert!(!dive.path("reef").exists());
    }
    assert_eq!(dive.fails(&["synth"]).0, 2);
    // A file of settings without a folder, and files that are wrong.
    let (code, message) = dive.fails(&["synth", "scene.toml"]);
    assert!(code == 2 && message.contains("no folder to write into"), "{code}: {message}");
    for (text, told) in [
        ("[water]\nsalt = 3\n", "line 2"),
        ("[motion]\nframes = 0\n", "motion.frames = 0 must be from 1"),
        ("[[rig.cameras]]\nfocal_mm = 1e9\n", "focal_mm of rig.cameras[0]"),
    ] {
        dive.write("bad.toml", text);
        let (code, message) = dive.fails(&["synth", "bad.toml", "reef"]);
        assert!(code == 2 && message.contains(told), "{code}: {message}");
        assert!(!dive.path("reef").exists());
    }
    assert_eq!(dive.fails(&["synth", "no.toml", "reef"]).0, 1);
}
