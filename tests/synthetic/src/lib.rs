//! Dives with known truth: the oracle of every claim, the demo, and the benchmark.
//!
//! - [`geometry`]: cameras, rig, path, points and tracks without rendering, up to a whole survey in seconds; [`survey`]: small ones, with the
//!   pairs of matches that a mapper gets to see;
//! - [`noise`]: what measurements add to a reconstruction; [`degrade`]: what water does to a picture; [`sensors`]: what the vehicle logs;
//! - [`dive`]: rendered frames with their true surface, poses, masks and depths, from the scenes of [`world`], the paths of [`motion`], the
//!   rays of [`optics`] and [`trace`], and the light and water of [`appearance`];
//! - [`assert_near`]: a reconstruction against the truth, up to a rigid motion or a similarity.
//!
//! The optics of the renderer are written apart from `scene::Camera` and `scene::FlatPort`, so that each checks the other.

pub mod appearance;
pub mod degrade;
pub mod dive;
pub mod geometry;
pub mod motion;
mod near;
pub mod noise;
pub mod optics;
mod random;
pub mod sensors;
pub mod survey;
pub mod trace;
pub mod world;

pub use near::{Alignment, Deviation, Tolerances, assert_near, deviation};
pub use random::Random;
