//! What is known of a synthetic dive, as files.

use super::folder::Folder;
use anyhow::{Context, Result};
use nalgebra::Vector3;
use scene::format::{write_colmap_binary, write_ply_mesh};
use scene::{ImageId, Mesh, Raster};
use std::fmt::Write;
use synthetic::dive::{DiveCamera, DiveScene, PortKind, SeenFaces};
use synthetic::world::{Art, Label, Mover};

/// Steps of a metre in a depth image: a quarter of a millimetre, up to 16.38 m.
const DEPTH_SCALE: f32 = 4000.0;
/// Frames that must show a face for it to count as seen.
const SEEN_BY: u8 = 2;

/// Depth in quarters of a millimetre; 0 for water, the largest value for what is further than that.
pub(super) fn encode_depth(depth: &Raster<f32>) -> Raster<u16> {
    depth.map(|&d| (d * DEPTH_SCALE).round().clamp(0.0, f32::from(u16::MAX)) as u16)
}

/// Writes everything below `truth` but what belongs to a single frame.
pub(super) fn write_truth(folder: &Folder, dive: &DiveScene, mesh: &Mesh, seen: &SeenFaces) -> Result<()> {
    for (name, mesh) in [("mesh", mesh), ("seen", &seen.mesh(mesh, SEEN_BY))] {
        let mut bytes = Vec::new();
        write_ply_mesh(mesh, &mut bytes)?;
        folder.write(&format!("truth/{name}.ply"), &bytes)?;
    }
    let truth = dive.truth(dive.options.frame_extension());
    let sparse = folder.path("truth/sparse");
    write_colmap_binary(&truth, &sparse).with_context(|| sparse.display().to_string())?;
    let mut positions = String::from("# image x y z: projection centres in the frame of mesh.ply, metres\n");
    for (i, image) in truth.images.iter().enumerate() {
        let pose = truth.cam_from_world(ImageId::new(i)).context("every frame of a synthetic dive has a pose")?;
        let centre = pose.centre();
        let _ = writeln!(positions, "{} {:.6} {:.6} {:.6}", image.name, centre.x, centre.y, centre.z);
    }
    folder.write("truth/positions.txt", positions.as_bytes())?;
    folder.write("truth/frames.csv", frames(dive).as_bytes())?;
    folder.write("truth/bars.csv", bars(dive).as_bytes())?;
    folder.write("truth/optics.toml", optics(dive).as_bytes())?;
    folder.write("truth/labels.txt", labels().as_bytes())?;
    let scene = toml::to_string(&dive.options).context("the options of a dive can be written down")?;
    folder.write("truth/scene.toml", scene.as_bytes())?;
    Ok(())
}

fn labels() -> String {
    Label::ALL.iter().map(|&label| format!("{} {}\n", label as u8, label.name())).collect()
}

/// Times of the exposures and the water about the rig.
fn frames(dive: &DiveScene) -> String {
    let mut text = String::from("frame,time_s,depth_m,refractive_index\n");
    for exposure in 0..dive.exposures() {
        let depth = dive.options.water.depth_m - dive.rig_from_world(exposure).centre().z;
        let time = dive.motion.frame_time_s(exposure);
        let _ = writeln!(text, "{exposure:04},{time:.3},{depth:.4},{:.7}", dive.refractive_index(exposure));
    }
    text
}

/// Ends of the scale bars; those of the bar that the other vehicle carries at each exposure.
fn bars(dive: &DiveScene) -> String {
    let mut text = String::from("name,frame,length_m,x1_m,y1_m,z1_m,x2_m,y2_m,z2_m\n");
    let mut row = |name: &str, frame: &str, [a, b]: [Vector3<f64>; 2]| {
        let length = (a - b).norm();
        let _ = writeln!(text, "{name},{frame},{length:.6},{:.6},{:.6},{:.6},{:.6},{:.6},{:.6}", a.x, a.y, a.z, b.x, b.y, b.z);
    };
    for bar in &dive.world.bars {
        row(bar.name, "", bar.ends);
    }
    let carried = dive.world.panels.iter().find_map(|panel| match &panel.art {
        Art::Rings { centres, .. } if centres.len() == 2 => {
            Some([0, 1].map(|k| panel.origin + panel.u * centres[k][0] + panel.v * centres[k][1]))
        }
        _ => None,
    });
    let vehicle = dive.world.movers.iter().find_map(|mover| match mover {
        Mover::Body { parts, way } if parts.iter().any(|p| p.label == Label::Vehicle) => Some(way),
        _ => None,
    });
    if let (Some(ends), Some(way)) = (carried, vehicle) {
        for exposure in 0..dive.exposures() {
            let pose = way.world_from_body(dive.motion.frame_time_s(exposure));
            row("carried bar", &format!("{exposure:04}"), ends.map(|end| pose.apply(&end)));
        }
    }
    text
}

/// Lens, window and what a calibration in the water makes of them.
fn optics(dive: &DiveScene) -> String {
    let mut text = String::from(
        "# Interior orientation of each camera: in air, behind its window, and as one Brown model calibrated in the water at the distance\n\
         # of the survey. Pixels and metres; normals point into the water. truth/frames.csv has the refractive index of each exposure.\n",
    );
    for (c, camera) in dive.cameras.iter().enumerate() {
        let _ = writeln!(text, "\n[C{}]\nin_air = {}", c + 1, brown(&camera.in_air));
        let _ = writeln!(text, "calibrated = {}", brown(&camera.calibrated.camera));
        let _ = writeln!(text, "calibrated_rms_px = {:.4}\ncalibrated_max_px = {:.4}", camera.calibrated.rms_px, camera.calibrated.max_px);
        if let Some(window) = window(dive, camera) {
            let _ = writeln!(text, "port = {window}");
        }
    }
    text
}

/// A camera as an inline table of dive.toml.
pub(super) fn brown(camera: &scene::Camera) -> String {
    let values = camera.model().param_names().iter().zip(camera.params());
    let keys: Vec<String> = values.map(|(name, value)| format!("{name} = {value:.8}")).collect();
    format!("{{ model = \"{}\", {} }}", camera.model().name(), keys.join(", "))
}

/// The window of a camera as an inline table of dive.toml, if it has one.
pub(super) fn window(dive: &DiveScene, camera: &DiveCamera) -> Option<String> {
    let w = camera.window(dive.refractive_index(0)).filter(|_| dive.options.rig.port.kind == PortKind::Flat)?;
    Some(format!(
        "{{ normal = [{:.8}, {:.8}, {:.8}], distance_m = {}, thickness_m = {}, index_air = {}, index_port = {}, index_water = {:.7} }}",
        w.normal.x, w.normal.y, w.normal.z, w.distance_m, w.thickness_m, w.indices[0], w.indices[1], w.indices[2]
    ))
}
