//! The configuration as resolved: every default filled in, every value checked.

use super::stage_options::{
    DensifyConfig, EvaluateConfig, FeaturesConfig, MaskConfig, MatchingConfig, OrientConfig, ReportConfig, SurfaceConfig,
};
use nalgebra::UnitQuaternion;
use scene::{CameraModel, FlatPort, Rigid3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// What a run does and with what.
#[derive(Clone, Debug)]
pub struct Config {
    /// The dive.toml.
    pub file: PathBuf,
    /// Name of the dive, for headings.
    pub name: String,
    /// Folder that the run writes to.
    pub output: PathBuf,
    /// How exposures pair up into frames.
    pub frames_from: FramesFrom,
    /// The cameras, at least one; the first is the reference of the rig.
    pub cameras: Vec<CameraConfig>,
    /// What is known of the mounting of the cameras.
    pub rig: RigConfig,
    /// Known lengths in the scene.
    pub scale_bars: Vec<ScaleBarConfig>,
    /// Where the origin of the model's frame lies in the world of the sensors and control points: east, north, up, metres.
    pub origin_m: [f64; 3],
    /// The log of the vehicle's sensors.
    pub sensors: Option<SensorsConfig>,
    /// Points with known coordinates.
    pub control_points: Vec<ControlPointConfig>,
    /// Options of the stage `mask`.
    pub mask: MaskConfig,
    /// Options of the stage `features`.
    pub features: FeaturesConfig,
    /// Options of the stage `matching`.
    pub matching: MatchingConfig,
    /// Options of the stage `orient`.
    pub orient: OrientConfig,
    /// Options of the stage `densify`.
    pub densify: DensifyConfig,
    /// Options of the stage `surface`.
    pub surface: SurfaceConfig,
    /// Options of the stage `evaluate`.
    pub evaluate: EvaluateConfig,
    /// Options of the stage `report`.
    pub report: ReportConfig,
}

/// How exposures of several cameras pair up into frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FramesFrom {
    /// The n-th image of every camera.
    Order,
    /// Equal file names without extension, or else the last number in them.
    Stem,
    /// The time of exposure in the EXIF data, or of the video frame.
    Timestamp,
}

/// A camera.
#[derive(Clone, Debug)]
pub struct CameraConfig {
    /// Name, unique, safe as a folder name.
    pub name: String,
    /// Where its images come from.
    pub images: ImageSource,
    /// Pattern of its mask files, with `{stem}` in it.
    pub mask: Option<MaskPattern>,
    /// What is known of its interior orientation.
    pub interior: InteriorConfig,
}

/// Where images come from.
#[derive(Clone, Debug, PartialEq)]
pub enum ImageSource {
    /// Files, in natural order of their names, at least one.
    Files(Vec<PathBuf>),
    /// Frames of a video.
    Video {
        /// The file.
        file: PathBuf,
        /// Frames a second that are taken.
        rate_hz: f64,
        /// Time of the first frame that is taken, seconds.
        offset_secs: f64,
    },
}

/// Where the mask of an image lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskPattern {
    /// The folder that relative patterns start from.
    pub folder: PathBuf,
    /// The pattern as written.
    pub pattern: String,
}

impl MaskPattern {
    /// The mask file of an image.
    #[must_use]
    pub fn file(&self, stem: &str) -> PathBuf {
        self.folder.join(self.pattern.replace("{stem}", stem))
    }
}

/// What is known of an interior orientation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InteriorConfig {
    /// The model.
    #[serde(serialize_with = "model_name")]
    pub model: CameraModel,
    /// Image size that the parameters belong to, pixels; that of the images when absent.
    pub size: Option<(u32, u32)>,
    /// The given parameters, in the order of the model; `None` for one that is not given. Empty when none is.
    pub params: Vec<Option<f64>>,
    /// The given parameters are not refined.
    pub fixed: bool,
    /// Whether each parameter of the model keeps its value where the others are refined; empty where none does.
    pub held: Vec<bool>,
    /// Standard deviation of each given parameter; empty where none is given.
    pub sigmas: Vec<Option<f64>>,
    /// The window that it looks through, where the parameters are those of the lens in air.
    #[serde(serialize_with = "port_values", skip_serializing_if = "Option::is_none")]
    pub port: Option<FlatPort>,
}

/// Normal, lengths and indices, as they enter fingerprints.
fn port_values<S: serde::Serializer>(port: &Option<FlatPort>, serializer: S) -> Result<S::Ok, S::Error> {
    port.as_ref().map(FlatPort::values).serialize(serializer)
}

fn model_name<S: serde::Serializer>(model: &CameraModel, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(model.name())
}

/// How the cameras are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RigMode {
    /// One pose a frame.
    Rigid,
    /// One pose an image, constrained by known distances.
    Baselines,
    /// One pose an image.
    None,
}

/// What is known of the mounting of the cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct RigConfig {
    /// How the cameras are treated.
    pub mode: RigMode,
    /// Known poses in the rig, one entry a camera; the first camera has the identity where any is known.
    pub poses: Vec<Option<PoseConfig>>,
    /// Known distances.
    pub baselines: Vec<BaselineConfig>,
}

/// A known pose in the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseConfig {
    /// The pose, metres.
    pub cam_from_rig: Rigid3,
    /// Standard deviations of rotation (radians) and translation (metres); `None` keeps the pose fixed.
    pub sigma: Option<(f64, f64)>,
}

/// A known distance between two cameras.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BaselineConfig {
    /// Indices of the cameras.
    pub cameras: (usize, usize),
    /// Metres.
    pub length_m: f64,
    /// Standard deviation, metres.
    pub sigma_m: f64,
}

/// A known length in the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScaleBarConfig {
    /// Name, for the report.
    pub name: String,
    /// Metres.
    pub length_m: f64,
    /// Standard deviation, metres.
    pub sigma_m: f64,
    /// Only compared, not used.
    pub check: bool,
    /// Both ends are targets.
    pub target: Option<TargetConfig>,
    /// Where both ends were picked.
    pub ends: [Vec<PickConfig>; 2],
}

/// The log of the vehicle's sensors, and what is known of them. Lever arms are in the frame of the first camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorsConfig {
    /// The log. Not part of the options: its content is an input.
    #[serde(skip)]
    pub file: PathBuf,
    /// Time in the log at the time 0 of the images, seconds.
    pub offset_secs: f64,
    /// Time between the files of a camera, for images that do not tell theirs, seconds.
    pub interval_secs: Option<f64>,
    /// How much later than it was measured a position stands in the log, seconds.
    pub position_latency_secs: f64,
    /// Standard deviation of each coordinate of a position, metres.
    pub position_sigma_m: f64,
    /// Where the transponder is, metres.
    pub position_lever_m: [f64; 3],
    /// Standard deviation of a depth, metres.
    pub depth_sigma_m: f64,
    /// Where the pressure sensor is, metres.
    pub depth_lever_m: [f64; 3],
    /// Height of the water level in the world, metres.
    pub water_level_m: f64,
    /// Standard deviation of roll and pitch, degrees.
    pub tilt_sigma_deg: f64,
    /// Standard deviation of a heading, degrees.
    pub heading_sigma_deg: f64,
    /// Rotation from the body of the vehicle (x forward, y starboard, z down) to the first camera.
    #[serde(serialize_with = "wxyz")]
    pub camera_from_body: UnitQuaternion<f64>,
}

fn wxyz<S: serde::Serializer>(rotation: &UnitQuaternion<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    let q = rotation.quaternion();
    [q.w, q.i, q.j, q.k].serialize(serializer)
}

/// A point with known coordinates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ControlPointConfig {
    /// Name, for the report.
    pub name: String,
    /// East, north and up, metres.
    pub xyz_m: [f64; 3],
    /// Standard deviation of each coordinate, metres.
    pub sigma_m: f64,
    /// Only compared, not used.
    pub check: bool,
    /// It is a target.
    pub target: Option<TargetConfig>,
    /// Where it was picked.
    pub picks: Vec<PickConfig>,
}

/// A circular target, whose centre is measured in each image near where it was picked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TargetConfig {
    /// How far from the pick its centre may be, pixels.
    pub search_radius_px: f64,
}

/// A point picked in an image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PickConfig {
    /// Name of the image, `camera/file`.
    pub image: String,
    /// Column, pixels.
    pub x: f64,
    /// Row, pixels.
    pub y: f64,
}
