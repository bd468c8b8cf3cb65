//! What is adjusted: parameter blocks and observations.

use nalgebra::{Vector2, Vector3};
use scene::camera::MAX_CAMERA_PARAMS;
use scene::{Camera, Rigid3};

/// Prior knowledge of a pose `b_from_a`.
///
/// Residuals: log(R R_prior^-1) / `sigma_rotation_rad`, in the axes of b, and (c - c_prior) / `sigma_translation`, where
/// c is the origin of b in a: the place of the rig in the world for a frame, of the camera in the rig for a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePrior {
    /// The expected pose.
    pub pose: Rigid3,
    /// Standard deviation of the rotation about each axis, radians.
    pub sigma_rotation_rad: f64,
    /// Standard deviation of the origin along each axis, in the unit of the world.
    pub sigma_translation: f64,
}

/// A pose that may be adjusted.
///
/// A step (w, d) makes it (exp(w) R, t + d): see [`crate::lie`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseBlock {
    /// The pose.
    pub pose: Rigid3,
    /// Whether it may change.
    pub free: bool,
    /// Prior knowledge; ignored when not free.
    pub prior: Option<PosePrior>,
}

impl PoseBlock {
    /// A pose that stays.
    #[must_use]
    pub fn fixed(pose: Rigid3) -> Self {
        Self { pose, free: false, prior: None }
    }

    /// A pose to be adjusted, without prior.
    #[must_use]
    pub fn free(pose: Rigid3) -> Self {
        Self { pose, free: true, prior: None }
    }
}

/// Prior knowledge of one camera parameter: the residual is (parameter - value) / sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParamPrior {
    /// The expected value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A camera whose parameters may be adjusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraBlock {
    /// The camera.
    pub camera: Camera,
    /// Which parameters may change; entries beyond the model's number of parameters are ignored.
    pub free: [bool; MAX_CAMERA_PARAMS],
    /// Prior knowledge of each parameter; ignored where not free.
    pub priors: [Option<ParamPrior>; MAX_CAMERA_PARAMS],
}

impl CameraBlock {
    /// A camera that stays.
    #[must_use]
    pub fn fixed(camera: Camera) -> Self {
        Self { camera, free: [false; MAX_CAMERA_PARAMS], priors: [None; MAX_CAMERA_PARAMS] }
    }
}

/// A scene point that may be adjusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointBlock {
    /// Position in the world.
    pub xyz: Vector3<f64>,
    /// Whether it may change.
    pub free: bool,
}

/// A point measured in an image: the residual is (projection - pixel) / sigma, with
/// `x_in_cam = cam_from_rig (rig_from_world x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageObservation {
    /// Index of the frame.
    pub frame: u32,
    /// Index of the sensor.
    pub sensor: u32,
    /// Index of the camera.
    pub camera: u32,
    /// Index of the point.
    pub point: u32,
    /// Where it was seen.
    pub pixel: Vector2<f64>,
    /// Standard deviation along each image axis, pixels.
    pub sigma_px: f64,
}

/// A measured distance of two projection centres: the residual is (distance - length) / sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baseline {
    /// Frame and sensor of one end.
    pub a: (u32, u32),
    /// Frame and sensor of the other.
    pub b: (u32, u32),
    /// The distance, in the unit of the world.
    pub length: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A measured distance of two points: the residual is (distance - length) / sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleBar {
    /// Index of one point.
    pub a: u32,
    /// Index of the other.
    pub b: u32,
    /// The distance, in the unit of the world.
    pub length: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A measured place of a point of the rig, such as an antenna or a pressure sensor: the residual along each axis of the world is
/// (R^T (`in_rig` - t) - `xyz`) / sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionObservation {
    /// Index of the frame.
    pub frame: u32,
    /// The point in the frame of the rig: the lever arm.
    pub in_rig: Vector3<f64>,
    /// Where it was, in the unit of the world.
    pub xyz: Vector3<f64>,
    /// Standard deviation along each axis of the world; infinite where it was not measured: a depth is a position with a z only.
    pub sigma: Vector3<f64>,
}

/// A direction of the world that was measured in the frame of the rig, such as that of gravity: two residuals, the sines of the angles
/// across it divided by sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionObservation {
    /// Index of the frame.
    pub frame: u32,
    /// Measured direction; its length does not matter.
    pub in_rig: Vector3<f64>,
    /// Known direction; its length does not matter.
    pub in_world: Vector3<f64>,
    /// Standard deviation of each angle, radians.
    pub sigma_rad: f64,
}

/// A measured heading of an axis of the rig, clockwise from the y axis (north) of a world whose z axis is up: the residual is the angle by
/// which the axis, seen from above, deviates, divided by sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingObservation {
    /// Index of the frame.
    pub frame: u32,
    /// The axis, in the frame of the rig.
    pub axis_in_rig: Vector3<f64>,
    /// Where it points, radians.
    pub heading_rad: f64,
    /// Standard deviation, radians.
    pub sigma_rad: f64,
}

/// A point with known coordinates: the residual along each axis is (position - `xyz`) / sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// Index of the point.
    pub point: u32,
    /// Known position.
    pub xyz: Vector3<f64>,
    /// Standard deviation along each axis of the world; infinite where it is not known.
    pub sigma: Vector3<f64>,
}

/// A bundle adjustment problem. Observations name the blocks by index.
///
/// Blocks that nothing refers to are allowed and stay as they are, as do blocks that are not free, at no cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// Interior orientations.
    pub cameras: Vec<CameraBlock>,
    /// `cam_from_rig` of each sensor. A single camera is a fixed sensor with the identity.
    pub sensors: Vec<PoseBlock>,
    /// `rig_from_world` of each frame.
    pub frames: Vec<PoseBlock>,
    /// Scene points.
    pub points: Vec<PointBlock>,
    /// Points measured in images.
    pub observations: Vec<ImageObservation>,
    /// Distances of projection centres.
    pub baselines: Vec<Baseline>,
    /// Distances of points.
    pub scale_bars: Vec<ScaleBar>,
    /// Places of points of the rig.
    pub positions: Vec<PositionObservation>,
    /// Directions seen from the rig.
    pub directions: Vec<DirectionObservation>,
    /// Headings of the rig.
    pub headings: Vec<HeadingObservation>,
    /// Points with known coordinates.
    pub control_points: Vec<ControlPoint>,
}
