//! `[sensors]`, `[world]` and `[[control_point]]`.

use super::error::Source;
use super::model::{CameraConfig, ControlPointConfig, SensorsConfig};
use super::raw::{RawControlPoint, RawSensors, RawWorld};
use super::rig::{pick, rotation, target};
use super::values::Values;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use std::path::Path;
use toml::Spanned;

/// Standard deviation of a control point of which none is given, metres.
const DEFAULT_CONTROL_SIGMA_M: f64 = 0.01;
/// Farther from the origin of the world a point cloud of single precision no longer tells millimetres.
pub(crate) const MAX_FROM_ORIGIN_M: f64 = 10_000.0;

/// Where the origin of the model's frame lies in the world of the sensors and control points.
pub(super) fn origin(source: &mut Source<'_>, raw: &RawWorld) -> [f64; 3] {
    Values { source }.numbers("world.origin_m", &raw.origin_m).unwrap_or_default()
}

pub(super) fn sensors(source: &mut Source<'_>, raw: Option<&Spanned<RawSensors>>, folder: &Path) -> Option<SensorsConfig> {
    let (raw, entry) = (raw?.get_ref(), raw?.span());
    let Some(file) = &raw.file else {
        source.problem(Some(entry), "sensors.file", "is missing", Some("name the log: file = \"sensors.csv\"".to_owned()));
        return None;
    };
    let path = folder.join(file.get_ref().as_str());
    if !path.is_file() {
        source.problem(Some(file.span()), "sensors.file", format!("there is no file {}", path.display()), None);
    }
    let mut values = Values { source };
    let camera_from_body = match &raw.mounting {
        // Forward is along the optical axis, starboard to the right of the image, down is down.
        None => UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::new(
            0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0,
        ))),
        Some(mounting) => rotation(&mut values, "sensors.mounting", mounting)?,
    };
    let lever = |values: &mut Values<'_, '_>, key: &str, place| values.numbers(key, place).unwrap_or_default();
    Some(SensorsConfig {
        file: path,
        offset_secs: values.within("sensors.offset_secs", &raw.offset_secs, -1e12, 1e12, 0.0),
        interval_secs: values.positive("sensors.interval_secs", &raw.interval_secs),
        position_latency_secs: values.within("sensors.position_latency_secs", &raw.position_latency_secs, -3600.0, 3600.0, 0.0),
        position_sigma_m: values.positive("sensors.position_sigma_m", &raw.position_sigma_m).unwrap_or(1.0),
        position_lever_m: lever(&mut values, "sensors.position_lever_m", &raw.position_lever_m),
        depth_sigma_m: values.positive("sensors.depth_sigma_m", &raw.depth_sigma_m).unwrap_or(0.05),
        depth_lever_m: lever(&mut values, "sensors.depth_lever_m", &raw.depth_lever_m),
        water_level_m: values.within("sensors.water_level_m", &raw.water_level_m, -1e6, 1e6, 0.0),
        tilt_sigma_deg: values.positive("sensors.tilt_sigma_deg", &raw.tilt_sigma_deg).unwrap_or(1.0),
        heading_sigma_deg: values.positive("sensors.heading_sigma_deg", &raw.heading_sigma_deg).unwrap_or(5.0),
        camera_from_body,
    })
}

pub(super) fn control_points(
    source: &mut Source<'_>,
    raw: &[Spanned<RawControlPoint>],
    cameras: &[CameraConfig],
    origin: [f64; 3],
) -> Vec<ControlPointConfig> {
    let mut values = Values { source };
    raw.iter().enumerate().filter_map(|(i, entry)| control_point(&mut values, i, entry, cameras, origin)).collect()
}

fn control_point(
    values: &mut Values<'_, '_>,
    index: usize,
    entry: &Spanned<RawControlPoint>,
    cameras: &[CameraConfig],
    origin: [f64; 3],
) -> Option<ControlPointConfig> {
    let point = entry.get_ref();
    if point.xyz_m.is_none() {
        values.problem_with_hint(
            entry.span(),
            "control_point.xyz_m",
            "is missing",
            "its coordinates east, north and up: xyz_m = [0.0, 0.0, -12.0]",
        );
    }
    let xyz_m = values.numbers::<3>("control_point.xyz_m", &point.xyz_m);
    if let (Some(xyz), Some(place)) = (xyz_m, &point.xyz_m)
        && (0..3).any(|k| (xyz[k] - origin[k]).abs() > MAX_FROM_ORIGIN_M)
    {
        let hint = "set [world] origin_m to round coordinates near the dive: it is subtracted from all";
        values.problem_with_hint(place.span(), "control_point.xyz_m", "is more than 10 km from the origin of the model", hint);
    }
    let sigma_m = values.positive("control_point.sigma_m", &point.sigma_m).unwrap_or(DEFAULT_CONTROL_SIGMA_M);
    let picks: Vec<_> = point.picks.iter().flatten().filter_map(|p| pick(values, "control_point.picks", p, cameras)).collect();
    if point.picks.as_ref().is_none_or(|p| p.len() < 2) {
        let hint = "picks = [{ image = \"C1/a.jpg\", x = 1.0, y = 2.0 }, ...]";
        values.problem_with_hint(entry.span(), "control_point.picks", "needs two images or more", hint);
    }
    let name = point.name.as_ref().map_or_else(|| format!("point {}", index + 1), |n| n.get_ref().clone());
    let check = point.check.as_ref().is_some_and(|c| *c.get_ref());
    let target = target(values, "control_point", &point.target, &point.search_radius_px);
    Some(ControlPointConfig { name, xyz_m: xyz_m?, sigma_m, check, target, picks })
}
