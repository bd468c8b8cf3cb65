//! `report.html`: one file that opens from disk without a network.

mod escape;
mod page;
mod scene3d;

pub use page::{Figure, Report, Section, Thumbnail, render};
pub use scene3d::{CameraGlyph, PointSet, Scene3d};
