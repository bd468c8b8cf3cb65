//! Rendered frames against what the camera models and the meshes say.

use super::*;
use crate::appearance::{Jerlov, WaterOptions};
use crate::motion::{Motion, MotionOptions};
use crate::random::Random;
use crate::world::{Art, Label, Material, Panel, Part, World, panel_mesh};
use nalgebra::Vector3;

fn tiny() -> DiveOptions {
    let mut options = DiveOptions::small(2, 96, 60);
    (options.world.detail_m, options.world.fish, options.world.vehicle) = (0.08, 3, true);
    options.water.snow_per_m3 = 20.0;
    options
}

#[test]
fn the_same_bytes_on_one_and_two_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| render_dive(&tiny()).expect("possible"))
    };
    let (one, two) = (on(1), on(2));
    for (a, b) in one.images.iter().zip(&two.images) {
        assert_eq!(a.rgb, b.rgb);
        assert_eq!((&a.mask, &a.labels, &a.faces), (&b.mask, &b.labels, &b.faces));
        assert!(a.depth.data().iter().zip(b.depth.data()).all(|(x, y)| x.to_bits() == y.to_bits()));
    }
    let other = render_dive(&DiveOptions { seed: 8, ..tiny() }).expect("possible");
    assert_ne!(one.images[0].rgb, other.images[0].rgb);
}

#[test]
fn frames_show_reef_sand_and_water_and_their_truth_agrees() {
    let dive = render_dive(&tiny()).expect("possible");
    for image in &dive.images {
        let count = |label: Label| image.labels.data().iter().filter(|&&l| l == label as u8).count();
        let pixels = image.labels.data().len();
        assert!([Label::Water, Label::Structure, Label::Sand].iter().all(|&l| count(l) * 20 > pixels), "{:?}", Label::ALL.map(count));
        let (mut stays, mut shown) = (0, 0);
        for ((label, mask), (depth, face)) in
            image.labels.data().iter().zip(image.mask.data()).zip(image.depth.data().iter().zip(image.faces.data()))
        {
            let label = Label::ALL[usize::from(*label)];
            assert!(*mask == 0 || label.is_static());
            (stays, shown) = (stays + usize::from(label.is_static()), shown + usize::from(*mask == 255));
            assert_eq!(*depth > 0.0, label != Label::Water);
            assert_eq!(*face != NO_FACE, label.is_static());
        }
        // Water of type IB hides next to nothing within the 8 m of bottom on either side.
        assert!(shown * 20 > stays * 19, "{shown} of {stays}");
        let mean = image.rgb.data().iter().map(|c| f64::from(c[1])).sum::<f64>() / pixels as f64;
        assert!((60.0..170.0).contains(&mean), "exposed to a mean grey: {mean}");
    }
}

/// A vertex of the mesh that is not hidden lies where the depth image says.
#[test]
fn mesh_vertices_lie_at_the_rendered_depth() {
    let mut options = tiny();
    options.rig.port.kind = PortKind::Flat;
    (options.world.fish, options.world.vehicle) = (0, false);
    let dive = render_dive(&options).expect("possible");
    let (image, pose) = (&dive.images[3], dive.scene.cam_from_world(1, 1));
    let mesh = dive.scene.world.mesh();
    let (mut near, mut seen) = (0, 0);
    for vertex in mesh.vertices.iter().step_by(5) {
        let Some(pixel) = dive.scene.project(&vertex.coords, 1, 1) else { continue };
        let Some(&depth) = image.depth.at_point(pixel.x, pixel.y) else { continue };
        if dive.scene.is_hidden(&vertex.coords, &pose.centre()) {
            continue;
        }
        seen += 1;
        // Within the pixel the depth changes by its size on a slope: 3 % of it at these few pixels, more at grazing views of the sand.
        near += usize::from((f64::from(depth) / pose.apply(&vertex.coords).z - 1.0).abs() < 0.03);
    }
    assert!(seen > 200 && near * 10 > seen * 8, "{near} of {seen}");
}

/// Dots at known places are seen where the camera model, with its window, projects them: to a twentieth of a pixel, over the whole frame.
#[test]
fn points_are_rendered_where_the_camera_model_projects_them() {
    let mut random = Random::new(12);
    let distance = 1.2;
    let centres: Vec<[f64; 2]> = (0..11 * 7)
        .map(|i| {
            let cell = [f64::from(i % 11), f64::from(i / 11)];
            cell.map(|c| 0.08 + 0.15 * c + random.range(-0.04, 0.04))
        })
        .collect();
    let radius_m = 0.008;
    let art = Art::Dots { radius_m, centres: centres.clone() };
    let panel = Panel { origin: Vector3::new(-0.85, 0.0, 1.55), u: Vector3::x(), v: -Vector3::z(), size_m: [1.8, 1.1], art };
    let world = World {
        parts: vec![Part::new("dots", Label::Target, Material::Panel(0), panel_mesh(&panel))],
        panels: vec![panel.clone()],
        centre: Vector3::new(0.0, 0.0, 1.0),
        ..World::default()
    };
    let mut options = DiveOptions::preset(Preset::Demo);
    (options.rig.width, options.rig.height) = (960, 600);
    options.rig.cameras.iter_mut().for_each(|c| c.port_tilt_deg = [1.5, -1.0]);
    options.water = WaterOptions { jerlov: Jerlov::I, forward_blur_rad: 0.0, snow_per_m3: 0.0, caustics: 0.0, ..options.water };
    options.lamps.power = 0.0;
    options.response = ResponseOptions { noise: 0.0, blur_px: 0.0, crosstalk: 0.0, samples: 3, ..options.response };
    options.motion = MotionOptions { frames: 1, radius_m: distance, height_m: [0.9, 0.9], ..options.motion };
    let motion = Motion::new(&options.motion, world.centre);
    let dive = DiveScene::with_world(&options, world, motion).expect("possible");
    let (mut measured, mut at_border, mut largest) = (0, 0, 0.0f64);
    for camera in 0..2 {
        let image = dive.render(camera, 0);
        for c in &centres {
            let point = panel.origin + panel.u * c[0] + panel.v * c[1];
            let Some(pixel) = dive.project(&point, camera, 0) else { continue };
            let Some(centroid) = centroid(&image, [pixel.x, pixel.y]) else { continue };
            measured += 1;
            at_border += usize::from(pixel.x < 60.0 || pixel.y < 60.0 || pixel.x > 900.0 || pixel.y > 540.0);
            largest = largest.max((pixel.x - centroid[0]).hypot(pixel.y - centroid[1]));
        }
    }
    assert!(measured > 60 && at_border > 8, "{measured}, {at_border} near the border");
    // 0.02 px of it is the perspective's own: the centre of a disc is not the centre of its image.
    assert!(largest < 0.05, "{largest} px");
}

/// Centre of gravity of the dark about a place, in linear light; `None` too near to the border.
fn centroid(image: &DiveImage, at: [f64; 2]) -> Option<[f64; 2]> {
    const WINDOW: i32 = 14;
    let light = |x: i32, y: i32| {
        let v = f64::from(image.rgb.get(usize::try_from(x).ok()?, usize::try_from(y).ok()?)?[1]) / 255.0;
        Some(if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) })
    };
    let [x0, y0] = at.map(|v| v.floor() as i32);
    let mut border = Vec::new();
    for k in -WINDOW..=WINDOW {
        border.extend([light(x0 + k, y0 - WINDOW)?, light(x0 + k, y0 + WINDOW)?, light(x0 - WINDOW, y0 + k)?, light(x0 + WINDOW, y0 + k)?]);
    }
    border.sort_by(f64::total_cmp);
    let white = border[border.len() / 2];
    let (mut sum, mut sx, mut sy) = (0.0, 0.0, 0.0);
    for y in -WINDOW..=WINDOW {
        for x in -WINDOW..=WINDOW {
            // Half of the white and less is the disc or its edge; the rest is the unevenness of the light.
            let dark = (0.85 * white - light(x0 + x, y0 + y)?).max(0.0);
            (sum, sx, sy) = (sum + dark, sx + dark * f64::from(x), sy + dark * f64::from(y));
        }
    }
    (sum > 0.0).then(|| [f64::from(x0) + 0.5 + sx / sum, f64::from(y0) + 0.5 + sy / sum])
}

#[test]
fn seen_faces_are_those_that_frames_show() {
    let dive = render_dive(&tiny()).expect("possible");
    let mesh = dive.scene.world.mesh();
    let seen = SeenFaces::new(mesh.faces.len());
    dive.images.iter().for_each(|image| seen.add(image));
    let (once, twice) = (seen.mesh(&mesh, 1), seen.mesh(&mesh, 2));
    assert!(once.faces.len() > twice.faces.len() && twice.faces.len() > 500, "{} {}", once.faces.len(), twice.faces.len());
    assert!(once.faces.len() < mesh.faces.len() / 2);
    assert!(once.faces.iter().flatten().all(|&v| (v as usize) < once.vertices.len()));
}

#[test]
fn impossible_options_are_told_by_their_key() {
    let told = |change: fn(&mut DiveOptions), key: &str| {
        let mut options = tiny();
        change(&mut options);
        let error = DiveScene::new(&options).err().unwrap_or_default();
        assert!(error.contains(key), "{key}: {error}");
    };
    told(|o| o.rig.width = 0, "rig.width");
    told(|o| o.rig.cameras.clear(), "rig.cameras");
    told(|o| o.rig.cameras[0].turn_deg[1] = 5.0, "turn_deg of rig.cameras[0]");
    told(|o| (o.world.bottom_half_m, o.world.detail_m) = (50.0, 0.01), "world.bottom_half_m");
    told(|o| o.sensors.transponder_m[2] = f64::NAN, "sensors.transponder_m");
    told(|o| o.rig.cameras[1].focal_mm = f64::NAN, "focal_mm of rig.cameras[1]");
    told(|o| o.rig.cameras[0].radial = [-0.3, -0.3], "distortion");
    told(|o| o.world.detail_m = 0.0, "world.detail_m");
    told(|o| o.motion.frames = 0, "motion.frames");
    told(|o| (o.motion.kind, o.motion.length_m, o.motion.spacing_m) = (crate::motion::MotionKind::Lanes, 0.0, 0.0), "motion.length_m");
    told(|o| o.water.snow_per_m3 = -1.0, "water.snow_per_m3");
    told(|o| o.sensors.imu_hz = f64::INFINITY, "sensors.imu_hz");
}
