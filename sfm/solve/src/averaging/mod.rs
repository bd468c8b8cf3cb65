//! From relations between pairs to poses of all: rotation averaging and global positioning.

mod block_system;
mod components;
mod laplacian;
mod positions;
mod rotations;
#[cfg(test)]
mod tests;

pub use components::components;
pub use positions::{Bearing, Positioned, PositioningOptions, position};
pub use rotations::{AveragedRotations, AveragingError, AveragingOptions, RelativeRotation, average_rotations};
