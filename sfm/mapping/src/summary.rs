//! What came out of an orientation.

use crate::attempt::Made;
use crate::lengths::LengthId;
use crate::quality::Quality;
use crate::rig_report::RigPoseReport;
use crate::world_report::WorldReport;
use scene::{CameraId, ImageId, Reconstruction};
use solve::adjust::{AdjustSummary, CovarianceError};

/// Models and figures.
#[derive(Clone, Debug)]
pub struct Orientation {
    /// Models, the one with most images first. They do not share frames.
    pub models: Vec<Reconstruction>,
    /// Figures of the first model, and what was left out.
    pub summary: OrientSummary,
}

/// Figures of an orientation.
#[derive(Clone, Debug)]
pub struct OrientSummary {
    /// The last adjustment of the first model.
    pub adjustment: AdjustSummary,
    /// How the first model was made; `None` of one that was only adjusted.
    pub made: Option<Made>,
    /// Images in no model, and why.
    pub left_out: Vec<LeftOut>,
    /// Known baselines and what was found; empty where the first model is not metric.
    pub baselines: Vec<BaselineReport>,
    /// Given poses in the rig that were refined, and what was found; empty where the first model is not metric.
    pub rig_poses: Vec<RigPoseReport>,
    /// Known lengths in the scene and what was found.
    pub scale_bars: Vec<ScaleBarReport>,
    /// What instruments and control points say of the first model; `None` where it is not tied to the world.
    pub world: Option<WorldReport>,
    /// Standard deviations of the first model.
    pub quality: Result<Quality, CovarianceError>,
    /// Known that contradict the others so clearly that they were taken out of the adjustment, with their normalised residuals.
    pub rejected: Vec<(LengthId, f64)>,
    /// Decisions that a user should know of.
    pub notes: Vec<String>,
}

/// An image that could not be oriented.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The image.
    pub image: ImageId,
    /// Why.
    pub reason: String,
}

/// A known baseline and what was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineReport {
    /// Position in the input.
    pub index: usize,
    /// The cameras.
    pub cameras: (CameraId, CameraId),
    /// Given length, metres.
    pub given_m: f64,
    /// Mean over the exposures, metres.
    pub found_m: f64,
    /// Given standard deviation, metres.
    pub sigma_m: f64,
    /// Root mean square over the exposures of (found - given) / sigma.
    pub normalised_residual: f64,
    /// Exposures in which both cameras are oriented.
    pub exposures: usize,
}

/// A known length in the scene and what was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleBarReport {
    /// Position in the input.
    pub index: usize,
    /// Given length, metres.
    pub given_m: f64,
    /// Found length, metres; `None` when an end is picked in fewer than two oriented images, or the model is
    /// not metric.
    pub found_m: Option<f64>,
    /// Took no part in the adjustment.
    pub check: bool,
    /// Error of a check over its standard deviation, which is that of the given length and that of the picks together; of a length that
    /// takes part, its normalised residual. `None` where nothing checks it.
    pub normalised_residual: Option<f64>,
}
