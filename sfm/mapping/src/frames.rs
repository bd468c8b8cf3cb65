//! Rigs, frames and images of a model, before anything is oriented.

use crate::input::{MapInput, RigMode};
use scene::{CameraId, Frame, FrameId, Image, Rig, RigId, RigSensor, Rigid3};
use std::collections::BTreeMap;

/// How images share poses.
pub(crate) struct Layout {
    pub rigs: Vec<Rig>,
    pub frames: Vec<Frame>,
    pub images: Vec<Image>,
}

impl Layout {
    /// Every image is a frame of its own.
    pub(crate) fn independent(input: &MapInput) -> Self {
        let rigs = (0..input.cameras.len()).map(|c| Rig::single(CameraId::new(c))).collect();
        let frames =
            input.images.iter().map(|image| Frame { rig: RigId(image.camera.0), exposure: image.exposure, rig_from_world: None }).collect();
        let images = input
            .images
            .iter()
            .enumerate()
            .map(|(i, image)| Image { name: image.name.clone(), camera: image.camera, frame: FrameId::new(i) })
            .collect();
        Self { rigs, frames, images }
    }

    /// All images of an exposure are one frame of one rig with the given `cam_from_rig` of each camera.
    pub(crate) fn rigid(input: &MapInput, cam_from_rig: &[Rigid3]) -> Self {
        let sensors =
            cam_from_rig.iter().enumerate().map(|(c, &cam_from_rig)| RigSensor { camera: CameraId::new(c), cam_from_rig }).collect();
        let mut frame_of: BTreeMap<u32, FrameId> = BTreeMap::new();
        for image in &input.images {
            frame_of.insert(image.exposure, FrameId(0));
        }
        for (i, frame) in frame_of.values_mut().enumerate() {
            *frame = FrameId::new(i);
        }
        let frames = frame_of.keys().map(|&exposure| Frame { rig: RigId(0), exposure, rig_from_world: None }).collect();
        let images = input
            .images
            .iter()
            .map(|image| Image { name: image.name.clone(), camera: image.camera, frame: frame_of[&image.exposure] })
            .collect();
        Self { rigs: vec![Rig { sensors }], frames, images }
    }
}

/// Pose of a camera in the rig, where the input gives it (camera 0 is the reference).
pub(crate) fn given_pose(input: &MapInput, camera: usize) -> Option<Rigid3> {
    if camera == 0 { Some(Rigid3::identity()) } else { input.rig.poses.get(camera).copied().flatten().map(|p| p.cam_from_rig) }
}

/// Poses in the rig of all cameras, where the input gives them all.
pub(crate) fn known_rig(input: &MapInput) -> Option<Vec<Rigid3>> {
    if input.rig.mode != RigMode::Rigid || input.cameras.len() < 2 {
        return None;
    }
    (0..input.cameras.len()).map(|c| given_pose(input, c)).collect()
}
