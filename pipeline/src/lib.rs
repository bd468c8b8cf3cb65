//! The `sfm` program: dive.toml, the stage store, the stages and the recipe that joins them.
//!
//! Three layers: the command (`cli`) parses, a stage (`stages`) loads, calls and saves, and the algorithm in another
//! package computes.

mod calibrating;
pub mod cli;
pub mod clock;
pub mod config;
pub mod error;
pub mod figures;
pub mod foreign;
pub mod formats;
pub mod init;
pub mod labels;
pub mod mask_sheet;
pub mod masker;
pub mod moving;
pub mod plan;
pub mod progress;
pub mod recipe;
pub mod reference;
pub mod report;
pub mod run;
pub mod sensor_log;
pub mod stage;
pub mod stages;
pub mod store;
pub mod surfacing;
pub mod synth;
