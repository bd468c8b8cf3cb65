use super::*;
use crate::*;
use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;

fn pose(w: [f64; 3], t: [f64; 3]) -> Rigid3 {
    Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::from(w)), Vector3::from(t))
}

/// A rig of two cameras and a camera of its own; frame 1 is not oriented. Every point projects near the keypoints that
/// show it, so that COLMAP computes the errors stored here.
fn sample() -> Reconstruction {
    let camera = |model, params: &[f64]| Camera::new(model, 640, 480, params).expect("valid");
    let cameras = vec![
        camera(CameraModel::Radial, &[500.0, 321.0, 239.0, -0.1, 0.02]),
        camera(CameraModel::Brown, &[510.0, 318.0, 241.0, -0.08, 0.01, 0.002, 0.001, -0.002, 0.0, 0.0]),
        camera(CameraModel::Fisheye, &[400.0, 401.0, 320.0, 240.0, 0.03, -0.01, 0.004, -0.001]),
    ];
    let right = RigSensor { camera: CameraId(1), cam_from_rig: pose([0.01, -0.05, 0.002], [-0.4, 0.01, 0.02]) };
    let rigs =
        vec![Rig { sensors: vec![RigSensor { camera: CameraId(0), cam_from_rig: Rigid3::identity() }, right] }, Rig::single(CameraId(2))];
    let poses = [
        Some((0, pose([0.1, 0.2, -0.1], [0.3, -0.2, 4.0]))),
        None,
        Some((0, pose([0.0, -0.2, 0.1], [-0.5, 0.1, 4.2]))),
        Some((1, pose([0.05, 0.1, 0.3], [0.1, 0.1, 3.0]))),
    ];
    let frames: Vec<_> = poses
        .iter()
        .enumerate()
        .map(|(i, p)| Frame { rig: RigId(p.map_or(0, |p| p.0)), exposure: i as u32, rig_from_world: p.map(|p| p.1) })
        .collect();
    let mut images = Vec::new();
    for (f, frame) in frames.iter().enumerate() {
        for sensor in &rigs[frame.rig.index()].sensors {
            images.push(Image { name: format!("c{}/{f:03}.jpg", sensor.camera), camera: sensor.camera, frame: FrameId::new(f) });
        }
    }
    let mut out = Reconstruction {
        cameras,
        rigs,
        frames,
        keypoints: vec![Vec::new(); images.len()],
        images,
        points: Vec::new(),
        scale: Scale::Arbitrary,
    };
    for i in 0..12 {
        let t = f64::from(i);
        let xyz = Vector3::new((1.7 * t).sin(), (2.3 * t).cos(), 0.3 * (0.7 * t).sin());
        let mut point = Point { xyz, colour: [i as u8, 200, 3], error_px: 0.0, track: Vec::new() };
        let mut errors = Vec::new();
        for image in out.oriented_images().collect::<Vec<_>>() {
            let list = &mut out.keypoints[image.index()];
            list.push([1.5, 2.25 + i as f32]);
            let observation = Observation { image, keypoint: KeypointIndex::new(list.len()) };
            list.push([0.0, 0.0]);
            let camera = &out.cameras[out.images[image.index()].camera.index()];
            let cam_from_world = out.cam_from_world(image).expect("oriented");
            let pixel = camera.project(&cam_from_world.apply(&xyz)).expect("in front");
            out.keypoints[image.index()][observation.keypoint.index()] = [(pixel.x + (3.1 * t).sin()) as f32, (pixel.y + 0.5) as f32];
            errors.push(out.reprojection_error(&xyz, observation).expect("in front"));
            point.track.push(observation);
        }
        point.error_px = errors.iter().sum::<f64>() / errors.len() as f64;
        out.points.push(point);
    }
    out
}

fn files(model: &ColmapModel) -> [Vec<u8>; 5] {
    let mut out: [Vec<u8>; 5] = Default::default();
    let [cameras, rigs, frames, images, points] = &mut out;
    model.write_cameras_binary(cameras).expect("memory");
    model.write_rigs_binary(rigs).expect("memory");
    model.write_frames_binary(frames).expect("memory");
    model.write_images_binary(images).expect("memory");
    model.write_points_binary(points).expect("memory");
    out
}

fn read([cameras, rigs, frames, images, points]: &[Vec<u8>; 5]) -> Result<Reconstruction, FormatError> {
    read_colmap(&ColmapFiles { cameras, rigs_and_frames: Some((rigs, frames)), images, points })
}

#[test]
fn layout_is_colmaps() {
    // Written out by hand from the layout of COLMAP 3.12.
    let mut scene = sample();
    scene.cameras.truncate(1);
    scene.rigs = vec![Rig::single(CameraId(0))];
    scene.frames.truncate(1);
    scene.images.truncate(1);
    scene.images[0].name = "a".into();
    scene.keypoints = vec![vec![[1.5, 2.0], [4.0, 8.0]]];
    scene.points = vec![Point {
        xyz: Vector3::new(1.0, 2.0, 3.0),
        colour: [1, 2, 3],
        error_px: 0.5,
        track: vec![Observation { image: ImageId(0), keypoint: KeypointIndex(1) }],
    }];
    scene.frames[0].rig_from_world = Some(Rigid3::new(UnitQuaternion::identity(), Vector3::new(7.0, 8.0, 9.0)));
    let [cameras, rigs, frames, images, points] = files(&ColmapModel::new(&scene).expect("valid"));
    let f64s = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let one: &[u8] = &[1, 0, 0, 0, 0, 0, 0, 0];
    let pose = f64s(&[1.0, 0.0, 0.0, 0.0, 7.0, 8.0, 9.0]);
    let size: &[u8] = &[128, 2, 0, 0, 0, 0, 0, 0, 224, 1, 0, 0, 0, 0, 0, 0];
    assert_eq!(cameras, [one, &[1, 0, 0, 0, 3, 0, 0, 0], size, &f64s(&[500.0, 321.0, 239.0, -0.1, 0.02])].concat());
    assert_eq!(rigs, [one, &[1, 0, 0, 0, 1, 0, 0, 0], &[0, 0, 0, 0, 1, 0, 0, 0]].concat());
    assert_eq!(frames, [one, &[1, 0, 0, 0, 1, 0, 0, 0], &pose, &[1, 0, 0, 0], &[0, 0, 0, 0, 1, 0, 0, 0], one].concat());
    let keypoints = [&[2, 0, 0, 0, 0, 0, 0, 0], f64s(&[1.5, 2.0]).as_slice(), &[255; 8], &f64s(&[4.0, 8.0]), one].concat();
    assert_eq!(images, [one, &[1, 0, 0, 0], &pose, &[1, 0, 0, 0], b"a\0", &keypoints].concat());
    assert_eq!(points, [one, one, &f64s(&[1.0, 2.0, 3.0]), &[1, 2, 3], &f64s(&[0.5]), one, &[1, 0, 0, 0, 1, 0, 0, 0]].concat());
}

#[test]
fn reading_gives_back_what_was_oriented() {
    let scene = sample();
    let bytes = files(&ColmapModel::new(&scene).expect("valid"));
    let found = read(&bytes).expect("our own bytes");
    assert_eq!((&found.cameras, &found.rigs, found.points.len()), (&scene.cameras, &scene.rigs, scene.points.len()));
    let kept: Vec<_> = scene.oriented_images().collect();
    assert_eq!(found.images.len(), kept.len());
    for (i, &id) in kept.iter().enumerate() {
        assert_eq!(found.images[i].name, scene.images[id.index()].name);
        assert_eq!(found.keypoints[i], scene.keypoints[id.index()]);
        assert_eq!(found.cam_from_world(ImageId::new(i)), scene.cam_from_world(id));
    }
    for (a, b) in found.points.iter().zip(&scene.points) {
        assert_eq!((a.xyz, a.colour, a.error_px), (b.xyz, b.colour, b.error_px));
        let pixels = |r: &Reconstruction, p: &Point| p.track.iter().map(|&o| r.pixel(o)).collect::<Vec<_>>();
        assert_eq!(pixels(&found, a), pixels(&scene, b));
    }
    let again = files(&ColmapModel::new(&found).expect("valid"));
    assert_eq!(again, files(&ColmapModel::new(&read(&again).expect("our own bytes")).expect("valid")));
}

#[test]
fn models_without_rigs_are_read_image_by_image() {
    let scene = sample();
    let [cameras, _, _, images, points] = &files(&ColmapModel::new(&scene).expect("valid"));
    let found = read_colmap(&ColmapFiles { cameras, rigs_and_frames: None, images, points }).expect("legacy model");
    assert_eq!(found.frames.len(), found.images.len());
    for (i, id) in scene.oriented_images().enumerate() {
        assert_eq!(found.cam_from_world(ImageId::new(i)), scene.cam_from_world(id));
    }
}

#[test]
fn observations_outside_the_oriented_part_are_left_out() {
    let mut scene = sample();
    let lost = scene.images.iter().position(|i| i.frame == FrameId(1)).expect("frame 1 has images");
    scene.keypoints[lost].push([3.0, 4.0]);
    let observation = Observation { image: ImageId::new(lost), keypoint: KeypointIndex(0) };
    let alone = Point { track: vec![observation], ..scene.points[0].clone() };
    scene.points.push(alone);
    let found = read(&files(&ColmapModel::new(&scene).expect("valid"))).expect("our own bytes");
    assert_eq!(found.points.len(), scene.points.len() - 1);
}

#[test]
fn what_colmap_cannot_hold_is_refused() {
    type Damage = fn(&mut Reconstruction);
    let damages: [Damage; 7] = [
        |s| s.cameras[1].params_mut()[9] = 1e-3,
        |s| s.points[0].track[0].image = ImageId(99),
        |s| s.points[0].track[0].keypoint = KeypointIndex(99),
        |s| s.points[1].track[0] = s.points[0].track[0],
        |s| s.points[0].xyz.x = f64::NAN,
        |s| s.images[0].name = "a\0b".into(),
        |s| s.frames[0].rig = RigId(1),
    ];
    for (i, damage) in damages.into_iter().enumerate() {
        let mut scene = sample();
        damage(&mut scene);
        assert!(matches!(ColmapModel::new(&scene), Err(FormatError::NotRepresentable { .. })), "damage {i}");
    }
}

#[test]
fn affinity_is_kept_to_its_stated_error() {
    let c1 = 4e-4;
    let ours = Camera::new(CameraModel::Brown, 640, 480, &[500.0, 320.0, 240.0, -0.2, 0.05, 0.01, 1e-3, -2e-3, c1, 0.0]).expect("valid");
    let plain = Camera::new(CameraModel::Pinhole, 640, 480, &[500.0, 500.0, 320.0, 240.0]).expect("valid");
    let (_, params) = super::camera::to_colmap(&ours).expect("no shear");
    let [fx, fy, cx, cy, k1, k2, p1, p2, k3, ..] = params.try_into().map(|p: [f64; 12]| p).expect("twelve");
    for (u, v) in [(0.6, 0.4), (-0.5, 0.3), (0.1, -0.45)] {
        // FULL_OPENCV, written from OpenCV's documentation.
        let r2: f64 = u * u + v * v;
        let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
        let x = fx * (u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)) + cx;
        let y = fy * (v * radial + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v) + cy;
        let point = Vector3::new(u, v, 1.0);
        let (exact, straight) = (ours.project(&point).expect("ok"), plain.project(&point).expect("ok"));
        let distortion = (exact - straight - nalgebra::Vector2::new(500.0 * c1 * u, 0.0)).norm();
        let difference = (exact - nalgebra::Vector2::new(x, y)).norm();
        // The bound of `to_colmap` in each axis, with a hundredth for terms of the second order in C1.
        assert!(difference <= 1.01 * c1 * distortion / 2.0, "{difference} px at {distortion} px of distortion");
    }
    let back = read(&files(
        &ColmapModel::new(&{
            let mut s = sample();
            s.cameras[1] = ours;
            s
        })
        .expect("valid"),
    ))
    .expect("our own bytes");
    for (a, b) in back.cameras[1].params().iter().zip(ours.params()) {
        assert!((a - b).abs() < 1e-12 * b.abs().max(1.0));
    }
}

proptest! {
    #[test]
    fn broken_files_give_errors(file in 0usize..5, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4), cut in any::<prop::sample::Index>(), whole in any::<bool>()) {
        let mut bytes = files(&ColmapModel::new(&sample()).expect("valid"));
        let length = bytes[file].len();
        for (at, value) in changes {
            bytes[file][at.index(length)] = value;
        }
        if !whole {
            bytes[file].truncate(cut.index(length));
            prop_assert!(read(&bytes).is_err(), "a file that ends early was taken");
        } else if let Ok(scene) = read(&bytes) {
            // What is accepted is consistent: every reference can be followed.
            prop_assert!(scene.reprojection_rms() >= 0.0 || scene.reprojection_rms().is_nan());
        }
    }
}

/// Compares with COLMAP itself where `SFM_PYCOLMAP` names a Python that has pycolmap.
#[test]
fn colmap_reads_the_same_model() {
    let Some(python) = std::env::var_os("SFM_PYCOLMAP") else {
        eprintln!("skipped: SFM_PYCOLMAP does not name a Python with pycolmap");
        return;
    };
    let scene = sample();
    for text in [false, true] {
        let dir = tempfile::tempdir().expect("temporary folder");
        if text { write_colmap_text(&scene, dir.path()) } else { write_colmap_binary(&scene, dir.path()) }.expect("valid");
        let script = "import sys, pycolmap\nr = pycolmap.Reconstruction(sys.argv[1])\nr.check() if hasattr(r, 'check') else None\n\
            print(r.num_reg_images(), r.num_reg_frames(), r.num_rigs(), r.num_points3D(), r.compute_num_observations())\n\
            print(repr(r.compute_mean_reprojection_error()))\nr.update_point_3d_errors()\nprint(repr(r.compute_mean_reprojection_error()))\n\
            print(r.rig(1).sensor_from_rig(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 2)).translation.tolist())\n\
            [print(i.name, *i.projection_center().tolist()) for _, i in sorted(r.images.items())]\nr.write_binary(sys.argv[1])";
        let output = std::process::Command::new(&python).args(["-c", script]).arg(dir.path()).output().expect("python runs");
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
        let mut lines = printed.lines();
        assert_eq!(lines.next(), Some("5 3 2 12 60"));
        for _ in 0..2 {
            let error: f64 = lines.next().expect("an error").parse().expect("a number");
            assert!((error - scene.mean_point_error()).abs() < 1e-9, "stored or recomputed: {error} against {}", scene.mean_point_error());
        }
        assert_eq!(lines.next(), Some("[-0.4, 0.01, 0.02]"));
        for image in scene.oriented_images() {
            let line: Vec<_> = lines.next().expect("an image").split(' ').collect();
            assert_eq!(line[0], scene.images[image.index()].name);
            let centre = scene.cam_from_world(image).expect("oriented").centre();
            for i in 0..3 {
                assert!((line[i + 1].parse::<f64>().expect("a number") - centre[i]).abs() < 1e-12);
            }
        }
        // COLMAP wrote the model anew: reading it gives the same poses and points.
        let back = read_colmap_binary(dir.path()).expect("COLMAP's bytes");
        assert_eq!(back.observation_count(), scene.observation_count());
        assert!((back.reprojection_rms() - scene.reprojection_rms()).abs() < 1e-9);
    }
}

/// A folder with the sample as text.
fn text_folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    write_colmap_text(&sample(), dir.path()).expect("valid");
    dir
}

#[test]
fn text_is_read_as_the_binary_form() {
    let (text, binary) = (text_folder(), tempfile::tempdir().expect("a folder"));
    write_colmap_binary(&sample(), binary.path()).expect("valid");
    let expected = read_colmap_binary(binary.path()).expect("valid");
    assert_eq!(read_colmap_text(text.path()).expect("valid"), expected);
    assert_eq!(read_colmap_model(text.path()).expect("valid"), expected);
    assert_eq!(read_colmap_model(binary.path()).expect("valid"), expected);
    // Without rigs and frames, every image by itself.
    for file in ["rigs.txt", "frames.txt"] {
        std::fs::remove_file(text.path().join(file)).expect("it is there");
    }
    let single = read_colmap_text(text.path()).expect("valid");
    assert_eq!((single.rigs.len(), single.frames.len()), (single.cameras.len(), single.images.len()));
}

/// File, what is replaced in it, by what, and the message.
#[test]
fn a_broken_line_is_named() {
    for (file, from, to, message) in [
        ("cameras.txt", " RADIAL", " MAGIC", "cameras.txt, line 3: camera model MAGIC is not supported"),
        ("cameras.txt", " 640 480", " 640 wide", "cameras.txt, line 3: HEIGHT is \"wide\", which it cannot be"),
        ("cameras.txt", " 0.02\n", "\n", "cameras.txt, line 3: ends before PARAMS"),
        ("cameras.txt", " 0.02\n", " 0.02 7\n", "cameras.txt, line 3: \"7\" is one field too many"),
        ("cameras.txt", " 0.02\n", " inf\n", "cameras.txt, line 3: camera 1:"),
        ("rigs.txt", "CAMERA 2", "IMU 2", "rigs.txt, line 3: sensors of type IMU are not supported"),
        ("frames.txt", "\n1 1 ", "\n1 9 ", "frames.txt, line 3: rig 9 does not exist"),
        ("images.txt", "c0/000.jpg\n", "c0/000.jpg\n1.5 ", "images.txt, line 5: "),
        ("points3D.txt", "\n1 ", "\nnan ", "points3D.txt, line 3: POINT3D_ID is \"nan\""),
    ] {
        let dir = text_folder();
        let path = dir.path().join(file);
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(text.contains(from), "{file} has no {from:?}:\n{text}");
        std::fs::write(&path, text.replacen(from, to, 1)).expect("written");
        let found = read_colmap_text(dir.path()).expect_err("broken").to_string();
        assert!(found.contains(message), "{found}, expected {message}");
    }
}

proptest! {
    /// Text that is cut, or has a byte replaced, is read or refused.
    #[test]
    fn damaged_text_never_panics(file in 0usize..5, at in 0.0..1.0f64, byte in "[ -~\n]", cut in any::<bool>()) {
        let dir = text_folder();
        let path = dir.path().join(["cameras.txt", "rigs.txt", "frames.txt", "images.txt", "points3D.txt"][file]);
        let mut text = std::fs::read(&path).expect("text");
        let at = (at * text.len() as f64) as usize;
        if cut { text.truncate(at) } else { text[at] = byte.as_bytes()[0] }
        std::fs::write(&path, text).expect("written");
        let _ = read_colmap_text(dir.path());
    }
}
