//! calibration.json: everything that a calibration found. docs/calibrate.md explains its keys.

use crate::config::{BoardConfig, FramesFrom};
use crate::store::Warning;
use anyhow::{Context, Result, bail};
use calibrate::KnownCamera;
use nalgebra::{DMatrix, Matrix6, Quaternion, UnitQuaternion, Vector3};
use scene::{Camera, CameraModel, Rigid3};
use serde::{Deserialize, Serialize};

/// Everything that a calibration found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    pub name: String,
    pub version: String,
    pub target: BoardConfig,
    pub frames_from: FramesFrom,
    pub images: ImageCounts,
    pub exposures: usize,
    pub observations: usize,
    pub outliers: usize,
    pub rms_px: f64,
    pub sigma0_px: f64,
    pub cameras: Vec<CameraRecord>,
    pub baselines: Vec<BaselineRecord>,
    pub rectifications: Vec<RectificationRecord>,
    pub photographs: Vec<PhotographRecord>,
    pub warnings: Vec<Warning>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ImageCounts {
    pub found: usize,
    pub total: usize,
    pub with_target: usize,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CameraRecord {
    pub name: String,
    pub model: String,
    pub size: [u32; 2],
    pub images: usize,
    pub with_target: usize,
    pub observations: usize,
    pub rms_px: f64,
    pub sigma0_alone_px: Option<f64>,
    pub coverage: f64,
    pub parameters: Vec<ParameterRecord>,
    pub correlations: Vec<Vec<f64>>,
    pub pose: PoseRecord,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParameterRecord {
    pub name: String,
    pub value: f64,
    pub sigma: f64,
    pub held: bool,
    pub significant: Option<bool>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PoseRecord {
    pub quaternion_wxyz: [f64; 4],
    pub translation_m: [f64; 3],
    pub sigma_rotation_deg: [f64; 3],
    pub sigma_translation_m: [f64; 3],
    pub covariance: Option<[[f64; 6]; 6]>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BaselineRecord {
    pub between: [String; 2],
    pub length_m: f64,
    pub sigma_m: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RectificationRecord {
    pub between: [String; 2],
    pub focal_px: f64,
    pub principal_px: [f64; 2],
    pub rectified_from_cam_wxyz: [[f64; 4]; 2],
    pub points: usize,
    pub mean_px: f64,
    pub rms_px: f64,
    pub max_px: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PhotographRecord {
    pub name: String,
    pub exposure: usize,
    pub target: String,
    pub corners: usize,
    pub left_out: usize,
    pub rms_px: Option<f64>,
}

/// A rotation as it is written.
pub(super) fn wxyz(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.w, rotation.i, rotation.j, rotation.k]
}

impl CameraRecord {
    /// The interior orientation.
    pub(super) fn camera(&self) -> Result<Camera> {
        let model = CameraModel::from_name(&self.model).with_context(|| format!("there is no camera model \"{}\"", self.model))?;
        let values: Vec<f64> = self.parameters.iter().map(|p| p.value).collect();
        Ok(Camera::new(model, self.size[0], self.size[1], &values)?)
    }

    /// `cam_from_rig`.
    pub(super) fn cam_from_rig(&self) -> Rigid3 {
        let [w, x, y, z] = self.pose.quaternion_wxyz;
        // As it is: normalising again would change the last bit.
        Rigid3::new(UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)), Vector3::from(self.pose.translation_m))
    }

    /// The camera with all that is known of it.
    pub(super) fn known(&self) -> Result<KnownCamera> {
        let n = self.parameters.len();
        if self.correlations.len() != n || self.correlations.iter().any(|row| row.len() != n) {
            bail!("camera {}: correlations are not {n} rows of {n}", self.name);
        }
        let norm = self.pose.quaternion_wxyz.iter().map(|v| v * v).sum::<f64>();
        if (norm - 1.0).abs() > 1e-6 {
            bail!("camera {}: quaternion_wxyz has not the length 1", self.name);
        }
        let sigma = |k: usize| self.parameters[k].sigma;
        Ok(KnownCamera {
            camera: self.camera()?,
            covariance: DMatrix::from_fn(n, n, |i, j| self.correlations[i][j] * sigma(i) * sigma(j)),
            cam_from_rig: self.cam_from_rig(),
            pose_covariance: self.pose.covariance.map(|rows| Matrix6::from_fn(|i, j| rows[i][j])),
        })
    }
}
