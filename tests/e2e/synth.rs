//! `sfm synth`: a folder that runs, with its truth; the same bytes anywhere; nothing of anyone else is touched.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use scene::format::{read_colmap_binary, read_ply_mesh};
use support::{Dive, tree};

const TINY: &[&str] = &["--frames", "2", "--size", "96x64"];

fn synth<'a>(folder: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["synth", folder], TINY, more].concat()
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_one_and_two_threads() {
    let dive = Dive::empty();
    dive.ok(&synth("one", &["--threads", "1", "--cameras", "3"]));
    dive.ok(&synth("two", &["--threads", "2", "--cameras", "3"]));
    dive.ok(&synth("other", &["--cameras", "3", "--seed", "8"]));
    let [one, two, other] = ["one", "two", "other"].map(|name| tree(&dive.path(name)));
    // Six frames and masks, dive.toml, mesh, positions, five files of the model.
    assert_eq!(one.len(), 20, "{:?}", one.keys());
    assert_eq!(one, two);
    assert_ne!(one["frames/C1/0000.jpg"], other["frames/C1/0000.jpg"]);
}

#[test]
fn what_is_written_runs_and_holds_its_truth() {
    let dive = Dive::empty();
    dive.ok(&synth("reef", &["--cameras", "3"]));
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

    let (mesh, _) = read_ply_mesh(std::fs::read(dive.path("reef/truth/mesh.ply")).unwrap().as_slice()).unwrap();
    assert!(!mesh.faces.is_empty());
    let frame = imaging::decode_rgb(&std::fs::read(dive.path("reef/frames/C3/0001.jpg")).unwrap()).unwrap();
    let mask = imaging::decode_grey_u8(&std::fs::read(dive.path("reef/truth/masks/C3/0001.png")).unwrap()).unwrap();
    assert_eq!((frame.width(), frame.height()), (96, 64));
    assert_eq!((mask.width(), mask.height()), (96, 64));
}

#[test]
fn a_folder_that_holds_something_is_left_alone() {
    let dive = Dive::empty();
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
    let dive = Dive::empty();
    let bad = [
        (["--frames", "1"], "2..=9999"),
        (["--cameras", "4"], "2..=3"),
        (["--size", "640"], "for example 960x600"),
        (["--size", "0x600"], "from 64 to 8192"),
        (["--noise", "nan"], "from 0 to 100"),
        (["--water", "tea"], "clear, none"),
    ];
    for (options, hint) in bad {
        let (code, message) = dive.fails(&[&["synth", "reef"], &options[..]].concat());
        assert_eq!(code, 2, "{options:?}");
        assert!(message.contains(hint), "{options:?}: {message}");
        assert!(!dive.path("reef").exists());
    }
    assert_eq!(dive.fails(&["synth"]).0, 2);
}
