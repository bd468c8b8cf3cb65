//! `transforms.json`, as nerfstudio and the programs after it read cameras.

use super::error::FormatError;
use crate::{Camera, CameraModel, ImageId, Reconstruction};
use serde_json::{Map, Value, json};
use std::io::Write;

const FORMAT: &str = "transforms.json";

/// Writes the oriented images, each with its own interior orientation and its pose as `transform_matrix`: world from camera, whose axes are
/// those of OpenGL (x right, y up, z backward). The world stays as it is. The centre of the top-left pixel is (0.5, 0.5) there too.
///
/// # Errors
/// [`FormatError::NotRepresentable`] for Brown's model with affinity or shear and for cameras behind a port, which the format lacks; what the stream says.
pub fn write_nerfstudio(reconstruction: &Reconstruction, out: &mut dyn Write) -> Result<(), FormatError> {
    let mut frames = Vec::new();
    for image in reconstruction.oriented_images() {
        frames.push(frame(reconstruction, image)?);
    }
    let text = serde_json::to_string_pretty(&json!({ "frames": frames })).map_err(std::io::Error::from)?;
    Ok(writeln!(out, "{text}")?)
}

fn frame(reconstruction: &Reconstruction, image: ImageId) -> Result<Value, FormatError> {
    let refuse = |what: String| FormatError::NotRepresentable { format: FORMAT, what };
    let entry = &reconstruction.images[image.index()];
    let pose = reconstruction.cam_from_world(image).ok_or_else(|| refuse(format!("image {} has no pose", entry.name)))?;
    let camera = &reconstruction.cameras[entry.camera.index()];
    let mut frame = interior(camera).ok_or_else(|| {
        refuse(format!("the camera of {} stands behind a port, or has affinity or shear (C1, C2): without a port, orient with fixed = [\"c1\", \"c2\"]", entry.name))
    })?;
    let (r, c) = (pose.rotation_matrix(), pose.centre());
    // Columns: the axes of the camera in the world, y and z turned round.
    let mut matrix: Vec<Vec<f64>> = (0..3).map(|k| vec![r[(0, k)], -r[(1, k)], -r[(2, k)], c[k]]).collect();
    matrix.push(vec![0.0, 0.0, 0.0, 1.0]);
    frame.insert("file_path".to_owned(), entry.name.clone().into());
    frame.insert("transform_matrix".to_owned(), json!(matrix));
    Ok(frame.into())
}

/// Keys of the interior orientation; `None` where the format has no such camera.
fn interior(camera: &Camera) -> Option<Map<String, Value>> {
    let p = camera.params();
    if camera.port().is_some() {
        return None;
    }
    let (model, focal, centre, names, distortion): (_, _, _, &[&str], Vec<f64>) = match camera.model() {
        CameraModel::Pinhole => ("OPENCV", [p[0], p[1]], [p[2], p[3]], &[], Vec::new()),
        CameraModel::SimpleRadial => ("OPENCV", [p[0], p[0]], [p[1], p[2]], &["k1"], vec![p[3]]),
        CameraModel::Radial => ("OPENCV", [p[0], p[0]], [p[1], p[2]], &["k1", "k2"], vec![p[3], p[4]]),
        CameraModel::OpenCv => ("OPENCV", [p[0], p[1]], [p[2], p[3]], &["k1", "k2", "p1", "p2"], p[4..8].to_vec()),
        CameraModel::Fisheye => ("OPENCV_FISHEYE", [p[0], p[1]], [p[2], p[3]], &["k1", "k2", "k3", "k4"], p[4..8].to_vec()),
        // Brown's B1 and B2 are OpenCV's p2 and p1.
        CameraModel::Brown if p[8] == 0.0 && p[9] == 0.0 => {
            ("OPENCV", [p[0], p[0]], [p[1], p[2]], &["k1", "k2", "k3", "p1", "p2"], vec![p[3], p[4], p[5], p[7], p[6]])
        }
        CameraModel::Brown => return None,
    };
    let mut keys = Map::new();
    keys.insert("camera_model".to_owned(), model.into());
    keys.insert("w".to_owned(), camera.width().into());
    keys.insert("h".to_owned(), camera.height().into());
    let values = ["fl_x", "fl_y", "cx", "cy"].into_iter().zip(focal.into_iter().chain(centre));
    keys.extend(values.chain(names.iter().copied().zip(distortion)).map(|(name, value)| (name.to_owned(), json!(value))));
    Some(keys)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::testing::one_image;
    use nalgebra::{Matrix4, Vector3};

    fn written(camera: Camera) -> Result<Value, FormatError> {
        let mut bytes = Vec::new();
        write_nerfstudio(&one_image(camera), &mut bytes)?;
        Ok(serde_json::from_slice(&bytes).expect("JSON"))
    }

    /// By the formulas of OpenCV and the axes of OpenGL, from the file alone.
    fn project(frame: &Value, xyz: &Vector3<f64>) -> [f64; 2] {
        let n = |key: &str| frame[key].as_f64().unwrap_or(0.0);
        let world_from_camera = Matrix4::from_fn(|i, j| frame["transform_matrix"][i][j].as_f64().expect("a number"));
        let x = world_from_camera.try_inverse().expect("a pose").transform_point(&(*xyz).into());
        let (u, v) = (x.x / -x.z, -x.y / -x.z);
        let r2 = u * u + v * v;
        let (scale, p1, p2) = if frame["camera_model"] == "OPENCV_FISHEYE" {
            let theta = r2.sqrt().atan();
            let t2 = theta * theta;
            (theta / r2.sqrt() * (1.0 + t2 * (n("k1") + t2 * (n("k2") + t2 * (n("k3") + t2 * n("k4"))))), 0.0, 0.0)
        } else {
            (1.0 + r2 * (n("k1") + r2 * (n("k2") + r2 * n("k3"))), n("p1"), n("p2"))
        };
        let x = u * scale + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u);
        let y = v * scale + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v;
        [n("fl_x") * x + n("cx"), n("fl_y") * y + n("cy")]
    }

    #[test]
    fn every_camera_projects_as_ours() {
        let params: [(CameraModel, &[f64]); 6] = [
            (CameraModel::Pinhole, &[500.0, 510.0, 321.0, 239.0]),
            (CameraModel::SimpleRadial, &[500.0, 321.0, 239.0, -0.1]),
            (CameraModel::Radial, &[500.0, 321.0, 239.0, -0.1, 0.02]),
            (CameraModel::OpenCv, &[500.0, 505.0, 321.0, 239.0, -0.1, 0.02, 0.001, -0.002]),
            (CameraModel::Fisheye, &[400.0, 401.0, 320.0, 240.0, 0.03, -0.01, 0.004, -0.001]),
            (CameraModel::Brown, &[510.0, 318.0, 241.0, -0.08, 0.01, 0.002, 0.001, -0.002, 0.0, 0.0]),
        ];
        for (model, params) in params {
            let camera = Camera::new(model, 640, 480, params).expect("valid");
            let file = written(camera).expect("has a form");
            let truth = one_image(camera);
            let frame = &file["frames"][0];
            assert_eq!((&frame["file_path"], &frame["w"]), (&"C1/1.jpg".into(), &640.into()));
            let pose = truth.cam_from_world(ImageId(0)).expect("oriented");
            for point in &truth.points {
                let ours = camera.project(&pose.apply(&point.xyz)).expect("in front");
                let theirs = project(frame, &point.xyz);
                assert!((ours.x - theirs[0]).abs() < 1e-9 && (ours.y - theirs[1]).abs() < 1e-9, "{model:?}: {ours:?}, {theirs:?}");
            }
        }
    }

    #[test]
    fn what_has_no_form_is_refused() {
        let camera = Camera::new(CameraModel::Brown, 640, 480, &[510.0, 318.0, 241.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4, 0.0]).expect("valid");
        assert!(written(camera).expect_err("affinity").to_string().contains("C1/1.jpg has affinity"));
    }
}
