//! Which camera models exist and what their parameters mean.

use super::port::{FlatPort, PortError};
use thiserror::Error;

/// The largest number of parameters of any model.
pub const MAX_CAMERA_PARAMS: usize = 10;

/// How interior orientation is described.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CameraModel {
    /// `fx fy cx cy`, no distortion.
    Pinhole,
    /// `f cx cy k`: one radial term.
    SimpleRadial,
    /// `f cx cy k1 k2`: two radial terms.
    Radial,
    /// `fx fy cx cy k1 k2 p1 p2`: OpenCV's radial and tangential terms.
    OpenCv,
    /// `fx fy cx cy k1 k2 k3 k4`: OpenCV's fisheye model, a polynomial in the angle (Kannala & Brandt, PAMI 2006).
    Fisheye,
    /// `c x0 y0 A1 A2 A3 B1 B2 C1 C2`: Brown, *Close-range camera calibration*, 1971. Principal distance and principal
    /// point in pixels, the coefficients for normalised coordinates:
    /// du = u (A1 r2 + A2 r4 + A3 r6) + B1 (r2 + 2 u2) + 2 B2 u v + C1 u + C2 v,
    /// dv = v (A1 r2 + A2 r4 + A3 r6) + B2 (r2 + 2 v2) + 2 B1 u v,
    /// x = x0 + c (u + du), y = y0 + c (v + dv). In OpenCV's letters k1 = A1, k2 = A2, k3 = A3, p2 = B1, p1 = B2,
    /// fx = c (1 + C1), fy = c up to terms of the second order in C1.
    Brown,
}

/// What a camera parameter describes, which decides how it is refined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParamKind {
    /// Principal distance, pixels.
    Focal,
    /// Principal point, pixels.
    PrincipalPoint,
    /// Distortion, affinity or shear, dimensionless.
    Distortion,
}

impl CameraModel {
    /// Every model.
    pub const ALL: [Self; 6] = [Self::Pinhole, Self::SimpleRadial, Self::Radial, Self::OpenCv, Self::Fisheye, Self::Brown];

    /// Names of the parameters, in order.
    #[must_use]
    pub fn param_names(self) -> &'static [&'static str] {
        match self {
            Self::Pinhole => &["fx", "fy", "cx", "cy"],
            Self::SimpleRadial => &["f", "cx", "cy", "k"],
            Self::Radial => &["f", "cx", "cy", "k1", "k2"],
            Self::OpenCv => &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"],
            Self::Fisheye => &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"],
            Self::Brown => &["c", "x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2"],
        }
    }

    /// What each parameter describes, in order.
    #[must_use]
    pub fn param_kinds(self) -> &'static [ParamKind] {
        use ParamKind::{Distortion as D, Focal as F, PrincipalPoint as P};
        match self {
            Self::Pinhole => &[F, F, P, P],
            Self::SimpleRadial => &[F, P, P, D],
            Self::Radial => &[F, P, P, D, D],
            Self::OpenCv | Self::Fisheye => &[F, F, P, P, D, D, D, D],
            Self::Brown => &[F, P, P, D, D, D, D, D, D, D],
        }
    }

    /// Number of parameters.
    #[must_use]
    pub fn param_count(self) -> usize {
        self.param_names().len()
    }

    /// The name used in configuration files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::SimpleRadial => "simple-radial",
            Self::Radial => "radial",
            Self::OpenCv => "opencv",
            Self::Fisheye => "fisheye",
            Self::Brown => "brown",
        }
    }

    /// The model of a name used in configuration files.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name)
    }
}

/// Why a camera could not be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// Wrong number of parameters.
    #[error("camera model {model} takes {expected} parameters, got {found}")]
    ParamCount {
        /// Name of the model.
        model: &'static str,
        /// How many it takes.
        expected: usize,
        /// How many there were.
        found: usize,
    },
    /// A parameter is not a number, or a focal length is not positive.
    #[error("camera parameter {name} = {value} is not possible")]
    BadParam {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The image has no pixels.
    #[error("camera image size {width} x {height} is empty")]
    EmptyImage {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// The interior orientation of a camera: the model of its lens, and the window that it looks through, where that is modelled by itself. Behind a
/// [`FlatPort`] the parameters are those of the lens in air, and points in the camera's frame lie in the water.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub(super) model: CameraModel,
    width: u32,
    height: u32,
    pub(super) params: [f64; MAX_CAMERA_PARAMS],
    pub(super) port: Option<FlatPort>,
}

impl Camera {
    /// A camera from its parameters, in the order of [`CameraModel::param_names`].
    ///
    /// # Errors
    /// [`CameraError`] when their number is wrong, one is not finite, a focal length is not positive or the image is
    /// empty.
    pub fn new(model: CameraModel, width: u32, height: u32, params: &[f64]) -> Result<Self, CameraError> {
        if params.len() != model.param_count() {
            return Err(CameraError::ParamCount { model: model.name(), expected: model.param_count(), found: params.len() });
        }
        if width == 0 || height == 0 {
            return Err(CameraError::EmptyImage { width, height });
        }
        for ((&value, &name), &kind) in params.iter().zip(model.param_names()).zip(model.param_kinds()) {
            if !value.is_finite() || (kind == ParamKind::Focal && value <= 0.0) {
                return Err(CameraError::BadParam { name, value });
            }
        }
        let mut all = [0.0; MAX_CAMERA_PARAMS];
        all[..params.len()].copy_from_slice(params);
        Ok(Self { model, width, height, params: all, port: None })
    }

    /// A camera of the given focal length in pixels, principal point in the middle, no distortion.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn from_focal(model: CameraModel, width: u32, height: u32, focal_px: f64) -> Result<Self, CameraError> {
        let mut next_centre = [f64::from(width) / 2.0, f64::from(height) / 2.0].into_iter();
        let params: Vec<f64> = model
            .param_kinds()
            .iter()
            .map(|kind| match kind {
                ParamKind::Focal => focal_px,
                ParamKind::PrincipalPoint => next_centre.next().unwrap_or(0.0),
                ParamKind::Distortion => 0.0,
            })
            .collect();
        Self::new(model, width, height, &params)
    }

    /// The same lens behind a port, or without one.
    ///
    /// # Errors
    /// [`PortError`] where there can be no such port.
    pub fn behind(self, port: Option<FlatPort>) -> Result<Self, PortError> {
        port.iter().try_for_each(FlatPort::check)?;
        Ok(Self { port, ..self })
    }

    /// The lens alone.
    #[must_use]
    pub fn in_air(&self) -> Self {
        Self { port: None, ..*self }
    }

    /// The same with directions that are exact at another distance; the camera itself without a port, or where that lies within the housing.
    #[must_use]
    pub fn with_object_distance(&self, object_distance_m: f64) -> Self {
        let port = self.port.map(|port| FlatPort { object_distance_m, ..port });
        self.behind(port).unwrap_or(*self)
    }

    /// The port that it looks through.
    #[must_use]
    pub fn port(&self) -> Option<&FlatPort> {
        self.port.as_ref()
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> CameraModel {
        self.model
    }

    /// Image width, pixels.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Image height, pixels.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The parameters, in the order of [`CameraModel::param_names`].
    #[must_use]
    pub fn params(&self) -> &[f64] {
        &self.params[..self.model.param_count()]
    }

    /// The same, to be changed by a solver; the caller keeps them finite and focal lengths positive.
    pub fn params_mut(&mut self) -> &mut [f64] {
        let count = self.model.param_count();
        &mut self.params[..count]
    }

    /// Mean of the focal lengths, pixels: on the axis the size in the image of what is as large as it is far. Behind a port it is longer by the
    /// index of the water.
    #[must_use]
    pub fn mean_focal(&self) -> f64 {
        let longer = self.port.map_or(1.0, |port| port.index_water / port.index_air);
        longer * self.mean_focal_in_air()
    }

    fn mean_focal_in_air(&self) -> f64 {
        match self.model {
            CameraModel::Pinhole | CameraModel::OpenCv | CameraModel::Fisheye => (self.params[0] + self.params[1]) / 2.0,
            CameraModel::SimpleRadial | CameraModel::Radial => self.params[0],
            CameraModel::Brown => self.params[0] * (1.0 + self.params[8] / 2.0),
        }
    }

    /// Principal point, pixels.
    #[must_use]
    pub fn principal_point(&self) -> [f64; 2] {
        match self.model {
            CameraModel::Pinhole | CameraModel::OpenCv | CameraModel::Fisheye => [self.params[2], self.params[3]],
            CameraModel::SimpleRadial | CameraModel::Radial | CameraModel::Brown => [self.params[1], self.params[2]],
        }
    }

    /// The camera of the same image resampled to `width` x `height`; the field of view stays.
    ///
    /// Focal lengths and principal point scale by axis. Models with one focal length take the mean of both factors,
    /// exact when the aspect is kept.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn resized(&self, width: u32, height: u32) -> Result<Self, CameraError> {
        let sx = f64::from(width) / f64::from(self.width);
        let sy = f64::from(height) / f64::from(self.height);
        let mut params = self.params;
        match self.model {
            CameraModel::Pinhole | CameraModel::OpenCv | CameraModel::Fisheye => {
                for (p, s) in params.iter_mut().zip([sx, sy, sx, sy]) {
                    *p *= s;
                }
            }
            CameraModel::SimpleRadial | CameraModel::Radial | CameraModel::Brown => {
                for (p, s) in params.iter_mut().zip([(sx + sy) / 2.0, sx, sy]) {
                    *p *= s;
                }
            }
        }
        let resized = Self::new(self.model, width, height, &params[..self.model.param_count()])?;
        Ok(Self { port: self.port, ..resized })
    }
}
