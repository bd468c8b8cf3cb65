//! Interior orientation: camera models, projection and its derivatives.
//!
//! All models map a direction to normalised coordinates (u, v) = (X/Z, Y/Z), distort these, and scale them to pixels.
//! Parameters stand in COLMAP's order where COLMAP has the model.

mod central;
mod distortion;
mod model;
mod port;
mod projection;
#[cfg(test)]
mod tests;

pub use model::{Camera, CameraError, CameraModel, MAX_CAMERA_PARAMS, ParamKind};
pub use port::{FlatPort, PortError};
pub use projection::ProjectionJacobians;
