//! Absolute orientation of a camera or a rig from points of known position.

mod estimator;
mod focal;
mod p3p;
mod refinement;
#[cfg(test)]
mod tests;

pub use estimator::{Correspondence, Sensor, estimate_absolute_pose};
pub use focal::estimate_absolute_pose_and_focal;
pub use p3p::p3p;
pub use refinement::refine_absolute_pose;
