//! `sfm synth`: a dive with known truth, written as a folder that `sfm run` takes.

mod dive_toml;
mod folder;
mod write;

pub use folder::SynthError;
pub use write::{Written, synth};
