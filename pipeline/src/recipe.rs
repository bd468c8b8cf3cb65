//! The way from photographs to measurements, station by station.

use crate::stage::Stage;
use crate::stages::{features, ingest, mask};

/// The stations, in order. Each says what it builds on; `sfm status` shows where a dive stands.
pub const RECIPE: &[&Stage] = &[
    // Which images are there, and which were exposed at the same instant?
    &ingest::STAGE,
    // Which pixels show structure, and which only water?
    &mask::STAGE,
    // Which points of an image would be recognised in another one?
    &features::STAGE,
];
