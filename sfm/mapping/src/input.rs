//! What an orientation starts from.

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
}

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
