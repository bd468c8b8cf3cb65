//! The whole way on a rendered dive, against its truth.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use serde_json::Value;
use std::fmt::Write;
use support::Dive;
use synthetic::dive::DiveOptions;

/// A baseline makes the model metric; poses, lengths and cloud agree with the truth; every figure is explained.
#[test]
fn a_rendered_dive_comes_out_as_it_is() {
    let (dive, rendered) = Dive::rendered(&DiveOptions::small(6, 480, 300));
    let truth = rendered.scene.truth("png");
    let mut positions = String::new();
    for (i, image) in truth.images.iter().enumerate() {
        let centre = truth.cam_from_world(scene::ImageId::new(i)).unwrap().centre();
        writeln!(positions, "{} {} {} {}", image.name, centre.x, centre.y, centre.z).unwrap();
    }
    dive.write("positions.txt", &positions);
    // The first camera's places, moved 100 m east, one of them wrong; its roll and pitch.
    let mut log = String::from("time_s,east_m,north_m,up_m,roll_deg,pitch_deg\n");
    for (i, image) in truth.images.iter().enumerate().filter(|(_, image)| image.camera.0 == 0) {
        let pose = truth.cam_from_world(scene::ImageId::new(i)).unwrap();
        let time = 10 + truth.frames[image.frame.index()].exposure;
        let jump = if image.name.ends_with("0003.png") { 5.0 } else { 0.0 };
        let [starboard, down, forward] = [0, 1, 2].map(|k| pose.rotation_matrix().row(k).transpose());
        let (roll, pitch) = (f64::atan2(-starboard.z, -down.z).to_degrees(), forward.z.asin().to_degrees());
        let centre = pose.centre();
        writeln!(log, "{time},{},{},{},{roll},{pitch}", centre.x + 100.0, centre.y + jump, centre.z).unwrap();
    }
    dive.write("sensors.csv", &log);
    let baseline = rendered.scene.cameras[1].cam_from_rig.centre().norm();
    dive.write(
        "dive.toml",
        &format!(
            "[[camera]]\nimages = \"frames/C1\"\n[[camera]]\nimages = \"frames/C2\"\n\
             [[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = {baseline}\nsigma_m = 0.0005\n\
             [world]\norigin_m = [100.0, 0.0, 0.0]\n\
             [sensors]\nfile = \"sensors.csv\"\noffset_secs = 10.0\ninterval_secs = 1.0\nposition_sigma_m = 0.05\ntilt_sigma_deg = 0.2\n\
             [densify]\nquality = \"low\"\nmax_views = 3\nmin_views = 2\n\
             [evaluate]\nreference = \"reference.ply\"\npositions = \"positions.txt\"\nthreshold_m = 0.05\n"
        ),
    );
    let printed: Value = serde_json::from_str(&dive.ok(&["run", "--json"])).unwrap();
    assert_eq!(printed["images"]["oriented"], 12, "{printed:#}");
    assert_eq!(printed["scale"], "metric");
    let number = |path: &str| printed.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {path} in {printed:#}"));
    // The focal lengths start from a guess that is half as long again as the true ones.
    assert!(number("/reprojection_rms_px") < 1.0);
    assert!((number("/baselines/0/found_m") - baseline).abs() < 0.002 * baseline);
    assert!(number("/evaluation/positions/rmse_m") < 0.01 * number("/evaluation/positions/path_m"));
    assert!((number("/evaluation/positions/scale") - 1.0).abs() < 0.02);
    assert!(number("/evaluation/c2m_median_m") < 0.03);
    // The model lies where the log says: what two standard deviations of a position are.
    assert_eq!((number("/world/horizontal/readings"), number("/world/horizontal/outliers")), (6.0, 1.0));
    assert!(printed["world"]["heading"].is_null() && number("/precision/datum_in_world/centre_m/0") < 0.05);
    let model = scene::format::read_colmap_binary(&dive.path("out/sparse")).unwrap();
    let image = model.oriented_images().next().unwrap();
    let true_image = truth.images.iter().position(|i| i.name == model.images[image.index()].name).unwrap();
    let true_centre = truth.cam_from_world(scene::ImageId::new(true_image)).unwrap().centre();
    assert!((model.cam_from_world(image).unwrap().centre() - true_centre).norm() < 0.1);
    assert!(number("/dense/points") > 1000.0);
    for stage in ["ingest", "mask", "features", "matching", "orient", "densify", "surface", "evaluate", "report"] {
        assert!(number(&format!("/stages/{stage}/seconds")) >= 0.0);
    }

    // report.json is what was printed, without the times.
    let mut without_times = printed.clone();
    without_times.as_object_mut().unwrap().remove("stages");
    let written: Value = serde_json::from_slice(&std::fs::read(dive.path("out/report.json")).unwrap()).unwrap();
    assert_eq!(written, without_times);
    let help = dive.ok(&["help", "json"]);
    let known: Vec<&str> = help.lines().filter_map(|l| l.split_whitespace().next()).collect();
    for key in support::keys(&printed) {
        assert!(known.contains(&key.as_str()), "{key} is not explained");
    }

    // The page shows the scene and the images, and needs nothing from elsewhere.
    let page = std::fs::read_to_string(dive.path("out/report.html")).unwrap();
    assert!(page.contains("12 of 12 images oriented, in metres") && page.contains("C2/0005.png"));
    assert_eq!(page.matches("data:image/jpeg;base64,").count(), 12);
    assert!(!page.contains("http://") && !page.contains("https://"));

    // The model of another program, here our own in another unit: dive.toml gives it metres again, and its place.
    let mut other = scene::format::read_colmap_binary(&dive.path("out/sparse")).unwrap();
    let world = scene::Similarity3::from_scale(3.0);
    other.points.iter_mut().for_each(|p| p.xyz = world.apply(&p.xyz));
    other.rigs.iter_mut().flat_map(|r| &mut r.sensors).for_each(|s| s.cam_from_rig.translation *= 3.0);
    other.frames.iter_mut().for_each(|f| f.rig_from_world = f.rig_from_world.map(|pose| pose.in_new_world(&world)));
    std::fs::create_dir_all(dive.path("other")).unwrap();
    scene::format::write_colmap_binary(&other, &dive.path("other")).unwrap();
    let adjusted: Value = serde_json::from_str(&dive.ok(&["orient", "--from", "other", "--json"])).unwrap();
    assert_eq!((&adjusted["scale"], &adjusted["images"]["oriented"]), (&"metric".into(), &12.into()));
    assert!((adjusted["baselines"][0]["found_m"].as_f64().unwrap() - baseline).abs() < 0.002 * baseline);
    let again = scene::format::read_colmap_binary(&dive.path("out/adjusted")).unwrap();
    for image in again.oriented_images() {
        let name = &again.images[image.index()].name;
        let first = model.images.iter().position(|i| i.name == *name).unwrap();
        let moved = again.cam_from_world(image).unwrap().centre() - model.cam_from_world(scene::ImageId::new(first)).unwrap().centre();
        // Its observations weigh alike, those of the run by their scale: less than the standard deviation of a position.
        assert!(moved.norm() < 0.05, "{name} {moved:?}");
    }
    assert!(dive.fails(&["orient", "--from", "other"]).1.contains("out/adjusted is not empty"));
    other.images[3].name = "C9/1.png".to_owned();
    std::fs::create_dir_all(dive.path("wrong")).unwrap();
    scene::format::write_colmap_binary(&other, &dive.path("wrong")).unwrap();
    let (code, message) = dive.fails(&["orient", "--from", "wrong", "--out", "no"]);
    assert!(code == 2 && message.contains("image C9/1.png of the model is none of dive.toml"), "{message}");

    // Every form of a model; its cameras have one focal length and two radial terms.
    let forms = [
        ("out/sparse", "colmap-text", "points3D.txt"),
        ("out/sparse", "nerfstudio", "transforms.json"),
        // Text is read as well.
        ("colmap-text", "bundler", "bundle.out"),
    ];
    for (from, format, file) in forms {
        dive.ok(&["export", from, "--format", format, "--out", format]);
        assert!(std::fs::read_to_string(dive.path(format).join(file)).unwrap().len() > 1000, "{format}");
        assert!(dive.fails(&["export", "out/sparse", "--format", format, "--out", format]).1.contains("is not empty"));
    }
    let transforms: Value = serde_json::from_slice(&std::fs::read(dive.path("nerfstudio/transforms.json")).unwrap()).unwrap();
    assert_eq!(transforms["frames"].as_array().map(Vec::len), Some(12));

    // Nothing is left to do; a changed option of one stage leaves those before it done.
    let stages =
        |text: String| -> Vec<String> { text.lines().map(|l| l.split_whitespace().take(2).collect::<Vec<_>>().join(" ")).collect() };
    assert!(stages(dive.ok(&["status"])).iter().all(|l| l.ends_with(" done")));
    let text = std::fs::read_to_string(dive.path("dive.toml")).unwrap();
    dive.write("dive.toml", &text.replace("quality = \"low\"", "quality = \"medium\""));
    let changed = stages(dive.ok(&["status"]));
    assert_eq!(&changed[4..], ["orient done", "densify stale", "surface stale", "evaluate stale", "report stale"]);
}

/// The second feature method goes the whole way to oriented images, and loops are looked for with its descriptors.
#[test]
fn harris_corners_orient_a_dive() {
    let mut options = DiveOptions::small(8, 480, 300);
    options.motion.arc_deg = 40.0;
    let (dive, rendered) = Dive::rendered(&options);
    let baseline = rendered.scene.cameras[1].cam_from_rig.centre().norm();
    let cameras = "[[camera]]\nimages = \"frames/C1\"\n[[camera]]\nimages = \"frames/C2\"\n";
    let rig = format!("[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = {baseline}\n");
    let rest = "[features]\nmethod = \"harris-ncc\"\n[matching]\npairs = \"sequential\"\noverlap = 3\n";
    dive.write("dive.toml", &format!("{cameras}{rig}{rest}"));
    let printed: Value = serde_json::from_str(&dive.ok(&["run", "--until", "orient", "--json"])).unwrap();
    assert_eq!(printed["images"]["oriented"], 16, "{printed:#}");
    assert_eq!(printed["scale"], "metric");
    assert!(printed["reprojection_rms_px"].as_f64().unwrap() < 1.0);
    // Another method is other features and matches, not what lies there.
    dive.write("dive.toml", &format!("{cameras}{rig}{}", rest.replace("harris-ncc", "sift")));
    let status = dive.ok(&["status", "--json"]);
    assert!(status.contains("stale"), "{status}");
    let sift: Value = serde_json::from_str(&dive.ok(&["run", "--until", "matching", "--json"])).unwrap();
    assert_ne!(sift["features"]["keypoints"], printed["features"]["keypoints"]);
}
