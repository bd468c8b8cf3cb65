//! A small model for the tests of writers.

use crate::{
    Camera, CameraId, Frame, FrameId, Image, ImageId, KeypointIndex, Observation, Point, Reconstruction, Rig, RigId, Rigid3, Scale,
};
use nalgebra::{UnitQuaternion, Vector3};

/// An oriented image, and one that is not, of one camera; points that project onto their keypoints.
pub(super) fn one_image(camera: Camera) -> Reconstruction {
    let pose = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5)), Vector3::new(0.1, -0.3, 4.0));
    let world = [[0.2, 0.1, 0.3], [-0.7, 0.4, 0.0], [0.9, -0.6, -0.4], [-0.3, -0.8, 0.6]].map(Vector3::from);
    let mut keypoints = Vec::new();
    let mut points = Vec::new();
    for xyz in world {
        let pixel = camera.project(&pose.apply(&xyz)).expect("in front");
        let track = vec![Observation { image: ImageId(0), keypoint: KeypointIndex::new(keypoints.len()) }];
        points.push(Point { xyz, colour: [9, 8, 7], error_px: 0.0, track });
        keypoints.push([pixel.x as f32, pixel.y as f32]);
    }
    let frame = |exposure, rig_from_world| Frame { rig: RigId(0), exposure, rig_from_world };
    let image = |i: usize| Image { name: format!("C1/{}.jpg", i + 1), camera: CameraId(0), frame: FrameId::new(i) };
    Reconstruction {
        cameras: vec![camera],
        rigs: vec![Rig::single(CameraId(0))],
        frames: vec![frame(0, Some(pose)), frame(1, None)],
        images: vec![image(0), image(1)],
        keypoints: vec![keypoints, Vec::new()],
        points,
        scale: Scale::Metric,
    }
}
