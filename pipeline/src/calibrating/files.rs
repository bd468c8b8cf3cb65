//! The files that dive.toml reads.

use super::record::{CameraRecord, Record};
use crate::formats::write_calibration;
use anyhow::Result;
use std::fmt::Write;

/// Path of a camera's file in the output folder.
pub(super) fn camera_file(name: &str) -> String {
    format!("calib/{name}.toml")
}

/// A camera's file, for `interior.file`: its parameters and their standard deviations.
pub(super) fn camera_toml(camera: &CameraRecord) -> Result<String> {
    let mut text = write_calibration(&camera.camera()?, &camera.name);
    let held: Vec<String> = camera.parameters.iter().filter(|p| p.held).map(|p| format!("\"{}\"", p.name)).collect();
    if !held.is_empty() {
        let _ = writeln!(text, "fixed = [{}]", held.join(", "));
    }
    text.push_str(
        "\n# With these the parameters are refined as observations; `fixed = true` beside `file` in dive.toml keeps them.\n[sigma]\n",
    );
    for p in camera.parameters.iter().filter(|p| p.sigma > 0.0) {
        let _ = writeln!(text, "{} = {:?}", p.name, p.sigma);
    }
    Ok(text)
}

/// rig.toml, for `rig.file`: poses and baselines with their standard deviations.
pub(super) fn rig_toml(record: &Record) -> String {
    let mut text = String::from("# Rig by `sfm calibrate`: cam_from_rig of each camera, distances of projection centres.\n");
    for camera in &record.cameras {
        let pose = &camera.pose;
        let _ = writeln!(text, "\n[pose.\"{}\"]", camera.name);
        let _ = writeln!(text, "quaternion_wxyz = {:?}\ntranslation_m = {:?}", pose.quaternion_wxyz, pose.translation_m);
        if pose.covariance.is_some() {
            // One number a kind is what dive.toml takes: the largest of the three axes.
            let largest = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
            let (deg, m) = (largest(pose.sigma_rotation_deg), largest(pose.sigma_translation_m));
            let _ = writeln!(text, "sigma_deg = {deg:?}\nsigma_m = {m:?}");
        }
    }
    for b in &record.baselines {
        let (sigma, length) = (b.sigma_m, b.length_m);
        let _ = writeln!(text, "\n[[baseline]]\nbetween = {:?}\nlength_m = {length:?}\nsigma_m = {sigma:?}", b.between);
    }
    text
}
