//! Matching and verification of a pair of images at a fraction of the cost of an exhaustive scan.
//!
//! The way of a pair: the strongest keypoints of both images are matched exhaustively and verified ([`pair`]); what agrees says where the
//! rest of one image lies in the other ([`motion`]), and each of the other keypoints is compared with those of its window only
//! ([`search`], over the cells of [`cells`] with the kernels of [`distance`]); all matches together are verified as ever. Where the strongest do
//! not agree, all are compared with all.

mod cells;
mod distance;
mod image;
mod motion;
mod pair;
mod search;

#[cfg(test)]
mod tests;

pub use image::MatchImage;
pub use pair::{GuidedOptions, match_pair};
