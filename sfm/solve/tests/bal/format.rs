//! The text format of *Bundle Adjustment in the Large*.

use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};
use scene::camera::MAX_CAMERA_PARAMS;
use scene::{Camera, CameraModel, Rigid3};
use solve::adjust::{CameraBlock, ImageObservation, PointBlock, PoseBlock, Problem};

/// The problem of a file: one frame and one camera (focal length and two radial terms) an image. `None` when it is cut short.
///
/// BAL's cameras look along -z with y up, and p = -P / P.z. Turned by pi about x they look along z with y down; u stays
/// and v changes sign. Its radial polynomial is ours.
pub fn parse(text: &str) -> Option<Problem> {
    let mut numbers = text.split_ascii_whitespace().map_while(|n| n.parse::<f64>().ok());
    let mut next = || numbers.next();
    let [cameras, points, observations] = [next()?, next()?, next()?].map(|n| n as usize);
    let mut problem = Problem { sensors: vec![PoseBlock::fixed(Rigid3::identity())], ..Problem::default() };
    for _ in 0..observations {
        let [image, point, x, y] = [next()?, next()?, next()?, next()?];
        let (frame, camera) = (image as u32, image as u32);
        problem.observations.push(ImageObservation {
            frame,
            sensor: 0,
            camera,
            point: point as u32,
            pixel: Vector2::new(x, -y),
            sigma_px: 1.0,
        });
    }
    let turn = UnitQuaternion::new_normalize(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    for _ in 0..cameras {
        let [w, t] = [Vector3::new(next()?, next()?, next()?), Vector3::new(next()?, next()?, next()?)];
        let [f, k1, k2] = [next()?, next()?, next()?];
        problem.frames.push(PoseBlock::free(Rigid3::new(turn * UnitQuaternion::from_scaled_axis(w), turn * t)));
        let camera = Camera::new(CameraModel::Radial, 1, 1, &[f, 0.0, 0.0, k1, k2]).ok()?;
        let mut free = [false; MAX_CAMERA_PARAMS];
        (free[0], free[3], free[4]) = (true, true, true);
        problem.cameras.push(CameraBlock { free, ..CameraBlock::fixed(camera) });
    }
    for _ in 0..points {
        problem.points.push(PointBlock { xyz: Vector3::new(next()?, next()?, next()?), free: true });
    }
    Some(problem)
}
