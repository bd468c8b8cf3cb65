//! Camera calibration: from photographs of a target to interior orientation, rig and their precision.
//!
//! - [`detect_board`] finds chequerboards in photographs, to a fraction of a pixel;
//! - [`calibrate`] makes interior orientations and a rig of them, with standard deviations and correlations;
//! - [`water`] is the refractive index of the water.

mod board;
mod calibration;
mod error;
mod levels;
mod plane;
mod saddle;
mod sample;
mod start;
pub mod water;

pub use board::{Board, BoardFinding, detect_board};
pub use calibration::{CalibratedBaseline, CalibratedCamera, Calibration, CameraSetup, Parameter, Setup, View, calibrate};
pub use error::CalibrateError;
