//! What an orientation starts from.

use nalgebra::Vector3;
use scene::{Camera, CameraId, ImageId, Rigid3, VerifiedPair};

/// Everything that [`crate::orient`] needs; lists are indexed by the ids of `scene`.
#[derive(Clone, Debug, Default)]
pub struct MapInput {
    /// Cameras.
    pub cameras: Vec<CameraInput>,
    /// Images.
    pub images: Vec<ImageInput>,
    /// Keypoints of each image, pixels.
    pub keypoints: Vec<Vec<[f32; 2]>>,
    /// Standard deviation of each keypoint along each image axis, pixels: the weight of its observation. An empty list for an image whose
    /// keypoints all have 1.
    pub sigmas_px: Vec<Vec<f32>>,
    /// Colour of each keypoint, or an empty list for an image whose colours are unknown.
    pub colours: Vec<Vec<[u8; 3]>>,
    /// Verified pairs.
    pub pairs: Vec<VerifiedPair>,
    /// How the cameras are mounted.
    pub rig: RigInput,
    /// Known lengths in the scene.
    pub scale_bars: Vec<ScaleBarInput>,
    /// What ties the model to the world.
    pub world: WorldInput,
}

/// What was measured in the world: metres, x to the east, y to the north, z up. Exposures that no image belongs to are ignored.
#[derive(Clone, Debug, Default)]
pub struct WorldInput {
    /// Places of points of the rig.
    pub positions: Vec<PositionInput>,
    /// Directions of the vertical.
    pub ups: Vec<UpInput>,
    /// Headings.
    pub headings: Vec<HeadingInput>,
    /// Points with known coordinates.
    pub control_points: Vec<ControlPointInput>,
}

impl WorldInput {
    /// Whether nothing is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty() && self.ups.is_empty() && self.headings.is_empty() && self.control_points.is_empty()
    }
}

/// A measured place of a point of the rig: an acoustic position, or a depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionInput {
    /// The exposure.
    pub exposure: u32,
    /// The point that was measured, in the frame of the rig, metres: the lever arm.
    pub in_rig: Vector3<f64>,
    /// Where it was.
    pub xyz: Vector3<f64>,
    /// Standard deviation along each axis, metres; infinite where it was not measured.
    pub sigma_m: Vector3<f64>,
}

/// The direction of the vertical, as an inclinometer or accelerometers give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpInput {
    /// The exposure.
    pub exposure: u32,
    /// Up, in the frame of the rig; its length does not matter.
    pub up_in_rig: Vector3<f64>,
    /// Standard deviation, radians.
    pub sigma_rad: f64,
}

/// The heading of an axis of the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingInput {
    /// The exposure.
    pub exposure: u32,
    /// The axis, in the frame of the rig.
    pub axis_in_rig: Vector3<f64>,
    /// Where it points seen from above, from north over east, radians.
    pub heading_rad: f64,
    /// Standard deviation, radians.
    pub sigma_rad: f64,
}

/// A point with known coordinates that was picked in images.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlPointInput {
    /// Where it was picked.
    pub picks: Vec<ImagePick>,
    /// Where it is.
    pub xyz: Vector3<f64>,
    /// Standard deviation along each axis, metres; infinite where it is not known.
    pub sigma_m: Vector3<f64>,
    /// Takes no part in the adjustment and is only reported.
    pub check: bool,
}

/// A camera and how far its interior orientation is trusted.
#[derive(Clone, Debug)]
pub struct CameraInput {
    /// Unique name.
    pub name: String,
    /// Start values.
    pub camera: Camera,
    /// The values are not refined.
    pub fixed: bool,
    /// Whether each parameter keeps its value where the others are refined; empty where none does.
    pub held: Vec<bool>,
    /// Standard deviation of each start value, which is then an observation; empty where none is known. A principal point with one is
    /// refined in any case.
    pub sigmas: Vec<Option<f64>>,
    /// Other start values for a camera of which little is known: the one with which a small model fits best is taken.
    pub alternatives: Vec<Camera>,
}

/// An image.
#[derive(Clone, Debug)]
pub struct ImageInput {
    /// Unique name.
    pub name: String,
    /// The camera that took it.
    pub camera: CameraId,
    /// Number of the simultaneous exposure: images that share it were taken at one instant.
    pub exposure: u32,
}

/// What is known of the mounting of the cameras.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RigMode {
    /// One pose a frame. Poses of cameras in the rig that are not given are solved for.
    Rigid,
    /// Every image has its own pose; known distances between cameras constrain them (Rofallski et al. 2020).
    Baselines,
    /// Every image has its own pose.
    #[default]
    None,
}

/// Known pose of a camera in the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigPoseInput {
    /// The pose; translation in metres.
    pub cam_from_rig: Rigid3,
    /// Standard deviations of rotation (radians) and translation (metres): the pose is refined with this weight. `None`
    /// keeps it fixed.
    pub sigma: Option<(f64, f64)>,
}

/// Known distance between the projection centres of two cameras in every exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineInput {
    /// The cameras.
    pub cameras: (CameraId, CameraId),
    /// Distance, metres.
    pub length_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
}

/// What is known of the rig.
#[derive(Clone, Debug, Default)]
pub struct RigInput {
    /// How the cameras are treated.
    pub mode: RigMode,
    /// Pose in the rig of each camera; camera 0 is the reference and needs none. Empty when none is known.
    pub poses: Vec<Option<RigPoseInput>>,
    /// Known baselines.
    pub baselines: Vec<BaselineInput>,
}

/// A point picked in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImagePick {
    /// The image.
    pub image: ImageId,
    /// Where, pixels.
    pub pixel: [f64; 2],
    /// Standard deviation along each axis of the image, pixels.
    pub sigma_px: f64,
}

/// Standard deviation of what somebody picked by eye, pixels.
pub const PICK_SIGMA_PX: f64 = 1.0;

/// A known length between two points of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleBarInput {
    /// Where each end was picked.
    pub ends: [Vec<ImagePick>; 2],
    /// Length, metres.
    pub length_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
    /// Takes no part in the adjustment and is only reported.
    pub check: bool,
}
