//! What can be set of a path.

use serde::{Deserialize, Serialize};

/// The plan of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionKind {
    /// Around the middle of the scene, rising, looking at it.
    #[default]
    Circle,
    /// Along x beside the middle of the scene, looking across and down at it.
    Line,
    /// To and fro above the scene in lanes along x, looking down.
    Lanes,
}

/// A path. Metres, seconds; angles in degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionOptions {
    /// The plan.
    pub kind: MotionKind,
    /// Exposures of all cameras.
    pub frames: usize,
    /// Exposures a second: the hardware trigger.
    pub rate_hz: f64,
    /// Distance from the middle of the scene; `lanes`: ignored.
    pub radius_m: f64,
    /// `circle`: the angle of the whole path about the scene, its middle in the direction -y; more than 360 for several rounds.
    pub arc_deg: f64,
    /// Height at the beginning and at the end.
    pub height_m: [f64; 2],
    /// `line` and `lanes`: length along x.
    pub length_m: f64,
    /// `lanes`: distance between lanes.
    pub spacing_m: f64,
    /// `lanes`: number of lanes.
    pub lanes: u32,
    /// How far the current carries the vehicle from its plan: amplitude of slow waves.
    pub current_m: f64,
    /// Their amplitude in heading, pitch and roll.
    pub current_deg: f64,
    /// Short pushes, some every ten seconds: largest displacement.
    pub push_m: f64,
    /// Largest turn of a push.
    pub push_deg: f64,
    /// Seed of currents and pushes.
    pub seed: u64,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            kind: MotionKind::Circle,
            frames: 60,
            rate_hz: 2.0,
            radius_m: 4.8,
            arc_deg: 200.0,
            height_m: [1.0, 2.6],
            length_m: 8.0,
            spacing_m: 1.0,
            lanes: 4,
            current_m: 0.12,
            current_deg: 2.0,
            push_m: 0.02,
            push_deg: 1.2,
            seed: 1,
        }
    }
}

impl MotionOptions {
    /// Says what is not possible.
    ///
    /// # Errors
    /// The key and what it may be.
    pub fn check(&self) -> Result<(), String> {
        let within = |key: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) { Ok(()) } else { Err(format!("motion.{key} = {value} must be from {low} to {high}")) }
        };
        within("frames", self.frames as f64, 1.0, 9999.0)?;
        within("rate_hz", self.rate_hz, 0.01, 100.0)?;
        within("radius_m", self.radius_m, 0.2, 100.0)?;
        within("arc_deg", self.arc_deg, -7200.0, 7200.0)?;
        within("height_m", self.height_m[0], 0.1, 100.0)?;
        within("height_m", self.height_m[1], 0.1, 100.0)?;
        within("length_m", self.length_m, 0.0, 1000.0)?;
        within("spacing_m", self.spacing_m, 0.0, 100.0)?;
        within("lanes", f64::from(self.lanes), 1.0, 1000.0)?;
        if self.kind == MotionKind::Lanes && self.length_m + self.spacing_m <= 0.0 {
            return Err("motion.length_m = 0 and motion.spacing_m = 0 leave lanes without a way".to_owned());
        }
        within("current_m", self.current_m, 0.0, 10.0)?;
        within("current_deg", self.current_deg, 0.0, 90.0)?;
        within("push_m", self.push_m, 0.0, 1.0)?;
        within("push_deg", self.push_deg, 0.0, 45.0)
    }
}
