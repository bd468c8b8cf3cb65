//! The stages: each loads what it needs, calls an algorithm of another package, and saves what came out.

pub mod adopt;
pub mod densify;
pub mod evaluate;
pub mod features;
pub mod images;
pub mod ingest;
pub mod interior;
mod loops;
pub mod mask;
mod mask_votes;
pub mod matching;
pub mod model;
pub mod orient;
mod orient_figures;
mod page;
pub(crate) mod pairing;
pub mod report;
mod single_masks;
pub mod surface;
mod targets;
mod world;
