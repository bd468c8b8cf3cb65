//! Our camera models as COLMAP's and back.

use crate::{Camera, CameraError, CameraModel};

/// A COLMAP camera model: number, name, number of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ColmapCameraModel {
    pub id: i32,
    pub name: &'static str,
    pub param_count: usize,
}

const SIMPLE_PINHOLE: ColmapCameraModel = ColmapCameraModel { id: 0, name: "SIMPLE_PINHOLE", param_count: 3 };
const PINHOLE: ColmapCameraModel = ColmapCameraModel { id: 1, name: "PINHOLE", param_count: 4 };
const SIMPLE_RADIAL: ColmapCameraModel = ColmapCameraModel { id: 2, name: "SIMPLE_RADIAL", param_count: 4 };
const RADIAL: ColmapCameraModel = ColmapCameraModel { id: 3, name: "RADIAL", param_count: 5 };
const OPENCV: ColmapCameraModel = ColmapCameraModel { id: 4, name: "OPENCV", param_count: 8 };
const OPENCV_FISHEYE: ColmapCameraModel = ColmapCameraModel { id: 5, name: "OPENCV_FISHEYE", param_count: 8 };
const FULL_OPENCV: ColmapCameraModel = ColmapCameraModel { id: 6, name: "FULL_OPENCV", param_count: 12 };

const READABLE: [ColmapCameraModel; 7] = [SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV];

/// The model of a number that COLMAP uses, where we can read it.
pub(super) fn model_from_id(id: i32) -> Option<ColmapCameraModel> {
    READABLE.into_iter().find(|m| m.id == id)
}

/// The model of a name that COLMAP uses, where we can read it.
pub(super) fn model_from_name(name: &str) -> Option<ColmapCameraModel> {
    READABLE.into_iter().find(|m| m.name == name)
}

/// Our camera as COLMAP's; `None` for Brown's model with shear (C2) and behind a port, which COLMAP cannot express.
///
/// All models but Brown's are the same function. Brown's affinity C1 adds c C1 u to x, whereas two focal lengths also
/// scale the distortion: with fx = c (1 + C1), fy = c and the coefficients divided by 1 + C1/2 the difference is
/// c |C1| |d| / 2 in x and in y, d being the distortion in normalised coordinates; 0 where C1 = 0. With C1 = 1e-4 and
/// 50 px of distortion that is 0.0025 px.
pub(super) fn to_colmap(camera: &Camera) -> Option<(ColmapCameraModel, Vec<f64>)> {
    let p = camera.params();
    if camera.port().is_some() {
        return None;
    }
    Some(match camera.model() {
        CameraModel::Pinhole => (PINHOLE, p.to_vec()),
        CameraModel::SimpleRadial => (SIMPLE_RADIAL, p.to_vec()),
        CameraModel::Radial => (RADIAL, p.to_vec()),
        CameraModel::OpenCv => (OPENCV, p.to_vec()),
        CameraModel::Fisheye => (OPENCV_FISHEYE, p.to_vec()),
        CameraModel::Brown => {
            let &[c, x0, y0, a1, a2, a3, b1, b2, c1, c2] = p else { return None };
            if c2 != 0.0 {
                return None;
            }
            let s = 1.0 + c1 / 2.0;
            (FULL_OPENCV, vec![c * (1.0 + c1), c, x0, y0, a1 / s, a2 / s, b2 / s, b1 / s, a3 / s, 0.0, 0.0, 0.0])
        }
    })
}

/// COLMAP's camera as ours.
///
/// `FULL_OPENCV` becomes Brown's model by the inverse of [`to_colmap`]; it is refused where its rational terms k4 to k6
/// are used, which Brown's model lacks.
pub(super) fn from_colmap(model: ColmapCameraModel, width: u32, height: u32, p: &[f64]) -> Result<Camera, String> {
    let camera = |ours, params: &[f64]| Camera::new(ours, width, height, params).map_err(|e: CameraError| e.to_string());
    match (model, p) {
        (SIMPLE_PINHOLE, &[f, cx, cy]) => camera(CameraModel::Pinhole, &[f, f, cx, cy]),
        (PINHOLE, p) => camera(CameraModel::Pinhole, p),
        (SIMPLE_RADIAL, p) => camera(CameraModel::SimpleRadial, p),
        (RADIAL, p) => camera(CameraModel::Radial, p),
        (OPENCV, p) => camera(CameraModel::OpenCv, p),
        (OPENCV_FISHEYE, p) => camera(CameraModel::Fisheye, p),
        (FULL_OPENCV, &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) if [k4, k5, k6] == [0.0; 3] => {
            let c1 = fx / fy - 1.0;
            let s = 1.0 + c1 / 2.0;
            camera(CameraModel::Brown, &[fy, cx, cy, k1 * s, k2 * s, k3 * s, p2 * s, p1 * s, c1, 0.0])
        }
        (FULL_OPENCV, &[_, _, _, _, _, _, _, _, _, _, _, _]) => Err("rational distortion terms k4 to k6 are not supported".into()),
        (model, p) => Err(format!("camera model {} takes {} parameters, got {}", model.name, model.param_count, p.len())),
    }
}
