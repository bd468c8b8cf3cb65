//! Which images are compared.
//!
//! [`exhaustive`] for a few hundred images. For more, the [`union`] of [`sequential`], along the path of the vehicle, and
//! [`loop_candidates`], where the path comes back to a place: what COLMAP's sequential matcher does with a vocabulary tree learned
//! elsewhere, without one.

mod loops;
mod sequence;

#[cfg(test)]
mod tests;

pub use loops::{LoopOptions, loop_candidates};
pub use sequence::{exhaustive, sequential, union};
