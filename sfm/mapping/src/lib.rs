//! Orientation: from verified pairs to posed frames, interior orientation and scene points.
//!
//! [`orient`] is the way in. It builds the correspondence graph, starts from a well-chosen pair (or from one exposure of
//! a calibrated rig), registers one frame after the other, and adjusts all of it with [`solve::adjust`]. Everything is a
//! plain function over plain values; the same input gives the same bits.
//!
//! The route is the incremental one of Schoenberger & Frahm, *Structure-from-Motion Revisited*, CVPR 2016, with frames
//! (one pose for all images of a rig) in the place of images.

mod adjustment;
mod attempt;
mod check;
mod contradiction;
mod error;
mod filter;
mod finish;
mod frames;
mod global;
mod graph;
mod incremental;
mod initial;
mod input;
mod interior;
mod lengths;
mod model;
mod options;
mod orient;
mod placement;
mod quality;
mod readjust;
mod register;
mod residuals;
mod rig;
mod rig_report;
mod summary;
mod ties;
mod triangulation;
mod visibility;
mod world_report;

pub use attempt::Made;
pub use error::MapError;
pub use input::{
    BaselineInput, CameraInput, ControlPointInput, HeadingInput, ImageInput, ImagePick, MapInput, PICK_SIGMA_PX, PositionInput, RigInput,
    RigMode, RigPoseInput, ScaleBarInput, UpInput, WorldInput,
};
pub use lengths::LengthId;
pub use options::{Mapper, OrientOptions};
pub use orient::orient;
pub use quality::{InteriorSigma, PoseSigma, Quality};
pub use readjust::readjust;
pub use residuals::{CameraResiduals, REGIONS, RegionResiduals, camera_residuals};
pub use rig_report::RigPoseReport;
pub use summary::{BaselineReport, LeftOut, OrientSummary, Orientation, ScaleBarReport};
pub use world_report::{ControlPointReport, InstrumentReport, WorldReport};
