//! `sfm synth`: a dive with known truth, written as a folder that `sfm run` takes.

mod dive_toml;
mod error;
mod folder;
mod preview;
mod scene_file;
mod truth;
mod write;

pub use error::SynthError;
pub use scene_file::read_scene;
pub use write::{Written, synth};
