//! Messages as a user sees them, and what the defaults resolve to.

use super::*;
use std::path::Path;

/// A folder with two cameras of one image each and a video.
fn dive_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for camera in ["left", "right"] {
        std::fs::create_dir_all(folder.path().join("frames").join(camera)).unwrap();
        std::fs::write(folder.path().join("frames").join(camera).join("1.jpg"), "x").unwrap();
    }
    std::fs::write(folder.path().join("dive.mp4"), "x").unwrap();
    folder
}

const TWO: &str = "[[camera]]\nname = \"C1\"\nimages = \"frames/left\"\n[[camera]]\nname = \"C2\"\nimages = \"frames/right/*.jpg\"\n";

/// The messages for a text appended to two good cameras, paths without the folder.
fn messages(text: &str) -> String {
    messages_of(&format!("{TWO}{text}"))
}

fn messages_of(text: &str) -> String {
    let folder = dive_folder();
    let error = parse(&folder.path().join("dive.toml"), text).unwrap_err();
    error.to_string().replace(&format!("{}/", folder.path().display()), "")
}

fn resolved(text: &str) -> Config {
    let folder = dive_folder();
    parse(&folder.path().join("dive.toml"), &format!("{TWO}{text}")).unwrap()
}

/// The message of each kind of mistake, word by word; line 7 is the first after the two cameras.
#[test]
fn mistakes_name_file_line_key_and_hint() {
    let cases: &[(&str, &str)] = &[
        ("[mask]\nstratgy = \"ip\"", "dive.toml:8:1: mask.stratgy: unknown key\n  hint: did you mean `strategy`?"),
        ("[dive]\nlength_m = 3", "dive.toml:8:1: dive.length_m: unknown key\n  hint: `length_m` belongs to [rig.baseline]"),
        ("[dive]\nzzzzzzz = 3", "dive.toml:8:1: dive.zzzzzzz: unknown key\n  hint: known here: name, output, frames_from"),
        ("[matchin]", "dive.toml:7:2: matchin: unknown key\n  hint: did you mean `matching`?"),
        ("[mask]\nstrategy = \"ipp\"", "dive.toml:8:12: mask.strategy: \"ipp\" is not known\n  hint: did you mean \"ip\"?"),
        (
            "[features]\nmax_keypoints = \"many\"",
            "dive.toml:8:17: features.max_keypoints: invalid type: string \"many\", expected u32\n  hint: `features.max_keypoints` takes a whole number above 0",
        ),
        (
            "[features]\nmax_keypoints = -5",
            "dive.toml:8:17: features.max_keypoints: invalid value: integer `-5`, expected u32\n  hint: `features.max_keypoints` takes a whole number above 0",
        ),
        ("[features]\nmax_keypoints = 0", "dive.toml:8:17: features.max_keypoints: must be from 100 to 100000, is 0"),
        (
            "[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = -0.3",
            "dive.toml:9:12: rig.baseline.length_m: must be above 0, is -0.3",
        ),
        (
            "[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = nan",
            "dive.toml:9:12: rig.baseline.length_m: must be a finite number, is NaN",
        ),
        (
            "[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = 0.3\nsigma_m = 0",
            "dive.toml:10:11: rig.baseline.sigma_m: must be above 0, is 0",
        ),
        (
            "[[rig.baseline]]\nbetween = [\"C1\", \"C3\"]\nlength_m = 0.3",
            "dive.toml:8:18: rig.baseline.between: there is no camera \"C3\"\n  hint: did you mean \"C1\"?",
        ),
        (
            "[[rig.baseline]]\nbetween = [\"C1\", \"C1\"]\nlength_m = 0.3",
            "dive.toml:8:11: rig.baseline.between: names the same camera twice",
        ),
        ("[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]", "dive.toml:7:1: rig.baseline.length_m: is missing"),
        (
            "[rig.pose.C2]\nquaternion_wxyz = [1, 1, 0, 0]\ntranslation_m = [0.3, 0, 0]",
            "dive.toml:8:19: rig.pose.C2.quaternion_wxyz: its length is 1.4142, it must be 1",
        ),
        ("[rig.pose.C2]\ntranslation_m = [0.3, 0]", "dive.toml:8:17: rig.pose.C2.translation_m: needs 3 numbers, has 2"),
        (
            "[rig]\nmode = \"baselines\"",
            "dive.toml:8:8: rig.mode: there is no baseline\n  hint: add [[rig.baseline]] with between, length_m and sigma_m",
        ),
        (
            "[scale_bar]\nlength_m = 1",
            "dive.toml:7:1: scale_bar: invalid type: map, expected a sequence\n  hint: write [[scale_bar]] in double brackets: there can be several",
        ),
        ("[evaluate]\nreference = \"no.ply\"", "dive.toml:8:13: evaluate.reference: there is no file no.ply"),
        ("[dive]\nname = \"a", "dive.toml:8:10: invalid basic string, expected `\"`"),
        (
            "[mask]\nstrategy = \"files\"",
            "dive.toml:8:12: mask.strategy: no camera names its mask files\n  hint: add `mask = \"masks/{stem}.png\"` to a [[camera]]",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(&messages(text), expected, "for\n{text}");
    }
}

#[test]
fn mistakes_of_cameras() {
    let camera = |lines: &str| messages_of(&format!("[[camera]]\n{lines}"));
    assert_eq!(
        messages_of(""),
        "dive.toml: camera: no camera is given\n  hint: add a [[camera]] with `images = \"folder\"`, or let `sfm init FOLDER` write one"
    );
    assert_eq!(
        camera("images = \"frames/lefd\""),
        "dive.toml:2:10: camera.images: no image at frames/lefd\n  hint: there is no \"lefd\" in frames; did you mean \"left\"?"
    );
    assert_eq!(camera("images = \"frames/left/*.png\""), "dive.toml:2:10: camera.images: no image at frames/left/*.png");
    assert_eq!(camera("name = \"C1\""), "dive.toml:1:1: camera.images: is missing\n  hint: give `images` or `video`");
    assert_eq!(camera("video = \"dive.mp4\"\nrate_hz = 0"), "dive.toml:3:11: camera.rate_hz: must be above 0, is 0");
    assert_eq!(
        camera("images = \"frames/left\"\ninterior = { model = \"pinhole\", fx = 0.0, fy = 900.0 }"),
        "dive.toml:3:38: camera.interior.fx: must be above 0, is 0"
    );
    assert_eq!(
        camera("images = \"frames/left\"\n[camera.interior]\nmodel = \"radial\"\nfx = 900.0\nf = 900"),
        "dive.toml:5:6: camera.interior.fx: model \"radial\" has no such parameter\n  hint: its parameters are f, cx, cy, k1, k2"
    );
    assert_eq!(
        camera("images = \"frames/left\"\n[camera.interior]\nmodel = \"radial\"\nk1 = 0.1"),
        "dive.toml:3:1: camera.interior.f: is missing beside the other parameters\n  hint: give it in pixels, or leave all parameters out to start from EXIF or a guess"
    );
    assert_eq!(
        camera("name = \"a/b\"\nimages = \"frames/left\""),
        "dive.toml:2:8: camera.name: \"a/b\" cannot name a camera\n  hint: letters, digits, '-', '_' and '.', not starting with '.': it names folders"
    );
    assert_eq!(messages("[[camera]]\nname = \"C1\"\nimages = \"frames/left\""), "dive.toml:8:8: camera.name: there are two cameras \"C1\"");
}

#[test]
fn all_mistakes_are_told_at_once() {
    let text = "[dive]\nframes_from = \"time\"\n[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = inf\n";
    let lines: Vec<String> = messages(text).lines().filter_map(|l| l.strip_prefix("dive.toml:").map(str::to_owned)).collect();
    assert_eq!(lines.len(), 2);
    assert!(lines[0].starts_with("8:15: dive.frames_from") && lines[1].starts_with("11:12: rig.baseline.length_m"), "{lines:?}");
}

#[test]
fn a_calibration_file_has_its_own_lines() {
    let folder = dive_folder();
    std::fs::write(folder.path().join("c1.toml"), "model = \"pinhole\"\nfx = 900\nfy = -1\n").unwrap();
    let text = format!("{TWO}interior.file = \"c1.toml\"\n");
    let error = parse(&folder.path().join("dive.toml"), &text).unwrap_err();
    assert!(error.to_string().ends_with("c1.toml:3:6: camera.interior.fy: must be above 0, is -1"), "{error}");
    std::fs::write(folder.path().join("c1.toml"), "model = \"pinhole\"\nfx = 900\nfy = 901\nfixed = true\n").unwrap();
    let config = parse(&folder.path().join("dive.toml"), &text).unwrap();
    let interior = &config.cameras[1].interior;
    assert_eq!((interior.params.as_slice(), interior.fixed), ([Some(900.0), Some(901.0), None, None].as_slice(), true));
}

#[test]
fn defaults() {
    let config = resolved("");
    assert_eq!((config.name.as_str(), config.frames_from), ("dive", FramesFrom::Order));
    assert_eq!(config.output.file_name().unwrap(), "out");
    assert_eq!((config.rig.mode, config.mask.strategy), (RigMode::None, MaskStrategy::None));
    assert_eq!((config.features.method, config.matching.min_correlation), (FeatureMethod::Sift, 0.8));
    assert_eq!((config.features.max_keypoints, config.features.double_up_to_mpx), (8192, 2.1));
    // As docs/dive-toml.md states them; they come from the packages.
    assert_eq!((config.matching.ratio, config.matching.max_error_px, config.matching.min_inliers), (0.8, 4.0, 15));
    assert_eq!(config.orient.mapper, Mapper::Auto);
    assert_eq!((config.orient.initial_min_inliers, config.orient.initial_min_angle_deg, config.orient.min_angle_deg), (100, 16.0, 1.5));
    assert_eq!((config.orient.register_max_error_px, config.orient.register_min_inliers, config.orient.max_error_px), (12.0, 30, 2.0));
    assert_eq!((config.densify.max_views, config.densify.min_views), (5, 3));
    let ImageSource::Files(files) = &config.cameras[0].images else { panic!("a folder gives files") };
    assert!(files[0].ends_with(Path::new("frames/left/1.jpg")));
}

#[test]
fn the_rig_mode_follows_from_what_is_known() {
    let baseline = "[[rig.baseline]]\nbetween = [\"C2\", \"C1\"]\nlength_m = 0.3\n";
    let pose = "[rig.pose.C2]\naxis_angle_deg = [0, 90, 0]\ntranslation_m = [0, 0, -0.3]\n";
    assert_eq!(resolved(baseline).rig.mode, RigMode::Baselines);
    assert_eq!(resolved(baseline).rig.baselines[0].cameras, (0, 1));
    assert_eq!(resolved(&format!("{baseline}{pose}")).rig.mode, RigMode::Rigid);
    assert_eq!(resolved("[rig]\nmode = \"rigid\"\n").rig.mode, RigMode::Rigid);
    assert!(resolved("[rig]\nmode = \"rigid\"\n").rig.poses.is_empty());
}

#[test]
fn parameters_are_fixed_and_weighed_one_by_one() {
    let interior = |text: &str| {
        resolved(&format!("[[camera]]\nname = \"C3\"\nimages = \"frames/left\"\ninterior = {{ {text} }}\n")).cameras[2].interior.clone()
    };
    let some = interior("model = \"radial\", f = 900.0, cx = 30.0, fixed = [\"k2\"], sigma = { f = 2.0, cx = 1.5 }");
    assert_eq!((some.fixed, some.held.as_slice()), (false, [false, false, false, false, true].as_slice()));
    assert_eq!(some.sigmas, [Some(2.0), Some(1.5), None, None, None]);
    let all = interior("model = \"radial\", f = 900.0, fixed = true");
    assert_eq!((all.fixed, all.held.len(), all.sigmas.len()), (true, 0, 0));
    for (text, message) in [
        (
            "model = \"radial\", f = 900.0, fixed = [\"k3\"]",
            "camera.interior.fixed: model \"radial\" has no parameter k3\n  hint: its parameters are f, cx, cy, k1, k2",
        ),
        (
            "model = \"radial\", f = 900.0, sigma = { k1 = 0.1 }",
            "camera.interior.sigma.k1: there is no such value\n  hint: give k1 beside it, of model \"radial\"",
        ),
        ("model = \"radial\", f = 900.0, sigma = { f = 0.0 }", "camera.interior.sigma.f: must be above 0, is 0"),
        ("model = \"radial\", f = 900.0, fixed = 3", "expected true, false or a list of names of parameters"),
    ] {
        let found = messages(&format!("[[camera]]\nname = \"C3\"\nimages = \"frames/left\"\ninterior = {{ {text} }}\n"));
        assert!(found.contains(message), "{found}");
    }
}

#[test]
fn ports_are_read_and_impossible_ones_refused() {
    let of = |text: &str| format!("[[camera]]\nname = \"C3\"\nimages = \"frames/left\"\ninterior = {{ {text} }}\n");
    let lens = "model = \"pinhole\", fx = 900.0, fy = 900.0";
    let config = resolved(&of(&format!("{lens}, port = {{ distance_m = 0.03, thickness_m = 0.008 }}")));
    let port = config.cameras[2].interior.port.expect("given");
    assert_eq!(port.values(), [0.0, 0.0, 1.0, 0.03, 0.008, 1.0, 1.49, 1.34, 3.0]);
    for (text, message) in [
        (format!("{lens}, port = {{ distance_m = 0.03 }}"), "camera.interior.port.thickness_m: is missing\n  hint: give it in metres"),
        (
            format!("{lens}, port = {{ distance_m = 0.03, thickness_m = 8.4, object_distance_m = 3.0 }}"),
            "camera.interior.port: the object distance of a flat port cannot be 3: it lies beyond the window",
        ),
        (format!("{lens}, port = {{ distance_m = 0.03, thickness_m = 0.008, normal = [0, 0, 0] }}"), "has no direction"),
        (format!("{lens}, port = {{ distance_m = 0.03, thickness_m = 0.008, normal = [0, 0, -1] }}"), "it points towards the water"),
        ("model = \"pinhole\", port = { distance_m = 0.03, thickness_m = 0.008 }".to_owned(), "the parameters of the lens are missing"),
    ] {
        let found = messages(&of(&text));
        assert!(found.contains(message), "{found}");
    }
}

/// The same rotation three ways: 90 degrees about y maps z to x.
#[test]
fn rotations_agree_in_every_form() {
    let forms = [
        "axis_angle_deg = [0, 90, 0]",
        "quaternion_wxyz = [0.70710678118654752, 0, 0.70710678118654752, 0]",
        "matrix = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]",
    ];
    for form in forms {
        let config = resolved(&format!("[rig.pose.C2]\n{form}\ntranslation_m = [0, 0, 0]\n"));
        let rotated = config.rig.poses[1].unwrap().cam_from_rig.apply(&nalgebra::Vector3::z());
        assert!((rotated - nalgebra::Vector3::x()).norm() < 1e-12, "{form}: {rotated}");
    }
}

/// A rig given with respect to something else is the same rig with respect to its first camera.
#[test]
fn poses_are_rebased_on_the_first_camera() {
    let config = resolved(
        "[rig.pose.C1]\naxis_angle_deg = [0, 90, 0]\ntranslation_m = [1, 2, 3]\n[rig.pose.C2]\naxis_angle_deg = [0, 90, 0]\ntranslation_m = [1.5, 2, 3]\n",
    );
    let [Some(first), Some(second)] = config.rig.poses[..] else { panic!("two poses") };
    assert_eq!(first.cam_from_rig, scene::Rigid3::identity());
    assert!((second.cam_from_rig.translation - nalgebra::Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-12);
    assert!(second.cam_from_rig.rotation.angle() < 1e-12);
}
