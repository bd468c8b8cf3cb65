//! The truth of a dive as a reconstruction.

use super::scene::DiveScene;
use scene::{Camera, CameraId, Frame, FrameId, Image, Reconstruction, Rig, RigId, RigSensor, Scale};

impl DiveScene {
    /// True cameras (as calibrated in the water), rig and poses, in metres, without points; images are named as by
    /// [`DiveScene::name`]. What [`crate::assert_near`] compares with.
    #[must_use]
    pub fn truth(&self, extension: &str) -> Reconstruction {
        let sensors = self.cameras.iter().enumerate();
        let sensors = sensors.map(|(c, camera)| RigSensor { camera: CameraId::new(c), cam_from_rig: camera.cam_from_rig }).collect();
        let frames = (0..self.exposures())
            .map(|e| Frame { rig: RigId(0), exposure: e as u32, rig_from_world: Some(self.rig_from_world(e)) })
            .collect();
        let shots = (0..self.cameras.len()).flat_map(|c| (0..self.exposures()).map(move |e| (c, e)));
        let images: Vec<Image> =
            shots.map(|(c, e)| Image { name: Self::name(c, e, extension), camera: CameraId::new(c), frame: FrameId::new(e) }).collect();
        Reconstruction {
            cameras: self.calibrated(),
            rigs: vec![Rig { sensors }],
            frames,
            keypoints: vec![Vec::new(); images.len()],
            images,
            points: Vec::new(),
            scale: Scale::Metric,
        }
    }

    /// The interior orientations as calibrated in the water.
    #[must_use]
    pub fn calibrated(&self) -> Vec<Camera> {
        self.cameras.iter().map(|camera| camera.calibrated.camera).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DiveOptions, DiveScene};
    use scene::ImageId;

    #[test]
    fn truth_holds_every_frame_at_the_given_baseline() {
        let dive = DiveScene::new(&DiveOptions::small(3, 16, 16)).expect("possible");
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
