//! The log of a dive.

use super::options::SensorOptions;
use crate::appearance::WaterOptions;
use crate::motion::Motion;
use crate::random::{Random, mix};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::fmt::Write;

const GRAVITY_M_S2: f64 = 9.806_65;
/// The boat lies this far south of the scene's middle.
const BOAT_SOUTH_M: f64 = 8.0;
/// The log begins this long before the first exposure and ends this long after the last, seconds.
const MARGIN_S: f64 = 2.0;
/// Temperature falls and salinity grows with depth, a metre.
const TEMPERATURE_PER_M: f64 = -0.03;
const SALINITY_PER_M: f64 = 0.004;

/// What was logged at one time. World: x east, y north. Body: x forward, y starboard, z down, the first camera's z, x, y.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// Depth of the pressure sensor below the surface, metres.
    pub depth_m: Option<f64>,
    /// Temperature of the water.
    pub temperature_degc: Option<f64>,
    /// Salinity of the water.
    pub salinity_ppt: Option<f64>,
    /// Specific force in the body, m/s2: acceleration less gravity, so (0, 0, -9.81) at rest and level.
    pub acceleration_m_s2: Option<Vector3<f64>>,
    /// Angular velocity about the axes of the body, degrees a second.
    pub rate_deg_s: Option<Vector3<f64>>,
    /// Roll, pitch and heading (from north over east), degrees, as the autopilot estimates them.
    pub attitude_deg: Option<Vector3<f64>>,
    /// East, north and height of the transponder, metres in the world.
    pub position_m: Option<Vector3<f64>>,
}

/// Readings in the order of time (microseconds from the first exposure).
#[derive(Clone, Debug, PartialEq)]
pub struct SensorLog {
    /// Time and reading.
    pub rows: Vec<(i64, Reading)>,
}

impl SensorLog {
    /// One table; a cell is empty where a sensor gave nothing at that time.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "time_s,depth_m,temperature_degc,salinity_ppt,acceleration_x_m_s2,acceleration_y_m_s2,acceleration_z_m_s2,\
             rate_x_deg_s,rate_y_deg_s,rate_z_deg_s,roll_deg,pitch_deg,heading_deg,east_m,north_m,up_m\n",
        );
        for (time_us, r) in &self.rows {
            let _ = write!(text, "{:.3}", *time_us as f64 / 1e6);
            let scalar = |v: Option<f64>| (v.map(|v| Vector3::new(v, 0.0, 0.0)), 1);
            let cells = [
                (scalar(r.depth_m), 3),
                (scalar(r.temperature_degc), 2),
                (scalar(r.salinity_ppt), 2),
                ((r.acceleration_m_s2, 3), 4),
                ((r.rate_deg_s, 3), 3),
                ((r.attitude_deg, 3), 2),
                ((r.position_m, 3), 2),
            ];
            for ((value, count), digits) in cells {
                for k in 0..count {
                    match value {
                        Some(v) => _ = write!(text, ",{:.digits$}", v[k]),
                        None => text.push(','),
                    }
                }
            }
            text.push('\n');
        }
        text
    }
}

/// Logs a dive: from before its first exposure until after its last. The bottom lies `water.depth_m` below the surface.
#[must_use]
pub fn log(motion: &Motion, water: &WaterOptions, options: &SensorOptions, seed: u64) -> SensorLog {
    let mut logger = Logger {
        motion,
        water,
        options,
        random: Random::new(mix(seed ^ 0x5E_5085)),
        noisy: f64::from(u8::from(!options.ideal)),
        rows: BTreeMap::new(),
    };
    logger.pressure();
    logger.water();
    logger.inertial();
    logger.position();
    SensorLog { rows: logger.rows.into_iter().collect() }
}

struct Logger<'a> {
    motion: &'a Motion,
    water: &'a WaterOptions,
    options: &'a SensorOptions,
    random: Random,
    noisy: f64,
    rows: BTreeMap<i64, Reading>,
}

impl Logger<'_> {
    fn times(&self, rate_hz: f64) -> Vec<f64> {
        if rate_hz <= 0.0 {
            return Vec::new();
        }
        let (first, last) = (-(MARGIN_S * rate_hz).floor() as i64, ((self.motion.duration_s() + MARGIN_S) * rate_hz).floor() as i64);
        (first..=last).map(|k| k as f64 / rate_hz).collect()
    }

    fn row(&mut self, time_s: f64) -> &mut Reading {
        self.rows.entry((time_s * 1e6).round() as i64).or_default()
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        self.noisy * sigma * self.random.normal()
    }

    fn normals(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal(sigma))
    }

    /// A point fixed to the rig, in the world.
    fn place(&self, time_s: f64, on_rig: [f64; 3]) -> Vector3<f64> {
        self.motion.rig_from_world(time_s).inverse().apply(&Vector3::from(on_rig))
    }

    fn pressure(&mut self) {
        let bias = self.normal(self.options.depth_bias_m);
        for time in self.times(self.options.pressure_hz) {
            let depth = self.water.depth_m - self.place(time, self.options.pressure_sensor_m).z;
            let noise = self.normal(self.options.depth_noise_m);
            self.row(time).depth_m = Some(depth + bias + noise);
        }
    }

    fn water(&mut self) {
        for time in self.times(self.options.temperature_hz) {
            let height = self.place(time, [0.0; 3]).z;
            let noise = self.normal(self.options.temperature_noise_k);
            self.row(time).temperature_degc = Some(self.water.temperature_degc - TEMPERATURE_PER_M * height + noise);
        }
        for time in self.times(self.options.salinity_hz) {
            let height = self.place(time, [0.0; 3]).z;
            let noise = self.normal(self.options.salinity_noise_ppt);
            self.row(time).salinity_ppt = Some(self.water.salinity_ppt - SALINITY_PER_M * height + noise);
        }
    }

    fn inertial(&mut self) {
        let o = self.options;
        let (force_bias, rate_bias) = (self.normals(o.acceleration_bias_m_s2), self.normals(o.rate_bias_deg_s));
        let heading_bias = self.normal(o.heading_bias_deg);
        // Camera axes x right, y down, z forward become body axes.
        let body_from_rig = Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        for time in self.times(o.imu_hz) {
            let rotation = self.motion.rig_from_world(time).rotation;
            let force = body_from_rig * (rotation * (self.motion.acceleration(time) + Vector3::z() * GRAVITY_M_S2));
            let rate = body_from_rig * self.motion.angular_rate(time) * 1f64.to_degrees();
            let axis = |k: usize| rotation.inverse() * body_from_rig.row(k).transpose();
            let (forward, starboard, down) = (axis(0), axis(1), axis(2));
            let roll = (-starboard.z).atan2(-down.z);
            let (pitch, heading) = (forward.z.clamp(-1.0, 1.0).asin(), forward.x.atan2(forward.y));
            let noise = [o.tilt_noise_deg, o.tilt_noise_deg, o.heading_noise_deg].map(|sigma| self.normal(sigma));
            let attitude = Vector3::new(
                roll.to_degrees() + noise[0],
                pitch.to_degrees() + noise[1],
                (heading.to_degrees() + heading_bias + noise[2]).rem_euclid(360.0),
            );
            let (force_noise, rate_noise) = (self.normals(o.acceleration_noise_m_s2), self.normals(o.rate_noise_deg_s));
            let row = self.row(time);
            row.acceleration_m_s2 = Some(force + force_bias + force_noise);
            row.rate_deg_s = Some(rate + rate_bias + rate_noise);
            row.attitude_deg = Some(attitude);
        }
    }

    fn position(&mut self) {
        let o = self.options;
        for time in self.times(o.position_hz) {
            let place = self.place(time, o.transponder_m);
            let boat = Vector3::new(0.0, -BOAT_SOUTH_M, self.water.depth_m);
            let sigma = o.position_noise_m * ((place - boat).norm() / 10.0).max(1.0);
            let noise = self.normals(sigma);
            let (lost, wrong) = (self.random.unit(), self.random.unit());
            let echo = Vector3::from_fn(|_, _| self.random.range(-6.0, 6.0));
            if self.noisy > 0.0 && lost < o.position_dropout_share {
                continue;
            }
            let echo = if self.noisy > 0.0 && wrong < o.position_outlier_share { echo } else { Vector3::zeros() };
            let late = self.noisy * o.position_latency_s;
            self.row(time + late).position_m = Some(place + noise + echo);
        }
    }
}
