//! Rendered dives.

mod blur;
mod moving;
mod options;
mod picks;
mod presets;
mod render;
mod rig;
mod scene;
mod seen;
mod shade;
mod sky;
mod snow;
#[cfg(test)]
mod tests;
mod truth;
mod visible;

pub use options::{CameraOptions, DiveOptions, PortKind, PortOptions, ResponseOptions, RigOptions};
pub use picks::{PICK_SIGMA_PX, Pick};
pub use presets::{Preset, WaterKind};
pub use render::{DiveImage, NO_FACE};
pub use rig::DiveCamera;
pub(crate) use rig::cameras as dive_cameras;
pub use scene::{Dive, DiveScene, render_dive};
pub use seen::SeenFaces;
