//! Bundle adjustment: cameras, rigs, poses and points that best explain image observations, lengths and priors.
//!
//! The parts, in the order in which they work: [`problem`](Problem) is sorted into a `layout`, values live in `state`;
//! `linearise` makes the normal equations of the observations and `lengths` those of everything else; `schur` eliminates
//! the points into a system whose `pattern` is dense or sparse; `solve_reduced` factorises it; `step` goes back to the
//! points and evaluates; `lm` decides. `kernels` has the inner loops, `pieces` the parallel ones.

mod clusters;
mod conjugate;
mod consistency;
mod covariance;
mod error;
mod inverse;
mod kernels;
mod layout;
mod lengths;
mod linearise;
mod lm;
mod meetings;
mod options;
mod pattern;
mod pieces;
mod problem;
mod schur;
mod sensors;
mod solve_reduced;
mod state;
mod step;
mod summary;
#[cfg(test)]
mod tests;

pub use consistency::{Consistency, NormalisedError, consistency, joint_consistency};
pub use covariance::{Covariance, CovarianceError, CovarianceOptions, covariance};
pub use error::AdjustError;
pub use lm::adjust;
pub use options::{AdjustOptions, Loss};
pub use problem::{
    Baseline, CameraBlock, ControlPoint, DirectionObservation, HeadingObservation, ImageObservation, ParamPrior, PointBlock, PoseBlock,
    PosePrior, PositionObservation, Problem, ScaleBar,
};
pub use summary::{AdjustSummary, LengthResidual, ParameterCounts, ReprojectionErrors, Termination};
