//! The way from photographs to measurements, station by station.

use crate::stage::Stage;
use crate::stages::{densify, evaluate, features, ingest, mask, matching, orient, report, surface};

/// The stations, in order. Each says what it builds on; `sfm status` shows where a dive stands.
pub const RECIPE: &[&Stage] = &[
    // Which images are there, and which were exposed at the same instant?
    &ingest::STAGE,
    // Which pixels show structure, and which only water?
    &mask::STAGE,
    // Which points of an image would be recognised in another one?
    &features::STAGE,
    // Which of them are seen again where, in agreement with the geometry of two views?
    &matching::STAGE,
    // Where did every camera stand, how does it project, and where are the points?
    &orient::STAGE,
    // How far away is what each pixel shows, and what do all images together say of the surface?
    &densify::STAGE,
    // Which surface goes through it, how large and how rough is it, what volume lies under it?
    &surface::STAGE,
    // How far is the cloud from the truth, where a truth is known?
    &evaluate::STAGE,
    // All figures, in one file for programs and one page for people.
    &report::STAGE,
];
