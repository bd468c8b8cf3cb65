//! The truth of a dive as a reconstruction.

use super::scene::Dive;
use scene::{Camera, CameraId, Frame, FrameId, Image, Reconstruction, Rig, RigId, RigSensor, Rigid3, Scale};

impl Dive {
    /// Name of a frame: `C1/0000` for the first camera and exposure, and `extension` after a dot.
    #[must_use]
    pub fn name(camera: usize, exposure: usize, extension: &str) -> String {
        format!("C{}/{exposure:04}.{extension}", camera + 1)
    }

    /// True cameras, rig and poses, in metres, without points; images are named as by [`Dive::name`]. What
    /// [`crate::assert_near`] compares with.
    #[must_use]
    pub fn truth(&self, extension: &str) -> Reconstruction {
        reconstruction(&self.cameras, &self.cam_from_rig, &self.rig_from_world, extension)
    }
}

pub(super) fn reconstruction(cameras: &[Camera], cam_from_rig: &[Rigid3], rig_from_world: &[Rigid3], extension: &str) -> Reconstruction {
    let sensors = cam_from_rig.iter().enumerate();
    let rig = Rig { sensors: sensors.map(|(c, &cam_from_rig)| RigSensor { camera: CameraId::new(c), cam_from_rig }).collect() };
    let poses = rig_from_world.iter().enumerate();
    let frames = poses.map(|(e, &pose)| Frame { rig: RigId(0), exposure: e as u32, rig_from_world: Some(pose) }).collect();
    let shots = (0..cameras.len()).flat_map(|c| (0..rig_from_world.len()).map(move |e| (c, e)));
    let images: Vec<Image> =
        shots.map(|(c, e)| Image { name: Dive::name(c, e, extension), camera: CameraId::new(c), frame: FrameId::new(e) }).collect();
    Reconstruction {
        cameras: cameras.to_vec(),
        rigs: vec![rig],
        frames,
        keypoints: vec![Vec::new(); images.len()],
        images,
        points: Vec::new(),
        scale: Scale::Metric,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DiveOptions, render_dive};
    use scene::ImageId;

    #[test]
    fn truth_holds_every_frame_at_the_given_baseline() {
        let dive = render_dive(&DiveOptions { exposures: 3, width: 16, height: 10, ..DiveOptions::default() });
        let truth = dive.truth("png");
        assert_eq!(truth.oriented_images().count(), 6);
        assert_eq!((truth.images[0].name.as_str(), truth.images[5].name.as_str()), ("C1/0000.png", "C2/0002.png"));
        let centre = |i| truth.cam_from_world(ImageId(i)).expect("oriented").centre();
        for exposure in 0..3 {
            // |(0.3998, 0.006, 0.0105)| of the rig's second camera.
            assert!(((centre(exposure) - centre(3 + exposure)).norm() - 0.4).abs() < 1e-4);
        }
    }
}
