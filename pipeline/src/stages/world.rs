//! What the vehicle's sensors and control points say of the world.

use super::images::ImageList;
use super::orient::Told;
use super::targets::Picker;
use crate::config::{Config, MAX_FROM_ORIGIN_M, SensorsConfig};
use crate::error::Misfit;
use crate::sensor_log::{SensorLog, at_instants, read_sensor_log};
use crate::store::Warning;
use anyhow::Result;
use mapping::{ControlPointInput, HeadingInput, PositionInput, UpInput, WorldInput};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Reads the log and brings it to the exposures.
///
/// # Errors
/// When the log cannot be read, or does not fit the images.
pub(super) fn world(config: &Config, picker: &Picker<'_>, told: &mut Told, warnings: &mut Vec<Warning>) -> Result<WorldInput> {
    let list = picker.list;
    let origin = Vector3::from(config.origin_m);
    let mut world = WorldInput::default();
    if let Some(sensors) = &config.sensors {
        let log = read_sensor_log(&sensors.file)?;
        let mut warn = |message: String| warnings.push(Warning { about: "sensors".to_owned(), message });
        log.warnings.iter().cloned().for_each(&mut warn);
        let (exposures, instants): (Vec<u32>, Vec<f64>) = instants(sensors, list)?.into_iter().unzip();
        readings(&mut world, sensors, &log, (&exposures, &instants), &origin);
        if world.is_empty() {
            let range = |(first, last): (f64, f64)| format!("{first} to {last} s");
            let exposed = instants.first().copied().zip(instants.last().copied()).map_or_else(String::new, range);
            let logged = log.span.map_or_else(|| "nothing".to_owned(), range);
            warn(format!("no reading falls in the time of the exposures, {exposed}; the log has {logged}: see sensors.offset_secs"));
        }
        if let Some(far) = world.positions.iter().find(|p| p.xyz.xy().amax() > MAX_FROM_ORIGIN_M) {
            let (x, y) = (far.xyz.x, far.xyz.y);
            let message =
                format!("a position of the log lies at {x:.0} m east and {y:.0} m north of the model's origin: set [world] origin_m");
            return Err(Misfit(message).into());
        }
    }
    for point in &config.control_points {
        let picked = picker.picks(&point.picks, point.target.as_ref(), &point.name, warnings);
        told.control_targets.push(picked.targets);
        let (xyz, sigma_m) = (Vector3::from(point.xyz_m) - origin, Vector3::repeat(point.sigma_m));
        world.control_points.push(ControlPointInput { picks: picked.picks, xyz, sigma_m, check: point.check });
    }
    Ok(world)
}

/// Time in the log of each exposure, by time.
fn instants(sensors: &SensorsConfig, list: &ImageList) -> Result<Vec<(u32, f64)>> {
    let mut times: BTreeMap<u32, f64> = BTreeMap::new();
    for image in &list.images {
        // Files are counted, not exposures: one that cannot be read leaves a gap in time.
        let counted = sensors.interval_secs.zip(image.position).map(|(interval, position)| position as f64 * interval);
        if let Some(time) = counted.or(image.time_secs) {
            // The first camera that took part tells the time.
            times.entry(image.exposure).or_insert(time + sensors.offset_secs);
        }
    }
    if times.is_empty() {
        let message = "the images do not tell when they were taken: give sensors.interval_secs, the time between exposures";
        return Err(Misfit(message.to_owned()).into());
    }
    let mut times: Vec<(u32, f64)> = times.into_iter().collect();
    times.sort_by(|a, b| a.1.total_cmp(&b.1));
    Ok(times)
}

fn readings(
    world: &mut WorldInput,
    sensors: &SensorsConfig,
    log: &SensorLog,
    (exposures, instants): (&[u32], &[f64]),
    origin: &Vector3<f64>,
) {
    let unknown = f64::INFINITY;
    // A position that stands late in the log was measured earlier.
    let logged: Vec<f64> = instants.iter().map(|t| t + sensors.position_latency_secs).collect();
    let (position_lever, depth_lever) = (Vector3::from(sensors.position_lever_m), Vector3::from(sensors.depth_lever_m));
    let position = |(i, xyz, sigma_m): (usize, Vector3<f64>, Vector3<f64>), in_rig| PositionInput {
        exposure: exposures[i],
        in_rig,
        xyz: xyz - origin,
        sigma_m,
    };
    let s = sensors.position_sigma_m;
    let horizontal =
        at_instants(&log.positions, &logged).into_iter().map(|(i, [e, n])| (i, Vector3::new(e, n, 0.0), Vector3::new(s, s, unknown)));
    world.positions.extend(horizontal.map(|p| position(p, position_lever)));
    let heights =
        at_instants(&log.heights, &logged).into_iter().map(|(i, [up])| (i, Vector3::new(0.0, 0.0, up), Vector3::new(unknown, unknown, s)));
    world.positions.extend(heights.map(|p| position(p, position_lever)));
    let depths = at_instants(&log.depths, instants).into_iter().map(|(i, [depth])| {
        (i, Vector3::new(0.0, 0.0, sensors.water_level_m - depth), Vector3::new(unknown, unknown, sensors.depth_sigma_m))
    });
    world.positions.extend(depths.map(|p| position(p, depth_lever)));
    let body = sensors.camera_from_body;
    let ups = at_instants(&log.ups, instants).into_iter().map(|(i, up)| (i, body * Vector3::from(up))).filter(|(_, up)| up.norm() > 0.0);
    let sigma_rad = sensors.tilt_sigma_deg.to_radians();
    world.ups.extend(ups.map(|(i, up_in_rig)| UpInput { exposure: exposures[i], up_in_rig, sigma_rad }));
    let sigma_rad = sensors.heading_sigma_deg.to_radians();
    world.headings.extend(at_instants(&log.headings, instants).into_iter().map(|(i, [cos, sin])| HeadingInput {
        exposure: exposures[i],
        axis_in_rig: body * Vector3::x(),
        heading_rad: sin.atan2(cos),
        sigma_rad,
    }));
}
