//! Geometric verification: which matches of a pair agree with one two-view geometry.
//!
//! The way of a pair: [`coherent`] finds the matches that turn alike, [`models`] estimates the epipolar geometry on them and then on all,
//! [`chance`] asks whether as many could agree by chance, [`pair`] decides which model describes the pair, and [`still`] sees to what moves
//! with the camera. [`focal`] estimates what is not known of a camera from its pairs.

mod chance;
mod coherent;
mod focal;
mod models;
mod options;
mod pair;
mod still;
mod verdict;

#[cfg(test)]
mod focal_tests;
#[cfg(test)]
mod tests;

pub use focal::{InteriorEstimate, PairForInterior, interior_from_pairs};
pub use options::VerifyOptions;
pub use pair::verify_pair;
pub(crate) use pair::{Guess, guess, verify_from};
pub use verdict::{ImageForPair, PairVerdict, Rejection};
