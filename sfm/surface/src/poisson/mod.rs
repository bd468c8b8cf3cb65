//! Screened Poisson reconstruction.

mod attributes;
mod base;
mod cubes;
mod density;
mod divergence;
mod extract;
mod kernel;
mod level;
mod options;
mod reconstruct;
mod samples;
mod screen;
mod solve;
mod transfer;

pub use options::{PoissonOptions, Resolution};
pub use reconstruct::{LevelSummary, PoissonSummary, PoissonSurface, reconstruct};
