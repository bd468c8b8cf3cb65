//! Relative orientation of two images: essential and fundamental matrix, homography, and the pose that they hold.
//!
//! Conventions: `x2^T E x1 = 0` with `E = [t]x R` of `cam2_from_cam1 = (R, t)`, normalised undistorted coordinates
//! (X/Z, Y/Z); `x2^T F x1 = 0` and `x2 ~ H x1` in any planar coordinates, usually pixels. Errors are Sampson distances for E and
//! F and symmetric transfer errors for H, in the unit of the coordinates.

mod essential;
mod five_point;
mod fundamental;
mod homography;
mod homography_refinement;
mod matches;
mod pose;
mod sampson;
mod seven_point;
#[cfg(test)]
mod tests;

pub use essential::{estimate_essential, improve_essential, refine_relative_pose};
pub use five_point::five_point;
pub use fundamental::{eight_point, estimate_fundamental, improve_fundamental};
pub use homography::{estimate_homography, four_point_homography, transfer_squared};
pub use pose::{RelativePose, essential_from_pose, pose_from_essential};
pub use sampson::sampson_squared;
pub use seven_point::seven_point;
