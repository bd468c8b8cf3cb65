//! The dive.toml of a synthetic dive.

use super::truth::{brown, window};
use nalgebra::Vector3;
use std::fmt::Write;
use synthetic::dive::{DiveScene, PICK_SIGMA_PX, Pick};
use synthetic::world::Bar;

/// Standard deviation of the given baselines, metres: as of a rig measured in a pool.
const BASELINE_SIGMA_M: f64 = 0.0005;
/// Standard deviation of a camera's rotation in the rig, degrees.
const POSE_SIGMA_DEG: f64 = 0.02;
/// Standard deviation of the bars, metres.
const BAR_SIGMA_M: f64 = 0.0005;
/// Standard deviations of the sensors: of their noise, and of what is constant in it.
const POSITION_SIGMA_M: f64 = 0.4;
const DEPTH_SIGMA_M: f64 = 0.05;
const TILT_SIGMA_DEG: f64 = 0.5;
const HEADING_SIGMA_DEG: f64 = 3.0;
/// Picks of each end of a bar.
const PICKS: usize = 12;

const HEAD: &str = "\
# Written by `sfm synth`: a rendered dive, whose truth lies beside it in truth/.
# Do it with `sfm run dive.toml`, or with the path of this file. docs/dive-toml.md explains every key.
";

pub(super) fn dive_toml(dive: &DiveScene) -> String {
    let mut text = String::from(HEAD);
    let _ = write!(
        text,
        "\n[dive]\nname = \"Synthetic dive, seed {}\"\noutput = \"out\"\nframes_from = \"stem\"  # files of the same name belong together\n",
        dive.options.seed
    );
    for (c, camera) in dive.cameras.iter().enumerate() {
        let name = format!("C{}", c + 1);
        let _ = write!(text, "\n[[camera]]\nname = \"{name}\"\nimages = \"frames/{name}\"\n");
        let _ = writeln!(text, "mask = \"truth/masks/{name}/{{stem}}.png\"  # the true masks; [mask] says that they are used");
        let port = window(dive, camera).filter(|_| dive.options.rig.port.known);
        if let Some(port) = port {
            text.push_str("# The lens in air, refined, and the window of the housing, as a calibration with the port finds them.\n");
            let lens = brown(&camera.in_air);
            let _ = writeln!(text, "interior = {}, port = {port} }}", lens.trim_end_matches(" }"));
        } else {
            text.push_str("# As a calibration in the water finds it; refined all the same. Without it a guess is the start.\n");
            let _ = writeln!(text, "interior = {}", brown(&camera.calibrated.camera));
        }
    }
    baselines(&mut text, dive);
    if looks_apart(dive) {
        mounting(&mut text, dive);
    }
    sensors(&mut text, dive);
    let count = dive.world.bars.len();
    for (i, bar) in dive.world.bars.iter().enumerate() {
        let ends = [0, 1].map(|end| picks(dive, bar, end));
        if ends.iter().any(|picks| picks.len() < 2) {
            continue;
        }
        // The last one is held out.
        let check = i + 1 == count;
        let word = if check { "held out: only compared with what is found" } else { "takes part in the adjustment" };
        let _ = write!(
            text,
            "\n# A known length in the scene, {word}. Its ends were pointed at by hand, to {PICK_SIGMA_PX} px; the targets there are measured.\n[[scale_bar]]\n"
        );
        let _ = write!(
            text,
            "name = \"{}\"\nlength_m = {:.6}\nsigma_m = {BAR_SIGMA_M}\ncheck = {check}\ntarget = \"circle\"\n",
            bar.name,
            bar.length_m()
        );
        text.push_str("endpoints = [\n");
        for end in ends {
            text.push_str("    [\n");
            for Pick { camera, exposure, pixel: [x, y], .. } in end {
                let name = DiveScene::name(camera, exposure, dive.options.frame_extension());
                let _ = writeln!(text, "        {{ image = \"{name}\", x = {x:.1}, y = {y:.1} }},");
            }
            text.push_str("    ],\n");
        }
        text.push_str("]\n");
    }
    text.push_str("\n[mask]\nstrategy = \"files\"  # the true masks named above; \"none\" leaves the water in, \"ip\" makes masks by image processing\n");
    text.push_str("\n[matching]\npairs = \"sequential\"  # neighbours in time, and places that look alike\n");
    text.push_str("\n[densify]\nquality = \"low\"  # quick; \"medium\" takes the frames as they are up to 960 pixels\n");
    text.push_str(
        "\n[evaluate]\nreference = \"truth/seen.ply\"  # the part of truth/mesh.ply that two frames or more show\n\
         positions = \"truth/positions.txt\"  # moves the model to the frame of the mesh\n",
    );
    text
}

fn baselines(text: &mut String, dive: &DiveScene) {
    let centres: Vec<Vector3<f64>> = dive.cameras.iter().map(|camera| camera.cam_from_rig.centre()).collect();
    if centres.len() > 1 {
        text.push_str("\n# Distances between the cameras make the model metric.\n");
    }
    for second in 1..centres.len() {
        for first in 0..second {
            let length_m = (centres[second] - centres[first]).norm();
            let _ = write!(
                text,
                "[[rig.baseline]]\nbetween = [\"C{}\", \"C{}\"]\nlength_m = {length_m:.5}\nsigma_m = {BASELINE_SIGMA_M}\n\n",
                first + 1,
                second + 1
            );
        }
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
}

/// What is known of the sensors: their places, and noise of the class of the instruments.
fn sensors(text: &mut String, dive: &DiveScene) {
    let s = &dive.options.sensors;
    text.push_str("\n# The log of the vehicle places the model in the world: east, north, up from the sea bed at the middle.\n[sensors]\n");
    let _ = writeln!(
        text,
        "file = \"sensors.csv\"\ninterval_secs = {}  # the frames do not tell when they were taken",
        1.0 / dive.options.motion.rate_hz
    );
    let arm = |[x, y, z]: [f64; 3]| format!("[{x}, {y}, {z}]");
    if s.position_hz > 0.0 {
        let latency = if s.ideal { 0.0 } else { s.position_latency_s };
        let _ = writeln!(
            text,
            "position_latency_secs = {latency}\nposition_sigma_m = {POSITION_SIGMA_M}\nposition_lever_m = {}",
            arm(s.transponder_m)
        );
    }
    if s.pressure_hz > 0.0 {
        let (lever, level) = (arm(s.pressure_sensor_m), dive.options.water.depth_m);
        let _ = writeln!(text, "depth_sigma_m = {DEPTH_SIGMA_M}\ndepth_lever_m = {lever}\nwater_level_m = {level}");
    }
    if s.imu_hz > 0.0 {
        let _ = writeln!(text, "tilt_sigma_deg = {TILT_SIGMA_DEG}\nheading_sigma_deg = {HEADING_SIGMA_DEG}");
    }
}

/// Whether a camera looks where the first one does not: it is oriented by its place in the rig.
fn looks_apart(dive: &DiveScene) -> bool {
    dive.cameras.iter().any(|camera| (camera.cam_from_rig.rotation.inverse() * Vector3::z()).z < 0.5)
}

/// The poses in the rig, as a calibration in a frame of targets gives them.
fn mounting(text: &mut String, dive: &DiveScene) {
    text.push_str("\n# A camera looks where the others do not: its place in the rig was calibrated in a frame of targets.\n");
    for (c, camera) in dive.cameras.iter().enumerate().skip(1) {
        let (turn, t) = (camera.cam_from_rig.rotation.scaled_axis().map(f64::to_degrees), camera.cam_from_rig.translation);
        let _ = write!(
            text,
            "[rig.pose.C{}]\naxis_angle_deg = [{:.6}, {:.6}, {:.6}]\ntranslation_m = [{:.6}, {:.6}, {:.6}]\nsigma_deg = {POSE_SIGMA_DEG}\nsigma_m = {BASELINE_SIGMA_M}\n\n",
            c + 1,
            turn.x,
            turn.y,
            turn.z,
            t.x,
            t.y,
            t.z
        );
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
}

/// A few picks of the frames that show a target largest, spread evenly over them: people pick where they see well.
fn picks(dive: &DiveScene, bar: &Bar, end: usize) -> Vec<Pick> {
    let mut all = dive.picks(bar, end);
    all.sort_by(|a, b| b.width_px.total_cmp(&a.width_px));
    all.truncate(3 * PICKS);
    all.sort_by_key(|pick| (pick.camera, pick.exposure));
    let count = all.len().min(PICKS);
    (0..count).map(|i| all[i * all.len() / count]).collect()
}
