//! Rendered dives.

mod bars;
mod mesh;
mod optics;
mod path;
mod render;
mod scene;
mod surface;
mod texture;
mod truth;
mod water;

pub use bars::{Pick, ScaleBar};
pub use optics::Optics;
pub use scene::{Dive, DiveImage, DiveOptions, DiveScene, render_dive};
