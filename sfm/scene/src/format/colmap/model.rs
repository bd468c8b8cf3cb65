//! What of a reconstruction goes into a COLMAP model.

use super::camera::{ColmapCameraModel, to_colmap};
use crate::format::FormatError;
use crate::{FrameId, ImageId, Observation, Reconstruction, Rigid3};

/// COLMAP's mark of a keypoint that shows no point.
pub(super) const NO_POINT: u64 = u64::MAX;

/// A checked view of a reconstruction, ready to be written file by file.
pub struct ColmapModel<'a> {
    pub(super) reconstruction: &'a Reconstruction,
    pub(super) cameras: Vec<(ColmapCameraModel, Vec<f64>)>,
    /// Oriented frames that have images, in order of id, with their images in order of id.
    pub(super) frames: Vec<(FrameId, Rigid3, Vec<ImageId>)>,
    /// Images of these frames in order of id.
    pub(super) images: Vec<(ImageId, Rigid3)>,
    /// COLMAP's point id of each keypoint of each image.
    pub(super) point_of_keypoint: Vec<Vec<u64>>,
    exported: Vec<bool>,
}

impl<'a> ColmapModel<'a> {
    /// Selects the oriented part and checks that COLMAP can hold it.
    ///
    /// # Errors
    /// [`FormatError::NotRepresentable`] where a camera has no COLMAP model (Brown's with shear, any behind a port), a reference points to
    /// nothing, an image's camera is not part of its rig, two points share a keypoint, a number is not finite, or a name
    /// is empty or holds a control character.
    pub fn new(reconstruction: &'a Reconstruction) -> Result<Self, FormatError> {
        let cameras = reconstruction.cameras.iter().enumerate().map(|(i, camera)| {
            to_colmap(camera)
                .ok_or_else(|| refuse(format!("camera {i} has shear (C2) or stands behind a port, which no COLMAP camera model has")))
        });
        let cameras = cameras.collect::<Result<_, _>>()?;
        check_rigs(reconstruction)?;
        let (frames, images) = oriented(reconstruction)?;
        let mut exported = vec![false; reconstruction.images.len()];
        let mut point_of_keypoint = vec![Vec::new(); reconstruction.images.len()];
        for &(image, _) in &images {
            exported[image.index()] = true;
            let keypoints = reconstruction.keypoints.get(image.index());
            let keypoints = keypoints.ok_or_else(|| refuse(format!("image {image} has no list of keypoints")))?;
            point_of_keypoint[image.index()] = vec![NO_POINT; keypoints.len()];
        }
        let mut model = Self { reconstruction, cameras, frames, images, point_of_keypoint, exported };
        model.assign_points()?;
        Ok(model)
    }

    fn assign_points(&mut self) -> Result<(), FormatError> {
        let reconstruction = self.reconstruction;
        for (id, point) in reconstruction.points_with_ids() {
            if !(point.xyz.iter().all(|v| v.is_finite()) && point.error_px.is_finite()) {
                return Err(refuse(format!("point {id} is not finite")));
            }
            for observation in &point.track {
                let Observation { image, keypoint } = *observation;
                match self.exported.get(image.index()) {
                    None => return Err(refuse(format!("point {id} is seen in image {image}, which does not exist"))),
                    Some(false) => continue,
                    Some(true) => {}
                }
                match self.point_of_keypoint[image.index()].get_mut(keypoint.index()) {
                    None => {
                        return Err(refuse(format!("point {id} is seen at keypoint {keypoint} of image {image}, which does not exist")));
                    }
                    Some(slot) if *slot != NO_POINT => {
                        return Err(refuse(format!("keypoint {keypoint} of image {image} shows two points")));
                    }
                    Some(slot) => *slot = u64::from(id.0) + 1,
                }
            }
        }
        Ok(())
    }

    /// Each point that is written: COLMAP's id, the index of ours, the observations in written images.
    pub(super) fn points(&self) -> impl Iterator<Item = (u64, usize, Vec<Observation>)> + '_ {
        self.reconstruction.points.iter().enumerate().filter_map(|(i, point)| {
            let track: Vec<_> = point.track.iter().copied().filter(|o| self.exported[o.image.index()]).collect();
            (!track.is_empty()).then_some((i as u64 + 1, i, track))
        })
    }
}

fn refuse(what: String) -> FormatError {
    FormatError::NotRepresentable { format: "a COLMAP model", what }
}

fn finite(pose: &Rigid3) -> bool {
    pose.rotation.coords.iter().chain(pose.translation.iter()).all(|v| v.is_finite())
}

fn check_rigs(reconstruction: &Reconstruction) -> Result<(), FormatError> {
    for (i, rig) in reconstruction.rigs.iter().enumerate() {
        for (j, sensor) in rig.sensors.iter().enumerate() {
            if sensor.camera.index() >= reconstruction.cameras.len() {
                return Err(refuse(format!("rig {i} holds camera {}, which does not exist", sensor.camera)));
            }
            if !finite(&sensor.cam_from_rig) {
                return Err(refuse(format!("the pose of camera {} in rig {i} is not finite", sensor.camera)));
            }
            if j == 0 && sensor.cam_from_rig != Rigid3::identity() {
                return Err(refuse(format!("the first sensor of rig {i} is not at the identity")));
            }
            if rig.sensors[..j].iter().any(|s| s.camera == sensor.camera) {
                return Err(refuse(format!("rig {i} holds camera {} twice", sensor.camera)));
            }
        }
    }
    Ok(())
}

type Oriented = (Vec<(FrameId, Rigid3, Vec<ImageId>)>, Vec<(ImageId, Rigid3)>);

fn oriented(reconstruction: &Reconstruction) -> Result<Oriented, FormatError> {
    let mut images = Vec::new();
    let mut images_of_frame = vec![Vec::new(); reconstruction.frames.len()];
    for (i, image) in reconstruction.images.iter().enumerate() {
        let frame = reconstruction.frames.get(image.frame.index());
        let frame = frame.ok_or_else(|| refuse(format!("image {i} belongs to frame {}, which does not exist", image.frame)))?;
        let Some(rig_from_world) = frame.rig_from_world else { continue };
        if image.name.is_empty() || image.name.chars().any(char::is_control) {
            return Err(refuse(format!("the name of image {i} is empty or holds a control character")));
        }
        let rig = reconstruction.rigs.get(frame.rig.index());
        let Some(cam_from_rig) = rig.and_then(|rig| rig.cam_from_rig(image.camera)) else {
            return Err(refuse(format!("camera {} of image {i} is not part of rig {}", image.camera, frame.rig)));
        };
        if !finite(&rig_from_world) {
            return Err(refuse(format!("the pose of frame {} is not finite", image.frame)));
        }
        images.push((ImageId::new(i), cam_from_rig * rig_from_world));
        images_of_frame[image.frame.index()].push(ImageId::new(i));
    }
    let mut frames = Vec::new();
    for (i, (frame, images)) in reconstruction.frames.iter().zip(images_of_frame).enumerate() {
        if let (Some(pose), false) = (frame.rig_from_world, images.is_empty()) {
            frames.push((FrameId::new(i), pose, images));
        }
    }
    Ok((frames, images))
}
