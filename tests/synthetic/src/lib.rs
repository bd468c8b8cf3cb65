//! Dives with known truth: the oracle of every claim, the demo, and the benchmark.
//!
//! - [`survey`]: geometry alone, cameras, points and matches, of any size and in no time;
//! - [`dive`]: rendered frames of an artificial reef with its true surface, poses and masks;
//! - [`assert_near`]: a reconstruction against the truth, up to a rigid motion or a similarity.
//!
//! The optics of the renderer are written apart from `scene::Camera`, so that each checks the other.

pub mod dive;
mod near;
mod random;
pub mod survey;

pub use near::{Alignment, Deviation, Tolerances, assert_near, deviation};
pub use random::Random;
