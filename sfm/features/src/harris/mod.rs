//! Harris corners, described by the grey values about them and matched by normalised cross-correlation along a guess of the motion: the
//! method that Meline et al. found to bear suspended particles (*Comparative study of two 3D reconstruction methods for underwater
//! archaeology*, IROS 2012; docs/features.md repeats their experiment). For small motion: patches are neither turned nor scaled.

mod corners;
mod guided;
mod motion;
mod patch;
#[cfg(test)]
mod tests;

pub use corners::{HarrisOptions, extract_harris};
pub use guided::{NccOptions, match_guided};
