//! Instruments and control points tie a model to the world.

use crate::support::{NOISE_PX, complete, made, noisy, oriented, rig_poses};
use mapping::{
    ControlPointInput, HeadingInput, ImagePick, MapInput, Orientation, PICK_SIGMA_PX, PositionInput, RigInput, RigMode, UpInput, WorldInput,
};
use nalgebra::Vector3;
use scene::{Reconstruction, Scale};
use synthetic::Random;
use synthetic::survey::Survey;

/// Standard deviations of the instruments.
const POSITION_M: f64 = 0.05;
const DEPTH_M: f64 = 0.01;
const TILT_RAD: f64 = 0.01;
const HEADING_RAD: f64 = 0.02;
/// Where the antenna is, seen from the first camera.
const LEVER_M: Vector3<f64> = Vector3::new(0.2, -0.4, -0.3);
/// An error is a wrong result, and not chance, when it is so many standard deviations: one in 10^5 of the 100 here is.
const FAR: f64 = 4.4;

/// The frame of a survey whose frames are all there.
fn poses(truth: &Reconstruction) -> Vec<(u32, scene::Rigid3)> {
    truth.frames.iter().map(|f| (f.exposure, f.rig_from_world.expect("true"))).collect()
}

fn noise(random: &mut Random, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * random.normal())
}

/// What instruments with their noise read; every fifth position jumps by 20 m.
fn readings(truth: &Reconstruction) -> WorldInput {
    let mut random = Random::new(7);
    let mut world = WorldInput::default();
    for (exposure, pose) in poses(truth) {
        let jump = if exposure % 5 == 4 { Vector3::new(20.0, -5.0, 0.0) } else { Vector3::zeros() };
        let xyz = pose.inverse().apply(&LEVER_M) + noise(&mut random, POSITION_M) + jump;
        let sigma_m = Vector3::new(POSITION_M, POSITION_M, f64::INFINITY);
        world.positions.push(PositionInput { exposure, in_rig: LEVER_M, xyz, sigma_m });
        let xyz = pose.centre() + noise(&mut random, DEPTH_M);
        let sigma_m = Vector3::new(f64::INFINITY, f64::INFINITY, DEPTH_M);
        world.positions.push(PositionInput { exposure, in_rig: Vector3::zeros(), xyz, sigma_m });
        let up_in_rig = pose.rotation * Vector3::z() + noise(&mut random, TILT_RAD);
        world.ups.push(UpInput { exposure, up_in_rig, sigma_rad: TILT_RAD });
        let axis = pose.rotation.inverse() * Vector3::y();
        let heading_rad = axis.x.atan2(axis.y) + HEADING_RAD * random.normal();
        world.headings.push(HeadingInput { exposure, axis_in_rig: Vector3::y(), heading_rad, sigma_rad: HEADING_RAD });
    }
    world
}

/// A point of the sea bed that was surveyed on the spot.
fn control(survey: &Survey, place: Vector3<f64>, sigma_m: f64, check: bool, random: &mut Random) -> ControlPointInput {
    let truth = &survey.truth;
    let nearest = truth.points.iter().min_by(|a, b| (a.xyz - place).norm().total_cmp(&(b.xyz - place).norm())).expect("points");
    let picks = nearest.track.iter().map(|o| {
        let camera = &truth.cameras[truth.images[o.image.index()].camera.index()];
        let pixel = camera.project(&truth.cam_from_world(o.image).expect("true").apply(&nearest.xyz)).expect("seen");
        ImagePick {
            image: o.image,
            pixel: [pixel.x + NOISE_PX * random.normal(), pixel.y + NOISE_PX * random.normal()],
            sigma_px: PICK_SIGMA_PX,
        }
    });
    ControlPointInput { picks: picks.collect(), xyz: nearest.xyz + noise(random, sigma_m), sigma_m: Vector3::repeat(sigma_m), check }
}

/// Projection centres are where they should be, without any alignment: as far off as the place of the datum, its attitude over the distance
/// from it, and the precision relative to it allow.
#[track_caller]
fn assert_in_the_world(out: &Orientation, truth: &Reconstruction) {
    let model = &out.models[0];
    assert_eq!(model.scale, Scale::Metric);
    let quality = out.summary.quality.as_ref().expect("regular");
    let world = quality.datum_in_world.expect("placed");
    let centre = |i: scene::ImageId| model.cam_from_world(i).expect("oriented").centre();
    for image in model.oriented_images() {
        let error = centre(image) - truth.cam_from_world(image).expect("true").centre();
        let sigma = quality.images[image.index()].expect("oriented").centre;
        let turned = Vector3::from(world.rotation_rad).amax() * (centre(image) - centre(quality.datum)).norm();
        for k in 0..3 {
            let sigma = sigma[k].hypot(world.centre[k]).hypot(turned);
            assert!(error[k].abs() < FAR * sigma, "image {image}, axis {k}: {} m, sigma {sigma} m", error[k]);
        }
    }
}

#[test]
fn one_camera_and_instruments_give_metres_in_the_world() {
    let (made, mut input) = made(&noisy(1));
    input.world = readings(&made.truth);
    let out = oriented(&input);
    assert_in_the_world(&out, &made.truth);
    let world = out.summary.world.expect("tied");
    let (horizontal, height) = (world.horizontal.expect("read"), world.height.expect("read"));
    assert_eq!((horizontal.readings, horizontal.outliers, height.readings, height.outliers), (12, 2, 12, 0));
    // Root mean squares of 12 to 20 residuals: within 4 standard deviations, each at most 1 / sqrt(2 n) = 0.2, below for what they fixed.
    for report in [horizontal, height, world.tilt.expect("read"), world.heading.expect("read")] {
        assert!((0.2..1.8).contains(&report.sigma0), "{report:?}");
    }
    // What the height of 12 readings is known to; scale, place and attitude take their share.
    let sigma = out.summary.quality.expect("regular").datum_in_world.expect("placed").centre;
    assert!(sigma[2] < DEPTH_M && sigma[0] < POSITION_M, "{sigma:?}");
}

#[test]
fn an_inclinometer_levels_a_rig_and_leaves_the_rest_open() {
    let (made, mut input) = made(&noisy(2));
    input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
    let all = readings(&made.truth);
    input.world.ups = all.ups;
    let out = oriented(&input);
    let (model, quality) = (&out.models[0], out.summary.quality.as_ref().expect("regular"));
    assert!(quality.datum_in_world.is_none(), "north and place are open");
    // The mean of 12 readings, 4 standard deviations, and what the images leave open between the ends of the path.
    let most = FAR * TILT_RAD / 12f64.sqrt() + 0.002;
    for image in model.oriented_images() {
        let up = |m: &Reconstruction| m.cam_from_world(image).expect("oriented").rotation * Vector3::z();
        let off = up(model).angle(&up(&made.truth));
        assert!(off < most, "{off} rad");
    }
    let world = out.summary.world.as_ref().expect("tied");
    assert!(world.horizontal.is_none() && world.heading.is_none() && world.tilt.expect("read").readings == 12);
}

#[test]
fn control_points_place_a_model_and_check_points_say_how_well() {
    let (made, mut input) = made(&noisy(1));
    let mut random = Random::new(3);
    let mut point = |x: f64, y: f64, check: bool| control(&made, Vector3::new(x, y, 0.0), 0.005, check, &mut random);
    input.world.control_points =
        vec![point(0.5, -0.8, false), point(0.5, 0.8, false), point(6.0, -0.8, false), point(6.0, 0.8, false), point(3.0, 0.0, true)];
    let out = oriented(&input);
    assert_in_the_world(&out, &made.truth);
    let world = out.summary.world.expect("tied");
    let check = world.control_points[4];
    assert!(check.check && check.error_m.expect("picked").norm() < 0.05, "{check:?}");
    assert!(check.normalised_residual.expect("picked").abs() < FAR, "{check:?}");
    assert!(world.control_points.iter().filter(|p| !p.check).count() == 4 && world.horizontal.is_none());
}

#[test]
fn a_wrong_control_point_shows_and_places_on_a_line_are_refused() {
    let (made, mut input) = made(&noisy(1));
    let mut random = Random::new(4);
    let mut point = |x: f64, y: f64| control(&made, Vector3::new(x, y, 0.0), 0.005, false, &mut random);
    input.world.control_points =
        vec![point(0.5, -0.8), point(0.5, 0.8), point(6.0, -0.8), point(6.0, 0.8), point(3.0, -0.8), point(3.0, 0.8)];
    input.world.control_points[5].xyz.x += 0.3;
    let residuals = |out: &Orientation| -> Vec<f64> {
        out.summary.world.as_ref().expect("tied").control_points.iter().map(|p| p.normalised_residual.expect("picked").abs()).collect()
    };
    let found = residuals(&oriented(&input));
    assert!(found[5] > 8.0 && found[..5].iter().all(|&w| w < found[5] / 2.0), "{found:?}");
    // Positions along the path alone: nothing holds the model from rolling about it.
    let straight = readings(&made.truth).positions.into_iter().map(|p| PositionInput {
        xyz: Vector3::new(p.xyz.x, 0.0, 3.0),
        sigma_m: Vector3::repeat(POSITION_M),
        ..p
    });
    let input = MapInput { world: WorldInput { positions: straight.collect(), ..WorldInput::default() }, ..input };
    let out = complete(&input);
    assert_eq!((out.models[0].scale, out.summary.world.is_none()), (Scale::Arbitrary, true));
    assert!(out.summary.notes.iter().any(|n| n.contains("too near a line")), "{:?}", out.summary.notes);
}
