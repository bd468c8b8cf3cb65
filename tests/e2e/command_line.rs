//! The program as a user meets it: exit codes, what is on stdout, init, status, resume.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use support::{Dive, png, tree};

const TWO: &str = "[[camera]]\nname = \"L\"\nimages = \"frames/left\"\n[[camera]]\nname = \"R\"\nimages = \"frames/right\"\n";

#[test]
fn init_writes_a_file_that_runs() {
    let dive = Dive::of_noise();
    let text = dive.ok(&["init", "frames"]);
    assert!(text.contains("frames_from = \"stem\"") && text.contains("name = \"left\"") && text.contains("64 x 48 pixels"), "{text}");
    dive.write("dive.toml", &text);
    dive.ok(&["run", "--until", "ingest"]);
    let list: serde_json::Value = serde_json::from_slice(&std::fs::read(dive.path("out/frames/images.json")).unwrap()).unwrap();
    let images = list["images"].as_array().unwrap();
    assert_eq!(images.len(), 6);
    assert_eq!((&images[1]["name"], &images[1]["exposure"]), (&"left/1.png".into(), &1.into()));
    assert_eq!((&images[4]["name"], &images[4]["exposure"]), (&"right/1.png".into(), &1.into()));
}

#[test]
fn init_of_nothing_is_told() {
    let dive = Dive::of_noise();
    std::fs::create_dir(dive.path("empty")).unwrap();
    assert_eq!(dive.fails(&["init", "empty"]).0, 3);
    assert_eq!(dive.fails(&["init", "missing"]).0, 1);
}

#[test]
fn a_wrong_file_or_command_line_exits_with_2() {
    let dive = Dive::of_noise();
    dive.write("dive.toml", &format!("{TWO}[mask]\nstratgy = \"ip\"\n"));
    let (code, message) = dive.fails(&["run"]);
    assert_eq!(code, 2);
    assert!(message.contains("dive.toml:8:1: mask.stratgy: unknown key\n  hint: did you mean `strategy`?"), "{message}");
    assert_eq!(dive.fails(&["run", "nowhere.toml"]).0, 2);
    assert_eq!(dive.fails(&["run", "--until", "everything"]).0, 2);
    assert_eq!(dive.fails(&["help", "nothing"]).0, 2);
    assert!(!dive.path("out").exists(), "a wrong file writes nothing");
}

#[test]
fn status_says_what_changed() {
    let dive = Dive::of_noise();
    dive.write("dive.toml", TWO);
    let line = || dive.ok(&["status"]).lines().next().unwrap().to_owned();
    assert_eq!(line(), "ingest     missing  not run yet");
    dive.ok(&["run", "--until", "ingest"]);
    assert_eq!(line().trim_end(), "ingest     done");
    dive.write("dive.toml", &format!("{TWO}[dive]\nframes_from = \"stem\"\n"));
    assert_eq!(line(), "ingest     stale    frames_from was \"order\", is \"stem\"");
    dive.write("dive.toml", TWO);
    std::fs::write(dive.path("frames/left/1.png"), png(64, 48, 99)).unwrap();
    assert_eq!(line(), "ingest     stale    L/1.png (2) is changed");
    dive.ok(&["run", "--until", "ingest"]);
    std::fs::remove_file(dive.path("out/frames/images.json")).unwrap();
    assert_eq!(line(), "ingest     missing  frames/images.json is gone or cut short");
}

#[test]
fn bad_images_are_warnings() {
    let dive = Dive::of_noise();
    std::fs::write(dive.path("frames/left/3.jpg"), "dear diary").unwrap();
    std::fs::write(dive.path("frames/left/4.png"), "").unwrap();
    std::fs::write(dive.path("frames/left/5.png"), png(32, 48, 5)).unwrap();
    std::fs::copy(dive.path("frames/left/0.png"), dive.path("frames/left/6.png")).unwrap();
    dive.write("dive.toml", TWO);
    let report: serde_json::Value = serde_json::from_str(&dive.ok(&["run", "--until", "ingest", "--json"])).unwrap();
    assert_eq!((&report["images"]["found"], &report["images"]["total"]), (&10.into(), &6.into()));
    let warnings: Vec<String> =
        report["warnings"].as_array().unwrap().iter().map(|w| format!("{}: {}", w["about"], w["message"])).collect();
    assert_eq!(warnings.len(), 4, "{warnings:?}");
    for (warning, word) in warnings.iter().zip(["not an image", "empty file", "32 x 48", "copy of L/0.png"]) {
        assert!(warning.contains(word), "{warning} has no {word}");
    }
    assert!(report["stages"]["ingest"]["seconds"].is_number());
}

#[test]
fn nothing_but_bad_images_exits_with_3() {
    let dive = Dive::of_noise();
    std::fs::create_dir(dive.path("frames/none")).unwrap();
    std::fs::write(dive.path("frames/none/1.jpg"), "dear diary").unwrap();
    dive.write("dive.toml", "[[camera]]\nimages = \"frames/none\"\n");
    let (code, message) = dive.fails(&["run"]);
    assert_eq!(code, 3);
    assert!(message.contains("none of the 1 images can be used") && message.contains("C1/1.jpg"), "{message}");
}

#[test]
fn a_folder_of_someone_else_is_left_alone() {
    let dive = Dive::of_noise();
    dive.write("dive.toml", TWO);
    std::fs::create_dir_all(dive.path("out/masks")).unwrap();
    dive.write("out/masks/mine.png", "mine");
    let (code, message) = dive.fails(&["run"]);
    assert_eq!(code, 1);
    assert!(message.contains("was not written by sfm"), "{message}");
    assert_eq!(std::fs::read(dive.path("out/masks/mine.png")).unwrap(), b"mine");
}

#[test]
fn the_same_dive_gives_the_same_bytes_anywhere() {
    let (one, two) = (Dive::of_noise(), Dive::of_noise());
    one.write("dive.toml", TWO);
    two.write("dive.toml", &format!("{TWO}[dive]\noutput = \"elsewhere/results\"\n"));
    one.ok(&["run", "--threads", "1", "--until", "ingest"]);
    two.ok(&["run", "--threads", "2", "--until", "ingest"]);
    let (one, two) = (tree(&one.path("out")), tree(&two.path("elsewhere/results")));
    assert!(one.len() >= 3, "{:?}", one.keys());
    assert_eq!(one, two);
}

/// A unit square in the plane z = 0, and points 1 and 3 mm above it: the mean is 2 mm.
#[test]
fn eval_measures_a_cloud() {
    let dive = Dive::of_noise();
    let header = |vertices: usize, rest: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n{rest}end_header\n"
        )
    };
    let faces = "element face 2\nproperty list uchar int vertex_indices\n";
    dive.write("mesh.ply", &(header(4, faces) + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"));
    dive.write("cloud.ply", &(header(2, "") + "0.25 0.25 0.001\n0.75 0.75 0.003\n"));
    let text = dive.ok(&["eval", "cloud.ply", "--reference", "mesh.ply", "--threshold-m", "0.002", "--json"]);
    let metrics: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!((metrics["c2m_mean_m"].as_f64().unwrap() - 0.002).abs() < 1e-6, "{metrics}");
    assert!((metrics["snr"].as_f64().unwrap() - 0.5).abs() < 1e-9, "{metrics}");
    assert!(dive.ok(&["eval", "cloud.ply", "--reference", "mesh.ply", "--gsd-m", "0.001"]).contains("0.002000"));
    assert_eq!(dive.fails(&["eval", "cloud.ply", "--reference", "mesh.ply"]).0, 2);
    assert_eq!(dive.fails(&["eval", "none.ply", "--reference", "mesh.ply", "--gsd-m", "1"]).0, 1);
}

/// Masks from files: kept as 0 and 255, missing ones told, the image's size demanded.
#[test]
fn masks_come_from_files() {
    let dive = Dive::of_noise();
    std::fs::create_dir(dive.path("masks")).unwrap();
    let grey = |w: usize, h: usize, f: fn(usize) -> u8| {
        imaging::encode_png_grey(&scene::Raster::from_vec(w, h, (0..w * h).map(f).collect()).unwrap()).unwrap()
    };
    std::fs::write(dive.path("masks/0.png"), grey(64, 48, |i| if i % 4 == 0 { 200 } else { 90 })).unwrap();
    std::fs::write(dive.path("masks/1.png"), grey(32, 48, |_| 255)).unwrap();
    dive.write("dive.toml", "[[camera]]\nname = \"L\"\nimages = \"frames/left\"\nmask = \"masks/{stem}.png\"\n");
    let report: serde_json::Value = serde_json::from_str(&dive.ok(&["run", "--until", "mask", "--json"])).unwrap();
    let mask = imaging::decode_grey_u8(&std::fs::read(dive.path("out/masks/files/L/0.png")).unwrap()).unwrap();
    assert!(mask.data().iter().enumerate().all(|(i, v)| *v == if i % 4 == 0 { 255 } else { 0 }));
    assert!(!dive.path("out/masks/files/L/1.png").exists());
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("32 x 48") && warnings.contains("no mask file"), "{warnings}");
    assert!((report["masks"]["masked_ratio"].as_f64().unwrap() - 0.75).abs() < 1e-12);
}

#[test]
fn help_explains_every_key_of_the_report() {
    let dive = Dive::of_noise();
    dive.write("dive.toml", TWO);
    let report: serde_json::Value = serde_json::from_str(&dive.ok(&["run", "--until", "ingest", "--json"])).unwrap();
    let help = dive.ok(&["help", "json"]);
    let known: Vec<&str> = help.lines().filter_map(|l| l.split_whitespace().next()).collect();
    for key in support::keys(&report) {
        assert!(known.contains(&key.as_str()), "{key} is not explained");
    }
}

/// The examples say what is read, whatever lies at `SFM_DATA`; without it, what is missing.
#[test]
fn every_example_is_read() {
    let dive = Dive::empty();
    for folder in [
        "sceaux",
        "fountain-p11/images",
        "herz-jesus-p8/images",
        "kitti-1/image_l",
        "kitti-1/image_r",
        "haltbrekken/left",
        "haltbrekken/right",
        "aurlab-tower/left",
        "aurlab-tower/right",
    ] {
        std::fs::create_dir_all(dive.path(&format!("data/{folder}"))).unwrap();
        std::fs::write(dive.path(&format!("data/{folder}/0.png")), support::png(8, 8, 1)).unwrap();
    }
    std::fs::create_dir_all(dive.path("data/reef-clip")).unwrap();
    std::fs::write(dive.path("data/reef-clip/reef_clip.mp4"), "x").unwrap();
    let mut count = 0;
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        count += 1;
        dive.write("dive.toml", &std::fs::read_to_string(&path).unwrap());
        let with = dive.command(&["status"]).env("SFM_DATA", dive.path("data")).output().unwrap();
        assert!(with.status.success(), "{}: {}", path.display(), String::from_utf8_lossy(&with.stderr));
        let without = dive.command(&["status"]).env_remove("SFM_DATA").output().unwrap();
        assert_eq!(without.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&without.stderr).contains("the environment variable SFM_DATA is not set"));
    }
    assert!(count >= 7, "{count} examples");
}

/// What a variable holds is a path, not a pattern; a calibration for another aspect is an error of the file, told before the work.
#[test]
fn variables_are_paths_and_calibrations_must_fit() {
    let dive = Dive::empty();
    std::fs::create_dir_all(dive.path("dive [2024]")).unwrap();
    for i in 0..2 {
        std::fs::write(dive.path(&format!("dive [2024]/{i}.png")), png(64, 48, i)).unwrap();
    }
    dive.write("dive.toml", "[[camera]]\nimages = \"${HERE}/*.png\"\n");
    let run = |dive: &Dive| dive.command(&["run", "--until", "features"]).env("HERE", dive.path("dive [2024]")).output().unwrap();
    let output = run(&dive);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    dive.write("dive.toml", "[dive]\noutput = \"other\"\n[[camera]]\nimages = \"${HERE}\"\ninterior = { model = \"pinhole\", width = 48, height = 64, fx = 50, fy = 50 }\n");
    let output = run(&dive);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains("ingest") && stderr.contains("another aspect") && !stderr.contains("features"), "{stderr}");
}

/// A sheet a centimetre above a square of two triangles: a box cuts it, closest points move it onto the square, and figures are written.
#[test]
fn eval_cuts_aligns_and_writes() {
    let dive = Dive::empty();
    let sheet: Vec<String> =
        (0..2500).map(|i| format!("{} {} 0.01", 0.02 * f64::from(i % 50) + 0.01, 0.02 * f64::from(i / 50) + 0.01)).collect();
    dive.write("sheet.xyz", &sheet.join("\n"));
    dive.write("square.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n");
    let measure = |more: &[&str]| -> serde_json::Value {
        let all = [&["eval", "sheet.xyz", "--reference", "square.off", "--threshold-m", "0.02", "--json"], more].concat();
        serde_json::from_str(&dive.ok(&all)).unwrap()
    };
    let near = |value: &serde_json::Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-9;
    let whole = measure(&["--out", "coloured.ply", "--csv", "figures.csv"]);
    assert!(whole["points"] == 2500 && near(&whole["c2m_signed_mean_m"], 0.01) && near(&whole["c2m_mad_m"], 0.0), "{whole:#}");
    assert!(std::fs::read_to_string(dive.path("figures.csv")).unwrap().contains("\npoints,2500\n"));
    let (coloured, _) = scene::format::read_ply_cloud(std::fs::read(dive.path("coloured.ply")).unwrap().as_slice()).unwrap();
    assert_eq!((coloured.positions.len(), coloured.colours.len()), (2500, 2500));
    assert_eq!(measure(&["--box", "0,0,-1,0.5,1,1"])["points"], 1250);
    assert!(near(&measure(&["--align", "icp"])["c2m_mean_m"], 0.0));
    let fails = |more: &[&str]| dive.fails(&[&["eval", "sheet.xyz", "--reference", "square.off", "--threshold-m", "0.02"], more].concat());
    assert!(fails(&["--box", "0,0,0,1"]).1.contains("for example 0,0,-2,10,5,1"));
    assert!(fails(&["--box", "1,0,0,0,1,1"]).1.contains("the smallest"));
    dive.write("none.xyz", "");
    let (code, message) = dive.fails(&["eval", "none.xyz", "--reference", "square.off", "--threshold-m", "0.02"]);
    assert!(code == 1 && message.contains("none.xyz") && message.contains("empty"), "{message}");
}

/// Two images of four points: what comes out must project where they were seen.
#[test]
fn bundle_adjusts_a_problem_and_refuses_a_broken_one() {
    let dive = Dive::of_noise();
    let points = [[0.0, 0.0, 0.0], [1.0, 0.2, -0.5], [-0.8, 0.7, 0.3], [0.4, -0.9, 0.6], [-0.5, -0.4, -0.7], [0.9, 0.8, 0.1]];
    let shifts = [0.0, 0.6];
    let mut text = format!("2 {} {}\n", points.len(), 2 * points.len());
    for (i, p) in points.iter().enumerate() {
        for (c, shift) in shifts.iter().enumerate() {
            // P = X + t with t = (shift, 0, -5), p = -f P / P.z.
            let z: f64 = p[2] - 5.0;
            text += &format!("{c} {i} {} {}\n", -500.0 * (p[0] + shift) / z, -500.0 * p[1] / z);
        }
    }
    for shift in shifts {
        text += &format!("0\n0\n0.01\n{shift}\n0\n-5\n510\n0\n0\n");
    }
    points.iter().flatten().for_each(|x| text += &format!("{}\n", x + 0.01));
    dive.write("problem.txt", &text);
    let out: serde_json::Value = serde_json::from_str(&dive.ok(&["bundle", "problem.txt", "--json"])).unwrap();
    let cost = |key: &str| out[key].as_f64().unwrap();
    assert!(cost("initial_cost") > 10.0 && cost("final_cost") < 1e-3 && cost("seconds") >= 0.0, "{out}");
    assert_eq!(out["observations"], 12);
    dive.write("cut.txt", &text[..200]);
    let (code, message) = dive.fails(&["bundle", "cut.txt"]);
    assert!(code == 1 && message.contains("cut.txt: the file ends where"), "{message}");
    assert!(dive.fails(&["bundle", "frames"]).1.contains("cameras.bin"));
}
