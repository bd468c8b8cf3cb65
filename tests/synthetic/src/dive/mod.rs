//! Rendered dives.

mod mesh;
mod optics;
mod path;
mod render;
mod surface;
mod texture;
mod truth;
mod water;

pub use optics::Optics;
pub use render::{Dive, DiveImage, DiveOptions, render_dive};
