//! Camera calibration: from photographs of a target to interior orientation, rig and their precision.
//!
//! - [`detect_board`] and [`detect_tags`] find chequerboards and AprilTags in photographs, to a fraction of a pixel;
//! - [`Target`] says where their points are;
//! - [`water`] is the refractive index of the water.

mod board;
mod levels;
mod saddle;
mod sample;
pub mod water;

pub use board::{Board, BoardFinding, detect_board};
