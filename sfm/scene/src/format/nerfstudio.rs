//! `transforms.json`, as nerfstudio and the programs after it read cameras.

use super::error::FormatError;
use crate::{Camera, CameraId, CameraModel, Frame, FrameId, Image, ImageId, Reconstruction, Rig, RigId, Rigid3, Scale};
use nalgebra::{Matrix3, Vector3};
use serde_json::{Map, Value, json};
use std::io::Write;

const FORMAT: &str = "transforms.json";
/// Largest deviation of a rotation matrix from orthonormality.
const ROTATION_TOLERANCE: f64 = 1e-3;

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
    let mut frame = interior(camera).map_err(|why| refuse(format!("the camera of {} {why}", entry.name)))?;
    let (r, c) = (pose.rotation_matrix(), pose.centre());
    // Columns: the axes of the camera in the world, y and z turned round.
    let mut matrix: Vec<Vec<f64>> = (0..3).map(|k| vec![r[(0, k)], -r[(1, k)], -r[(2, k)], c[k]]).collect();
    matrix.push(vec![0.0, 0.0, 0.0, 1.0]);
    frame.insert("file_path".to_owned(), entry.name.clone().into());
    frame.insert("transform_matrix".to_owned(), json!(matrix));
    Ok(frame.into())
}

/// Keys of the interior orientation; else why the format has no such camera.
fn interior(camera: &Camera) -> Result<Map<String, Value>, &'static str> {
    let p = camera.params();
    if camera.port().is_some() {
        return Err("stands behind a port");
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
        CameraModel::Brown => return Err("has affinity or shear (C1, C2): orient with fixed = [\"c1\", \"c2\"]"),
    };
    let mut keys = Map::new();
    keys.insert("camera_model".to_owned(), model.into());
    keys.insert("w".to_owned(), camera.width().into());
    keys.insert("h".to_owned(), camera.height().into());
    let values = ["fl_x", "fl_y", "cx", "cy"].into_iter().zip(focal.into_iter().chain(centre));
    keys.extend(values.chain(names.iter().copied().zip(distortion)).map(|(name, value)| (name.to_owned(), json!(value))));
    Ok(keys)
}

/// Reads `transforms.json`: cameras with their poses, without points, which the format lacks; `applied_transform` and `ply_file_path` are
/// passed over. Interior orientation stands with each frame or above all; images with the same one share a camera. The unit is open.
///
/// # Errors
/// [`FormatError::Key`] where a key is missing or is not what the format says, or a camera has no form here.
pub fn read_nerfstudio(text: &[u8]) -> Result<Reconstruction, FormatError> {
    let file: Value = serde_json::from_slice(text).map_err(|e| wrong(format!("line {}", e.line()), format!("is not JSON: {e}")))?;
    let frames = file["frames"].as_array().ok_or_else(|| wrong("frames", "is missing or no list"))?;
    let mut model = Reconstruction {
        cameras: Vec::new(),
        rigs: Vec::new(),
        frames: Vec::new(),
        images: Vec::new(),
        keypoints: vec![Vec::new(); frames.len()],
        points: Vec::new(),
        scale: Scale::Arbitrary,
    };
    for (i, frame) in frames.iter().enumerate() {
        let entry = Entry { index: i, frame, file: &file };
        let name = frame["file_path"].as_str().ok_or_else(|| entry.wrong("file_path", "is missing or no text"))?;
        let camera = entry.camera()?;
        let number = model.cameras.iter().position(|c| *c == camera).unwrap_or_else(|| {
            model.rigs.push(Rig::single(CameraId::new(model.cameras.len())));
            model.cameras.push(camera);
            model.cameras.len() - 1
        });
        model.frames.push(Frame { rig: RigId::new(number), exposure: i as u32, rig_from_world: Some(entry.cam_from_world()?) });
        model.images.push(Image { name: name.to_owned(), camera: CameraId::new(number), frame: FrameId::new(i) });
    }
    Ok(model)
}

fn wrong(key: impl Into<String>, what: impl Into<String>) -> FormatError {
    FormatError::Key { file: FORMAT, key: key.into(), what: what.into() }
}

/// A frame of the file.
struct Entry<'a> {
    index: usize,
    frame: &'a Value,
    file: &'a Value,
}

impl Entry<'_> {
    fn wrong(&self, key: &str, what: impl Into<String>) -> FormatError {
        wrong(format!("frames[{}].{key}", self.index), what)
    }

    /// A value of the frame, or of all.
    fn value(&self, key: &str) -> &Value {
        if self.frame[key].is_null() { &self.file[key] } else { &self.frame[key] }
    }

    fn number(&self, key: &str) -> Result<Option<f64>, FormatError> {
        match self.value(key) {
            Value::Null => Ok(None),
            value => value.as_f64().map(Some).ok_or_else(|| self.wrong(key, "is no number")),
        }
    }

    fn needed(&self, key: &str) -> Result<f64, FormatError> {
        self.number(key)?.ok_or_else(|| self.wrong(key, "is missing, here and above the frames"))
    }

    fn camera(&self) -> Result<Camera, FormatError> {
        let size = |key| -> Result<u32, FormatError> {
            let pixels = self.needed(key)?;
            // A size is a whole number, which a float of the format may hold.
            if pixels >= 1.0 && pixels <= f64::from(u32::MAX) && pixels.fract() == 0.0 {
                Ok(pixels as u32)
            } else {
                Err(self.wrong(key, "is no size"))
            }
        };
        let (w, h) = (size("w")?, size("h")?);
        let fx = match (self.number("fl_x")?, self.number("camera_angle_x")?) {
            (Some(f), _) => f,
            (None, Some(angle)) => 0.5 * f64::from(w) / (0.5 * angle).tan(),
            (None, None) => return Err(self.wrong("fl_x", "is missing, here and above the frames")),
        };
        let fy = self.number("fl_y")?.unwrap_or(fx);
        let (cx, cy) = (self.number("cx")?.unwrap_or(f64::from(w) / 2.0), self.number("cy")?.unwrap_or(f64::from(h) / 2.0));
        let mut k = [0.0; 4];
        for (value, key) in k.iter_mut().zip(["k1", "k2", "k3", "k4"]) {
            *value = self.number(key)?.unwrap_or(0.0);
        }
        let [p1, p2] = [self.number("p1")?.unwrap_or(0.0), self.number("p2")?.unwrap_or(0.0)];
        let model = self.value("camera_model").as_str().unwrap_or("OPENCV");
        let camera = match model {
            "OPENCV_FISHEYE" => Camera::new(CameraModel::Fisheye, w, h, &[fx, fy, cx, cy, k[0], k[1], k[2], k[3]]),
            "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "perspective" if k[3] != 0.0 => {
                return Err(self.wrong("k4", "a fourth radial term has no form here"));
            }
            "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "perspective" if k[2] != 0.0 && fx != fy => {
                return Err(self.wrong("k3", "a third radial term with two focal lengths has no form here"));
            }
            // Brown's B1 and B2 are OpenCV's p2 and p1.
            "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "perspective" if k[2] != 0.0 => {
                Camera::new(CameraModel::Brown, w, h, &[fx, cx, cy, k[0], k[1], k[2], p2, p1, 0.0, 0.0])
            }
            "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "perspective" if k[..2] == [0.0; 2] && p1 == 0.0 && p2 == 0.0 => {
                Camera::new(CameraModel::Pinhole, w, h, &[fx, fy, cx, cy])
            }
            "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "perspective" => {
                Camera::new(CameraModel::OpenCv, w, h, &[fx, fy, cx, cy, k[0], k[1], p1, p2])
            }
            other => {
                return Err(self.wrong("camera_model", format!("\"{other}\" has no form here: OPENCV, OPENCV_FISHEYE and PINHOLE have")));
            }
        };
        camera.map_err(|e| self.wrong("fl_x", e.to_string()))
    }

    fn cam_from_world(&self) -> Result<Rigid3, FormatError> {
        let key = "transform_matrix";
        let rows = self.frame[key].as_array().filter(|rows| rows.len() == 3 || rows.len() == 4);
        let mut m = [[0.0; 4]; 3];
        for (row, values) in m.iter_mut().zip(rows.ok_or_else(|| self.wrong(key, "is missing, or has not four rows"))?) {
            for (k, value) in row.iter_mut().enumerate() {
                *value = values[k].as_f64().ok_or_else(|| self.wrong(key, "needs rows of four numbers"))?;
            }
        }
        // Columns: the axes of the camera in the world, y and z turned round.
        let world_from_cam = Matrix3::from_fn(|row, column| if column == 0 { m[row][0] } else { -m[row][column] });
        if (world_from_cam * world_from_cam.transpose() - Matrix3::identity()).norm() > ROTATION_TOLERANCE
            || world_from_cam.determinant() < 0.0
        {
            return Err(self.wrong(key, "is no rotation with a translation"));
        }
        Ok(Rigid3::from_matrix(&world_from_cam, Vector3::new(m[0][3], m[1][3], m[2][3])).inverse())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::testing::one_image;
    use nalgebra::Matrix4;

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
            // What is read from it sees the points where they were.
            let back = read_nerfstudio(file.to_string().as_bytes()).expect("valid");
            assert_eq!((back.images.len(), back.images[0].name.as_str(), back.points.len()), (1, "C1/1.jpg", 0));
            let found = back.cam_from_world(ImageId(0)).expect("oriented");
            for point in &truth.points {
                let given = camera.project(&pose.apply(&point.xyz)).expect("in front");
                let read = back.cameras[0].project(&found.apply(&point.xyz)).expect("in front");
                assert!((given - read).norm() < 1e-9, "{model:?}: {given:?} {read:?}");
            }
        }
    }

    #[test]
    fn broken_files_are_named_by_their_keys() {
        let camera = Camera::new(CameraModel::Pinhole, 640, 480, &[500.0, 510.0, 321.0, 239.0]).expect("valid");
        let whole = written(camera).expect("has a form");
        let refused = |change: &dyn Fn(&mut Value)| {
            let mut file = whole.clone();
            change(&mut file);
            read_nerfstudio(file.to_string().as_bytes()).expect_err("broken").to_string()
        };
        assert_eq!(refused(&|f| f["frames"] = json!(1)), "transforms.json, frames: is missing or no list");
        assert_eq!(refused(&|f| f["frames"][0]["w"] = json!(12.5)), "transforms.json, frames[0].w: is no size");
        assert_eq!(refused(&|f| f["frames"][0]["fl_x"] = json!("x")), "transforms.json, frames[0].fl_x: is no number");
        assert!(
            refused(&|f| f["frames"][0]["camera_model"] = json!("EQUIRECTANGULAR")).contains("frames[0].camera_model: \"EQUIRECTANGULAR\"")
        );
        assert!(refused(&|f| f["frames"][0]["k4"] = json!(0.1)).contains("frames[0].k4: a fourth radial term"));
        assert!(refused(&|f| f["frames"][0]["transform_matrix"][0][0] = json!(3.0)).contains("transform_matrix: is no rotation"));
        assert!(
            refused(&|f| f["frames"][0]["transform_matrix"][2] = json!([1.0])).contains("transform_matrix: needs rows of four numbers")
        );
        assert!(read_nerfstudio(b"{\n\"frames\": [").expect_err("cut").to_string().contains("line 2: is not JSON"));
        // Above all frames, with an angle in the place of a focal length.
        let mut above = whole.clone();
        for key in ["fl_x", "fl_y", "w", "h", "cx", "cy", "camera_model"] {
            above["frames"][0].as_object_mut().expect("a frame").remove(key);
        }
        above["camera_angle_x"] = json!(2.0 * (320.0f64 / 500.0).atan());
        (above["w"], above["h"]) = (json!(640), json!(480));
        let found = read_nerfstudio(above.to_string().as_bytes()).expect("valid").cameras[0];
        assert!(found.params().iter().zip([500.0, 500.0, 320.0, 240.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn what_has_no_form_is_refused() {
        let camera = Camera::new(CameraModel::Brown, 640, 480, &[510.0, 318.0, 241.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4, 0.0]).expect("valid");
        assert!(written(camera).expect_err("affinity").to_string().contains("C1/1.jpg has affinity"));
        let lens = Camera::from_focal(CameraModel::Pinhole, 640, 480, 400.0).expect("valid");
        let port = crate::FlatPort {
            normal: Vector3::z_axis(),
            distance_m: 0.03,
            thickness_m: 0.008,
            index_air: 1.0,
            index_port: 1.49,
            index_water: 1.34,
            object_distance_m: 3.0,
        };
        let refused = written(lens.behind(Some(port)).expect("possible")).expect_err("a port");
        assert!(refused.to_string().contains("C1/1.jpg stands behind a port"), "{refused}");
    }
}
