//! Rectification of a stereo pair, and how well it holds.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use scene::{Camera, Rigid3};

/// The common image plane of two cameras: its rows are epipolar lines of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectification {
    /// `rectified_from_cam` of both cameras.
    pub rotations: [UnitQuaternion<f64>; 2],
    /// Principal distance of both rectified images, pixels.
    pub focal_px: f64,
    /// Principal point of both, pixels.
    pub principal_px: [f64; 2],
    /// Distance of the projection centres, in the unit of the rig; depth = focal x baseline / disparity.
    pub baseline: f64,
}

/// How far points that both images show are from lying in one row of the rectified images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectificationError {
    /// Number of points.
    pub points: usize,
    /// Mean of the difference of rows, second less first, pixels.
    pub mean_px: f64,
    /// Its root mean square.
    pub rms_px: f64,
    /// The largest, without sign.
    pub max_px: f64,
}

/// Rectifies two cameras by turning both about their centres (Fusiello, Trucco & Verri, *A compact algorithm for rectification of stereo
/// pairs*, Machine Vision and Applications 12, 2000): the new x axis is the baseline, the new y axis is normal to it and to the mean of both
/// viewing directions. The new images have the mean of both principal distances and principal points, and no distortion.
///
/// `second_from_first` maps points in the frame of the first camera to that of the second. `None` where the centres coincide, or where a camera
/// looks along the baseline.
#[must_use]
pub fn rectify(first: &Camera, second: &Camera, second_from_first: &Rigid3) -> Option<Rectification> {
    let baseline = second_from_first.centre();
    let length = baseline.norm();
    // Left to right whichever camera is named first, so that neither image is turned upside down.
    let x = if baseline.x < 0.0 { -baseline } else { baseline }.try_normalize(1e-12)?;
    let second_axis = second_from_first.rotation.inverse() * Vector3::z();
    let y = (Vector3::z() + second_axis).cross(&x).try_normalize(1e-6)?;
    let z = x.cross(&y);
    let rectified_from_first = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
    let first_rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rectified_from_first));
    let [a, b] = [first.principal_point(), second.principal_point()];
    Some(Rectification {
        rotations: [first_rotation, first_rotation * second_from_first.rotation.inverse()],
        focal_px: (first.mean_focal() + second.mean_focal()) / 2.0,
        principal_px: [(a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0],
        baseline: length,
    })
}

impl Rectification {
    /// Where a pixel of a camera (`which` is 0 or 1) lies in its rectified image; `None` where its ray does not meet that.
    #[must_use]
    pub fn apply(&self, which: usize, camera: &Camera, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = self.rotations[which] * camera.ray(pixel)?;
        let at = ray.xy() / ray.z * self.focal_px + Vector2::from(self.principal_px);
        (ray.z > 1e-9).then_some(at)
    }

    /// The differences of rows over pixels that show the same points in both images; `None` where there is none.
    #[must_use]
    pub fn error(&self, cameras: [&Camera; 2], pixels: &[[Vector2<f64>; 2]]) -> Option<RectificationError> {
        let rows = |k: usize, p: &[Vector2<f64>; 2]| Some(self.apply(k, cameras[k], &p[k])?.y);
        let found: Vec<f64> = pixels.iter().filter_map(|p| Some(rows(1, p)? - rows(0, p)?)).collect();
        let n = found.len() as f64;
        (!found.is_empty()).then(|| RectificationError {
            points: found.len(),
            mean_px: found.iter().sum::<f64>() / n,
            rms_px: (found.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
            max_px: found.iter().map(|d| d.abs()).fold(0.0, f64::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::CameraModel;

    fn pair() -> (Camera, Camera, Rigid3) {
        let first = Camera::new(CameraModel::OpenCv, 1280, 960, &[1000.0, 1010.0, 650.0, 470.0, 0.15, 0.05, 0.001, -0.002]).unwrap();
        let second = Camera::new(CameraModel::OpenCv, 1280, 960, &[1050.0, 1040.0, 630.0, 490.0, -0.1, 0.02, 0.0, 0.001]).unwrap();
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.03, -0.2, 0.05));
        (first, second, Rigid3::new(turn, turn * -Vector3::new(0.3, 0.02, 0.04)))
    }

    #[test]
    fn exact_points_lie_in_one_row_and_disparity_is_depth() {
        let (first, second, pose) = pair();
        let r = rectify(&first, &second, &pose).unwrap();
        assert!((r.baseline - Vector3::new(0.3f64, 0.02, 0.04).norm()).abs() < 1e-12);
        let mut pixels = Vec::new();
        for k in 0..60 {
            let x = Vector3::new(f64::from(k % 5) * 0.15 - 0.2, f64::from(k / 5) * 0.05 - 0.25, 1.4 + 0.05 * f64::from(k % 7));
            let seen = [first.project(&x).unwrap(), second.project(&pose.apply(&x)).unwrap()];
            let [a, b] = [r.apply(0, &first, &seen[0]).unwrap(), r.apply(1, &second, &seen[1]).unwrap()];
            let depth = (r.rotations[0] * x).z;
            assert!((r.focal_px * r.baseline / (a.x - b.x) / depth - 1.0).abs() < 1e-6);
            pixels.push(seen);
        }
        let error = r.error([&first, &second], &pixels).unwrap();
        assert!(error.points == 60 && error.max_px < 1e-5, "{error:?}");
        // A camera that is turned about its axis by a milliradian shows in the rows, at a thousand pixels' distance of some by half a pixel.
        let turned = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 1e-3)) * pose.rotation, pose.translation);
        let wrong = rectify(&first, &second, &turned).unwrap().error([&first, &second], &pixels).unwrap();
        assert!((0.05..1.0).contains(&wrong.rms_px) && wrong.max_px >= wrong.rms_px, "{wrong:?}");
    }

    #[test]
    fn cameras_that_cannot_be_rectified_are_refused() {
        let (first, second, _) = pair();
        assert_eq!(rectify(&first, &second, &Rigid3::identity()), None);
        let ahead = Rigid3::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, -1.0));
        assert_eq!(rectify(&first, &second, &ahead), None);
    }
}
