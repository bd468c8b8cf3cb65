//! Camera calibration: from photographs of a target to interior orientation, rig and their precision.
//!
//! - [`detect_board`] finds chequerboards in photographs, to a fraction of a pixel;
//! - [`calibrate`] makes interior orientations and a rig of them, with standard deviations and correlations;
//! - [`drift`] tells whether two calibrations differ by more than chance; [`fit_held`] how well new views fit an old one;
//! - [`rectify`] makes the common image plane of a stereo pair;
//! - [`water`] is the refractive index of the water.

mod board;
mod calibration;
mod chi_square;
mod drift;
mod error;
mod levels;
mod plane;
mod rectify;
mod saddle;
mod sample;
mod start;
pub mod water;

pub use board::{Board, BoardFinding, detect_board};
pub use calibration::{CalibratedBaseline, CalibratedCamera, Calibration, CameraSetup, Parameter, Setup, View, calibrate};
pub use chi_square::chi_square_above;
pub use drift::{CameraDrift, DriftTest, HeldFit, KnownCamera, ParameterDrift, drift, fit_held};
pub use error::CalibrateError;
pub use rectify::{Rectification, RectificationError, rectify};
