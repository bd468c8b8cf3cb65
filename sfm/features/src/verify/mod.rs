//! Geometric verification: which matches of a pair agree with one two-view geometry.
//!
//! The way of a pair: [`coherent`] finds the matches that turn alike, [`models`] estimates the epipolar geometry on them and then on all,
//! [`chance`] asks whether as many could agree by chance, [`pair`] decides which model describes the pair, and [`still`] sees to what moves
//! with the camera.

mod chance;
mod coherent;
mod models;
mod options;
mod pair;
mod still;
mod verdict;

#[cfg(test)]
mod tests;

pub use options::VerifyOptions;
pub use pair::verify_pair;
pub use verdict::{ImageForPair, PairVerdict, Rejection};
