//! Rates and noise of the sensors.

use serde::{Deserialize, Serialize};

/// The sensors of the vehicle. Rates as Rofallski et al. 2020, table 2; noise of the class of their instruments. A rate of 0 leaves a
/// sensor out. Standard deviations; lever arms in the frame of the first camera (x right, y down, z forward).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorOptions {
    /// Pressure, as depth.
    pub pressure_hz: f64,
    /// Noise of the depth, metres (MS5837-30BA: 2 mm resolution).
    pub depth_noise_m: f64,
    /// Constant error of the depth, metres, drawn once (MS5837-30BA: 50 mbar over its range; zeroed at the surface).
    pub depth_bias_m: f64,
    /// Temperature.
    pub temperature_hz: f64,
    /// Noise, kelvin (TSYS01).
    pub temperature_noise_k: f64,
    /// Conductivity, as salinity.
    pub salinity_hz: f64,
    /// Noise, parts per thousand.
    pub salinity_noise_ppt: f64,
    /// Inertial measurement unit and attitude.
    pub imu_hz: f64,
    /// Noise of the acceleration at 10 Hz, m/s2 (400 micro-g a root hertz).
    pub acceleration_noise_m_s2: f64,
    /// Constant error of each axis, m/s2, drawn once.
    pub acceleration_bias_m_s2: f64,
    /// Noise of the angular velocity at 10 Hz, degrees a second (0.01 a root hertz).
    pub rate_noise_deg_s: f64,
    /// Constant error of each axis, degrees a second, drawn once.
    pub rate_bias_deg_s: f64,
    /// Noise of roll and pitch, degrees.
    pub tilt_noise_deg: f64,
    /// Noise of the heading, degrees.
    pub heading_noise_deg: f64,
    /// Constant error of the heading by iron and declination, degrees, drawn once.
    pub heading_bias_deg: f64,
    /// Acoustic position.
    pub position_hz: f64,
    /// Noise of each coordinate, metres, at 10 m and proportional to the distance from the boat beyond that.
    pub position_noise_m: f64,
    /// Share of positions that are wrong by several metres: echoes.
    pub position_outlier_share: f64,
    /// Share of positions that are missing.
    pub position_dropout_share: f64,
    /// Time between the ping and its entry in the log, seconds: entries are this late.
    pub position_latency_s: f64,
    /// The transponder from the first camera, metres.
    pub transponder_m: [f64; 3],
    /// The pressure sensor from the first camera, metres.
    pub pressure_sensor_m: [f64; 3],
    /// Without noise, errors and latency.
    pub ideal: bool,
}

impl Default for SensorOptions {
    fn default() -> Self {
        Self {
            pressure_hz: 10.0,
            depth_noise_m: 0.004,
            depth_bias_m: 0.03,
            temperature_hz: 10.0,
            temperature_noise_k: 0.02,
            salinity_hz: 1.0,
            salinity_noise_ppt: 0.05,
            imu_hz: 10.0,
            acceleration_noise_m_s2: 0.012,
            acceleration_bias_m_s2: 0.04,
            rate_noise_deg_s: 0.03,
            rate_bias_deg_s: 0.1,
            tilt_noise_deg: 0.3,
            heading_noise_deg: 0.8,
            heading_bias_deg: 2.0,
            position_hz: 1.0,
            position_noise_m: 0.25,
            position_outlier_share: 0.03,
            position_dropout_share: 0.05,
            position_latency_s: 0.35,
            transponder_m: [0.2, -0.32, -0.15],
            pressure_sensor_m: [0.2, -0.05, -0.35],
            ideal: false,
        }
    }
}

impl SensorOptions {
    /// Says what is not possible.
    ///
    /// # Errors
    /// The key and what it may be.
    pub fn check(&self) -> Result<(), String> {
        let keys = [
            ("pressure_hz", self.pressure_hz, 1000.0),
            ("depth_noise_m", self.depth_noise_m, 1e3),
            ("depth_bias_m", self.depth_bias_m, 1e3),
            ("temperature_hz", self.temperature_hz, 1000.0),
            ("temperature_noise_k", self.temperature_noise_k, 1e3),
            ("salinity_hz", self.salinity_hz, 1000.0),
            ("salinity_noise_ppt", self.salinity_noise_ppt, 1e3),
            ("imu_hz", self.imu_hz, 1000.0),
            ("acceleration_noise_m_s2", self.acceleration_noise_m_s2, 1e3),
            ("acceleration_bias_m_s2", self.acceleration_bias_m_s2, 1e3),
            ("rate_noise_deg_s", self.rate_noise_deg_s, 1e3),
            ("rate_bias_deg_s", self.rate_bias_deg_s, 1e3),
            ("tilt_noise_deg", self.tilt_noise_deg, 90.0),
            ("heading_noise_deg", self.heading_noise_deg, 180.0),
            ("heading_bias_deg", self.heading_bias_deg, 180.0),
            ("position_hz", self.position_hz, 1000.0),
            ("position_noise_m", self.position_noise_m, 1e3),
            ("position_outlier_share", self.position_outlier_share, 1.0),
            ("position_dropout_share", self.position_dropout_share, 1.0),
            ("position_latency_s", self.position_latency_s, 60.0),
        ];
        for (key, value, most) in keys {
            if !(0.0..=most).contains(&value) {
                return Err(format!("sensors.{key} = {value} must be from 0 to {most}"));
            }
        }
        for (key, arm) in [("transponder_m", self.transponder_m), ("pressure_sensor_m", self.pressure_sensor_m)] {
            if !arm.iter().all(|v| v.abs() <= 100.0) {
                return Err(format!("sensors.{key} = {arm:?} must be within 100 metres"));
            }
        }
        Ok(())
    }
}
