//! `report.html`: one file that opens from disk without a network.

mod escape;
mod page;
mod picture;
mod scene3d;

pub use page::{Figure, Gallery, Report, Section, Thumbnail, render};
pub use picture::{Mark, Picture};
pub use scene3d::{CameraGlyph, PointSet, Scene3d};
