//! Whole orientations of synthetic surveys against their truth.

mod determinism;
mod edges;
mod exact;
mod failures;
mod global;
mod lengths;
mod port;
mod quality;
mod rig;
mod single;
mod support;
mod world;
mod wrong;
