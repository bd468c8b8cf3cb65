//! Why there is no calibration.

use solve::adjust::{AdjustError, CovarianceError};
use thiserror::Error;

/// Why there is no calibration, and what to do about it.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CalibrateError {
    /// A view names something that there is not.
    #[error("view {view} refers to a camera, an exposure or a point that there is not")]
    BadIndex {
        /// Which view.
        view: usize,
    },
    /// The points of the target do not lie in the plane z = 0.
    #[error("the target is not flat: only targets in the plane z = 0 are calibrated with")]
    NotFlat,
    /// Too few photographs of a camera show the target.
    #[error("camera {camera} sees the target in {found} photographs, {needed} are needed: take more, tilted to all sides")]
    TooFewViews {
        /// Index of the camera.
        camera: usize,
        /// How many do.
        found: usize,
        /// How many must.
        needed: usize,
    },
    /// The target has the same inclination in all views of a camera: the principal distance cannot be told from the distance.
    #[error("the target is turned by {angle_deg:.1} degrees at most between the photographs of camera {camera}: tilt it by 20 and more")]
    Parallel {
        /// Index of the camera.
        camera: usize,
        /// The largest angle between two planes.
        angle_deg: f64,
    },
    /// The points go round the other way in the image: target or photograph is mirrored, or the target is described from its back.
    #[error("view {view}: the target is mirrored: its x must run right and its y down when it is seen from its front")]
    Mirrored {
        /// Which view.
        view: usize,
    },
    /// Fewer than four points, or points in line.
    #[error("view {view}: its points do not determine a plane")]
    Degenerate {
        /// Which view.
        view: usize,
    },
    /// No principal distance agrees with the views.
    #[error("no principal distance agrees with the views of camera {camera}: is the target described as it is?")]
    NoFocal {
        /// Index of the camera.
        camera: usize,
    },
    /// A camera shares no exposure with the others.
    #[error("camera {camera} sees the target in no exposure in which another camera of the rig does")]
    NotConnected {
        /// Index of the camera.
        camera: usize,
    },
    /// The adjustment did not end at a minimum.
    #[error("the adjustment did not converge: is the target described as it is?")]
    NotConverged,
    /// The adjustment refused the problem.
    #[error(transparent)]
    Adjust(#[from] AdjustError),
    /// The views do not determine all parameters.
    #[error("the views do not determine all parameters ({0}): take more, tilted to all sides and filling the image, or a smaller model")]
    Covariance(#[from] CovarianceError),
}
