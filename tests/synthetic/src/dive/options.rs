//! What can be set of a dive; `scene.toml` has the same keys.

use crate::appearance::{LampOptions, WaterOptions};
use crate::motion::MotionOptions;
use crate::sensors::SensorOptions;
use crate::world::WorldOptions;
use serde::{Deserialize, Serialize};

/// A dive to render.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiveOptions {
    /// Seed of everything: another one is another dive.
    pub seed: u64,
    /// What stands in the scene.
    pub world: WorldOptions,
    /// How the rig moves.
    pub motion: MotionOptions,
    /// Cameras and where they are mounted.
    pub rig: RigOptions,
    /// The water.
    pub water: WaterOptions,
    /// The vehicle's lamps.
    pub lamps: LampOptions,
    /// What a camera makes of light.
    pub response: ResponseOptions,
    /// What the vehicle logs.
    pub sensors: SensorOptions,
}

/// The cameras of a rig. All take frames of the same size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigOptions {
    /// Columns of a frame.
    pub width: u32,
    /// Rows of a frame.
    pub height: u32,
    /// Width of the sensor, millimetres.
    pub sensor_width_mm: f64,
    /// The cameras; the first one is the frame of the rig.
    pub cameras: Vec<CameraOptions>,
    /// The window in front of each camera.
    pub port: PortOptions,
}

/// A camera and its mounting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraOptions {
    /// Projection centre in the frame of the rig (x right, y down, z forward), metres.
    pub centre_m: [f64; 3],
    /// Turned to the right, then up, then clockwise about its axis, degrees.
    pub turn_deg: [f64; 3],
    /// Principal distance in air, millimetres.
    pub focal_mm: f64,
    /// Principal point from the middle of the sensor, millimetres.
    pub axis_mm: [f64; 2],
    /// Radial distortion a1, a2 of the lens in air, for normalised coordinates.
    pub radial: [f64; 2],
    /// Decentring distortion b1, b2.
    pub tangential: [f64; 2],
    /// From the projection centre to the window, metres.
    pub port_distance_m: f64,
    /// Tilt of the window's normal to the right and down, degrees.
    pub port_tilt_deg: [f64; 2],
}

impl Default for CameraOptions {
    fn default() -> Self {
        Self {
            centre_m: [0.0; 3],
            turn_deg: [0.0; 3],
            focal_mm: 4.8,
            axis_mm: [0.012, -0.009],
            radial: [-0.060, 0.004],
            tangential: [1e-4, -0.5e-4],
            port_distance_m: 0.018,
            port_tilt_deg: [0.15, -0.1],
        }
    }
}

/// What the cameras look through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PortKind {
    /// A flat window.
    #[default]
    Flat,
    /// Nothing: the cameras look into the water directly, as through a perfect dome.
    None,
}

/// The window: acrylic, as in Rofallski et al. 2020.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PortOptions {
    /// Flat, or none.
    pub kind: PortKind,
    /// Thickness of the window, millimetres.
    pub thickness_mm: f64,
    /// Its refractive index.
    pub index: f64,
    /// Whether it is known to those who orient the dive: lens in air and window apart. Else they have one Brown model, calibrated in the water.
    pub known: bool,
}

impl Default for PortOptions {
    fn default() -> Self {
        Self { kind: PortKind::Flat, thickness_mm: 8.42, index: 1.491, known: false }
    }
}

impl Default for RigOptions {
    /// Two cameras that look forward, 0.4 m apart, and one that looks backward and down, as in Rofallski et al. 2020.
    fn default() -> Self {
        let first = CameraOptions::default();
        let second = CameraOptions {
            centre_m: [0.3998, 0.006, 0.0105],
            turn_deg: [-4.0, 0.6, 0.9],
            focal_mm: 4.803,
            axis_mm: [-0.008, 0.014],
            radial: [-0.064, 0.005],
            tangential: [-0.8e-4, 0.4e-4],
            port_distance_m: 0.0185,
            port_tilt_deg: [-0.1, 0.2],
        };
        let third = CameraOptions {
            centre_m: [0.205, 0.031, -0.262],
            turn_deg: [181.5, -28.0, -0.6],
            focal_mm: 4.812,
            axis_mm: [0.004, 0.006],
            radial: [-0.058, 0.003],
            tangential: [0.3e-4, 0.7e-4],
            port_distance_m: 0.0175,
            port_tilt_deg: [0.05, 0.12],
        };
        Self { width: 640, height: 400, sensor_width_mm: 9.216, cameras: vec![first, second, third], port: PortOptions::default() }
    }
}

/// What a camera makes of light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResponseOptions {
    /// Factor from light to the sensor's full scale; without it each frame is exposed to a mean grey.
    pub gain: Option<f32>,
    /// How far the channels are balanced: 0 as the light is, 1 until the water's own colour is grey; red grows by 4 at most.
    pub white_balance: f32,
    /// Share of the light of the other channels that each channel sees.
    pub crosstalk: f32,
    /// Standard deviation of the sensor noise, grey values of 255.
    pub noise: f32,
    /// Standard deviation of the blur by lens and sensor, pixels.
    pub blur_px: f32,
    /// Rays along each side of a pixel, 1 to 4.
    pub samples: u32,
    /// Quality of the JPEG files, 1 to 100; 0 writes PNG files, without loss.
    pub jpeg_quality: u8,
}

impl Default for ResponseOptions {
    fn default() -> Self {
        Self { gain: None, white_balance: 0.5, crosstalk: 0.12, noise: 2.0, blur_px: 0.6, samples: 1, jpeg_quality: 93 }
    }
}

impl DiveOptions {
    /// How the files of the frames end.
    #[must_use]
    pub fn frame_extension(&self) -> &'static str {
        if self.response.jpeg_quality == 0 { "png" } else { "jpg" }
    }

    /// Says what is not possible.
    ///
    /// # Errors
    /// The key and what it may be.
    pub fn check(&self) -> Result<(), String> {
        let within = |key: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) { Ok(()) } else { Err(format!("{key} = {value} must be from {low} to {high}")) }
        };
        self.world.check()?;
        self.motion.check()?;
        self.sensors.check()?;
        within("rig.width", f64::from(self.rig.width), 16.0, 8192.0)?;
        within("rig.height", f64::from(self.rig.height), 16.0, 8192.0)?;
        within("rig.sensor_width_mm", self.rig.sensor_width_mm, 0.5, 100.0)?;
        within("number of rig.cameras", self.rig.cameras.len() as f64, 1.0, 16.0)?;
        if self.rig.cameras[0].centre_m != [0.0; 3] || self.rig.cameras[0].turn_deg != [0.0; 3] {
            return Err("centre_m and turn_deg of rig.cameras[0] must be 0: the first camera is the frame of the rig".to_owned());
        }
        for (i, camera) in self.rig.cameras.iter().enumerate() {
            let key = |name: &str| format!("{name} of rig.cameras[{i}]");
            within(&key("focal_mm"), camera.focal_mm, 0.1 * self.rig.sensor_width_mm, 50.0 * self.rig.sensor_width_mm)?;
            within(&key("port_distance_m"), camera.port_distance_m, 0.0, 1.0)?;
            for k in 0..2 {
                within(&key("axis_mm"), camera.axis_mm[k], -0.2 * self.rig.sensor_width_mm, 0.2 * self.rig.sensor_width_mm)?;
                within(&key("radial"), camera.radial[k], -0.3, 0.3)?;
                within(&key("tangential"), camera.tangential[k], -0.01, 0.01)?;
                within(&key("port_tilt_deg"), camera.port_tilt_deg[k], -20.0, 20.0)?;
            }
            for k in 0..3 {
                within(&key("centre_m"), camera.centre_m[k], -10.0, 10.0)?;
                within(&key("turn_deg"), camera.turn_deg[k], -360.0, 360.0)?;
            }
        }
        within("seed", self.seed as f64, 0.0, 2f64.powi(53))?;
        within("rig.port.thickness_mm", self.rig.port.thickness_mm, 0.0, 200.0)?;
        within("rig.port.index", self.rig.port.index, 1.0, 2.5)?;
        within("water.depth_m", self.water.depth_m, 0.0, 11_000.0)?;
        within("water.temperature_degc", self.water.temperature_degc, -2.0, 40.0)?;
        within("water.salinity_ppt", self.water.salinity_ppt, 0.0, 45.0)?;
        within("water.scattering_per_m", f64::from(self.water.scattering_per_m.unwrap_or(0.0)), 0.0, 20.0)?;
        within("water.forward_blur_rad", f64::from(self.water.forward_blur_rad), 0.0, 0.2)?;
        within("water.snow_per_m3", self.water.snow_per_m3, 0.0, 1e4)?;
        within("water.caustics", f64::from(self.water.caustics), 0.0, 1.0)?;
        within("lamps.power", f64::from(self.lamps.power), 0.0, 1e4)?;
        within("lamps.half_spacing_m", self.lamps.half_spacing_m, -10.0, 10.0)?;
        within("lamps.above_m", self.lamps.above_m, -10.0, 10.0)?;
        within("lamps.half_angle_deg", f64::from(self.lamps.half_angle_deg), 1.0, 85.0)?;
        within("response.gain", f64::from(self.response.gain.unwrap_or(1.0)), 1e-6, 1e9)?;
        within("response.white_balance", f64::from(self.response.white_balance), 0.0, 1.0)?;
        within("response.crosstalk", f64::from(self.response.crosstalk), 0.0, 1.0)?;
        within("response.noise", f64::from(self.response.noise), 0.0, 100.0)?;
        within("response.blur_px", f64::from(self.response.blur_px), 0.0, 20.0)?;
        within("response.samples", f64::from(self.response.samples), 1.0, 4.0)?;
        within("response.jpeg_quality", f64::from(self.response.jpeg_quality), 0.0, 100.0)?;
        // Whether the lenses can be described does not depend much on the distance.
        super::rig::cameras(self, 3.0).map(|_| ())
    }
}
