//! Rigs, frames, images, points, and the reconstruction that holds them.

use crate::{Camera, CameraId, FrameId, ImageId, KeypointIndex, PointId, RigId, Rigid3};
use nalgebra::Vector3;

/// Whether a length in the world is a length in metres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// World units are metres.
    Metric,
    /// World units are unknown.
    Arbitrary,
}

/// One camera of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigSensor {
    /// The camera.
    pub camera: CameraId,
    /// Its pose in the rig. The first sensor of a rig is the reference and has the identity: this fixes the gauge.
    pub cam_from_rig: Rigid3,
}

/// Calibration of cameras with respect to each other. A camera that moves alone is a rig of one sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// The sensors, the reference first.
    pub sensors: Vec<RigSensor>,
}

impl Rig {
    /// A rig of one camera.
    #[must_use]
    pub fn single(camera: CameraId) -> Self {
        Self { sensors: vec![RigSensor { camera, cam_from_rig: Rigid3::identity() }] }
    }

    /// Pose of `camera` in the rig, or `None` when the camera is not part of it.
    #[must_use]
    pub fn cam_from_rig(&self, camera: CameraId) -> Option<Rigid3> {
        self.sensors.iter().find(|s| s.camera == camera).map(|s| s.cam_from_rig)
    }
}

/// One posed instant of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The rig that was exposed.
    pub rig: RigId,
    /// Number of the simultaneous exposure. Frames of cameras that are oriented one by one share it.
    pub exposure: u32,
    /// Pose, or `None` while it is not oriented.
    pub rig_from_world: Option<Rigid3>,
}

/// One exposure of one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Name, unique, `camera/file`.
    pub name: String,
    /// The camera that took it.
    pub camera: CameraId,
    /// The frame that it belongs to.
    pub frame: FrameId,
}

/// A keypoint of an image that shows a scene point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Observation {
    /// The image.
    pub image: ImageId,
    /// The keypoint in it.
    pub keypoint: KeypointIndex,
}

/// A scene point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Position in the world.
    pub xyz: Vector3<f64>,
    /// sRGB colour.
    pub colour: [u8; 3],
    /// Mean reprojection error, pixels.
    pub error_px: f64,
    /// Its observations, sorted, at most one an image.
    pub track: Vec<Observation>,
}

/// Cameras, rigs, frames, images and points; each list is indexed by its id.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Interior orientations.
    pub cameras: Vec<Camera>,
    /// Rigs.
    pub rigs: Vec<Rig>,
    /// Frames, oriented or not.
    pub frames: Vec<Frame>,
    /// Images, oriented or not.
    pub images: Vec<Image>,
    /// Keypoint positions of each image in pixels; the observations index them.
    pub keypoints: Vec<Vec<[f32; 2]>>,
    /// Scene points.
    pub points: Vec<Point>,
    /// Unit of the world.
    pub scale: Scale,
}

impl Reconstruction {
    /// Pose of an image, or `None` when its frame is not oriented.
    ///
    /// # Panics
    /// When the image's camera is not part of its frame's rig, which breaks the type's invariant.
    #[must_use]
    pub fn cam_from_world(&self, image: ImageId) -> Option<Rigid3> {
        let image = &self.images[image.index()];
        let frame = &self.frames[image.frame.index()];
        let rig = &self.rigs[frame.rig.index()];
        let cam_from_rig = rig.cam_from_rig(image.camera).expect("the camera of an image is part of its frame's rig");
        frame.rig_from_world.map(|rig_from_world| cam_from_rig * rig_from_world)
    }

    /// Images whose frame is oriented, in order of id.
    pub fn oriented_images(&self) -> impl Iterator<Item = ImageId> + '_ {
        (0..self.images.len()).map(ImageId::new).filter(|&i| self.frames[self.images[i.index()].frame.index()].rig_from_world.is_some())
    }

    /// Pixel of an observation.
    #[must_use]
    pub fn pixel(&self, observation: Observation) -> nalgebra::Vector2<f64> {
        let [x, y] = self.keypoints[observation.image.index()][observation.keypoint.index()];
        nalgebra::Vector2::new(f64::from(x), f64::from(y))
    }

    /// Reprojection error of an observation of the point at `xyz`, pixels; `None` when the image is not oriented or the
    /// point does not project (it lies behind the camera).
    #[must_use]
    pub fn reprojection_error(&self, xyz: &Vector3<f64>, observation: Observation) -> Option<f64> {
        let cam_from_world = self.cam_from_world(observation.image)?;
        let camera = &self.cameras[self.images[observation.image.index()].camera.index()];
        Some((camera.project(&cam_from_world.apply(xyz))? - self.pixel(observation)).norm())
    }

    /// Number of observations of all points.
    #[must_use]
    pub fn observation_count(&self) -> usize {
        self.points.iter().map(|p| p.track.len()).sum()
    }

    /// Mean over all observations of the reprojection error, pixels (what COLMAP calls mean reprojection error is the
    /// mean over points of the mean over their observations, see [`Reconstruction::mean_point_error`]).
    #[must_use]
    pub fn reprojection_rms(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0usize);
        for point in &self.points {
            for &observation in &point.track {
                if let Some(error) = self.reprojection_error(&point.xyz, observation) {
                    sum += error * error;
                    count += 1;
                }
            }
        }
        (sum / count.max(1) as f64).sqrt()
    }

    /// Mean over points of [`Point::error_px`], pixels: comparable with COLMAP's mean reprojection error.
    #[must_use]
    pub fn mean_point_error(&self) -> f64 {
        self.points.iter().map(|p| p.error_px).sum::<f64>() / self.points.len().max(1) as f64
    }

    /// Every point's id and value.
    pub fn points_with_ids(&self) -> impl Iterator<Item = (PointId, &Point)> {
        self.points.iter().enumerate().map(|(i, p)| (PointId::new(i), p))
    }
}
