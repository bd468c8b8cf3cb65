//! Interior orientation as the TOML file that `[camera.interior] file` reads: what one dive found can start the next.

use crate::config::read_interior;
use anyhow::{Context, Result};
use scene::Camera;
use std::fmt::Write;
use std::path::Path;

/// The file of a camera; every number is written so that it is read back to the last bit.
#[must_use]
pub fn write_calibration(camera: &Camera, camera_name: &str) -> String {
    let mut text = format!("# Interior orientation of camera {camera_name}, pixels.\nmodel = \"{}\"\n", camera.model().name());
    let _ = writeln!(text, "width = {}\nheight = {}", camera.width(), camera.height());
    for (name, value) in camera.model().param_names().iter().zip(camera.params()) {
        let _ = writeln!(text, "{name} = {value:?}");
    }
    if let Some(port) = camera.port() {
        let [x, y, z, distance, thickness, air, window, water, object] = port.values();
        let _ = writeln!(text, "\n[port]\nnormal = [{x:?}, {y:?}, {z:?}]\ndistance_m = {distance:?}\nthickness_m = {thickness:?}");
        let _ = writeln!(text, "index_air = {air:?}\nindex_port = {window:?}\nindex_water = {water:?}\nobject_distance_m = {object:?}");
    }
    text
}

/// Reads what [`write_calibration`] wrote.
///
/// # Errors
/// When the text is damaged.
pub fn read_calibration(file: &Path, bytes: &[u8]) -> Result<Camera> {
    let interior = read_interior(file, std::str::from_utf8(bytes)?)?;
    let (width, height) = interior.size.context("no image size")?;
    let params: Option<Vec<f64>> = interior.params.into_iter().collect();
    Ok(Camera::new(interior.model, width, height, &params.context("a parameter is missing")?)?.behind(interior.port)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::CameraModel;

    #[test]
    fn every_model_is_read_back_to_the_last_bit() {
        for model in CameraModel::ALL {
            let mut camera = Camera::from_focal(model, 1360, 1024, 1000.0 / 3.0).unwrap();
            for (i, value) in camera.params_mut().iter_mut().enumerate() {
                *value += (0.1 + i as f64).sin() * 10f64.powi(-3 * i as i32);
            }
            if model == CameraModel::Brown {
                // A normal whose length rounds to 1, which stays when it is made a unit vector again.
                let port = scene::FlatPort {
                    normal: nalgebra::Vector3::z_axis(),
                    distance_m: 0.1 / 3.0,
                    thickness_m: 0.008,
                    index_air: 1.0,
                    index_port: 1.49,
                    index_water: 4.0 / 3.0,
                    object_distance_m: 10.0 / 3.0,
                };
                camera = camera.behind(Some(port)).unwrap();
            }
            let text = write_calibration(&camera, "C1");
            assert_eq!(read_calibration(Path::new("C1.toml"), text.as_bytes()).unwrap(), camera, "{text}");
        }
        assert!(read_calibration(Path::new("C1.toml"), b"model = \"pinhole\"\nfx = 1.0").is_err());
    }
}
