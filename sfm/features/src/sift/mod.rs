//! SIFT keypoints with RootSIFT descriptors.
//!
//! Lowe, *Distinctive image features from scale-invariant keypoints*, IJCV 2004; Arandjelovic & Zisserman, *Three things everyone should
//! know to improve object retrieval*, CVPR 2012.
//!
//! The way of an image: [`pyramid`] runs over its octaves; in each, [`band`] streams rows through the Gaussian cascade of [`blur`], looks for
//! extrema of neighbouring differences with [`extrema`] and localises them with [`refine`]. [`select`] chooses which keypoints to keep, and
//! [`orientation`] and [`descriptor`] describe those.
//!
//! Bits: kernels are plain loops with a fixed order of separate multiplications and additions, compiled once for every instruction set
//! ([`simd`]), so each gives the same result; the work of a thread never changes what is computed, only where.

mod band;
mod blur;
mod descriptor;
mod extract;
mod extrema;
mod options;
mod orientation;
mod pyramid;
mod refine;
mod select;
mod simd;

#[cfg(test)]
mod tests;

pub use extract::extract;
pub use options::SiftOptions;
