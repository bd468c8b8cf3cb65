//! The log against the path.

use super::*;
use crate::appearance::WaterOptions;
use crate::motion::{Motion, MotionOptions};
use nalgebra::{Matrix3, Vector3};

fn motion() -> Motion {
    Motion::new(&MotionOptions { frames: 120, ..MotionOptions::default() }, Vector3::new(0.0, 0.0, 1.4))
}

fn logged(options: &SensorOptions) -> SensorLog {
    log(&motion(), &WaterOptions::default(), options, 3)
}

#[test]
fn rates_are_as_asked_for() {
    let log = logged(&SensorOptions { ideal: true, ..SensorOptions::default() });
    // 59.5 s and 2 s before and after: 63.5 s.
    let count = |has: fn(&Reading) -> bool| log.rows.iter().filter(|(_, r)| has(r)).count();
    assert_eq!(count(|r| r.depth_m.is_some()), 636);
    assert_eq!(count(|r| r.acceleration_m_s2.is_some()), 636);
    assert_eq!(count(|r| r.position_m.is_some()), 64);
    assert!(log.rows.windows(2).all(|w| w[0].0 < w[1].0));
    let csv = log.to_csv();
    let widths: Vec<usize> = csv.lines().map(|l| l.split(',').count()).collect();
    assert!(widths.iter().all(|&w| w == 16), "{:?}", &widths[..3]);
    assert_eq!(csv.lines().count(), log.rows.len() + 1);
}

/// Strapdown integration of an ideal log follows the path: gravity, axes and signs are right. 100 Hz, trapezoidal rule, 10 s: pushes of
/// 0.35 s leave 1 mm.
#[test]
fn inertial_readings_integrate_to_the_path() {
    let options = SensorOptions { ideal: true, imu_hz: 100.0, ..SensorOptions::default() };
    let (path, log) = (motion(), logged(&options));
    let body_from_rig = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
    let (mut rotation, mut place, mut velocity) =
        (path.rig_from_world(0.0).rotation.inverse(), path.rig_from_world(0.0).centre(), path.velocity(0.0));
    let readings: Vec<(Vector3<f64>, Vector3<f64>)> = log
        .rows
        .iter()
        .filter(|(t, _)| (0..=10_000_000).contains(t))
        .filter_map(|(_, r)| Some((body_from_rig.transpose() * r.acceleration_m_s2?, body_from_rig.transpose() * r.rate_deg_s?)))
        .collect();
    assert_eq!(readings.len(), 1001);
    let gravity = Vector3::z() * 9.806_65;
    for pair in readings.windows(2) {
        let turn = (pair[0].1 + pair[1].1) * (0.5 * 0.01f64.to_radians());
        let next = rotation * nalgebra::UnitQuaternion::from_scaled_axis(turn);
        let (a, b) = (rotation * pair[0].0 - gravity, next * pair[1].0 - gravity);
        place += velocity * 0.01 + (a * 2.0 + b) * (1e-4 / 6.0);
        velocity += (a + b) * 0.005;
        rotation = next;
    }
    assert!((place - path.rig_from_world(10.0).centre()).norm() < 2e-3, "{}", (place - path.rig_from_world(10.0).centre()).norm());
}

#[test]
fn level_attitude_is_told_as_such() {
    let calm = MotionOptions {
        current_m: 0.0,
        current_deg: 0.0,
        push_m: 0.0,
        push_deg: 0.0,
        height_m: [1.4, 1.4],
        arc_deg: 180.0,
        ..MotionOptions::default()
    };
    let path = Motion::new(&calm, Vector3::new(0.0, 0.0, 1.4));
    let log = log(&path, &WaterOptions::default(), &SensorOptions { ideal: true, ..SensorOptions::default() }, 1);
    let at = |time_us: i64| log.rows.iter().find(|(t, _)| *t == time_us).and_then(|(_, r)| r.attitude_deg).expect("logged");
    // From the west (-x) towards the east, at half of the way from the south towards the north.
    let start = at(0);
    assert!(start.x.abs() < 1e-6 && start.y.abs() < 1e-6 && (start.z - 90.0).abs() < 1e-6, "{start}");
    let middle = at(14_700_000);
    assert!(middle.z < 2.0 || middle.z > 358.0, "{middle}");
    let depth = log.rows.iter().find(|(t, _)| *t == 0).and_then(|(_, r)| r.depth_m).expect("logged");
    // 15 m of water, 1.4 m above the bottom, the sensor 0.35 m behind the camera and 0.05 m above it.
    assert!((depth - (15.0 - 1.4 - 0.05)).abs() < 1e-6, "{depth}");
}

#[test]
fn noise_has_the_size_asked_for_and_the_same_seed_the_same_bytes() {
    let options = SensorOptions { depth_bias_m: 0.0, position_outlier_share: 0.0, position_dropout_share: 0.0, ..SensorOptions::default() };
    let (noisy, ideal) = (logged(&options), logged(&SensorOptions { ideal: true, ..options.clone() }));
    let depths = |log: &SensorLog| log.rows.iter().filter_map(|(_, r)| r.depth_m).collect::<Vec<_>>();
    let errors: Vec<f64> = depths(&noisy).iter().zip(depths(&ideal)).map(|(a, b)| a - b).collect();
    let deviation = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    // 636 values: the standard error of a deviation is 2.8 %; four of them.
    assert!((deviation / 0.004 - 1.0).abs() < 0.11, "{deviation}");
    assert_eq!(noisy.to_csv(), logged(&options).to_csv());
    assert_ne!(noisy.to_csv(), log(&motion(), &WaterOptions::default(), &options, 4).to_csv());
}
