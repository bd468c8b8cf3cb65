//! Multi-view PatchMatch stereo with slanted planes on two interleaved (red and black) pixel sets.
//!
//! After Galliani, Lasinger & Schindler, *Massively parallel multiview stereopsis by surface normal diffusion*, ICCV 2015, with the
//! neighbour regions of Xu & Tao, *Multi-scale geometric consistency guided multi-view stereo*, CVPR 2019, coarse to fine. Planes are kept
//! as inverse depth and its gradient, in which moving to the next pixel is an addition and a homography costs nine products.
//!
//! Behind a flat port the rays of a camera do not meet. Over a window their offset hardly changes: the reference is there a pinhole whose
//! centre is moved by the offset, and a neighbour one whose image is moved by its own, so that homographies stay.

mod grey;
mod grid;
mod level;
mod offsets;
mod patch;
mod plane;
mod propagate;
mod random;
mod score;
#[cfg(test)]
mod tests;

pub(crate) use grey::{GreyView, halve_grey, halve_valid};
pub(crate) use grid::Cell;
pub(crate) use level::{Level, Start, search};
pub(crate) use offsets::LevelOffsets;
pub(crate) use patch::PatchWeights;
pub(crate) use plane::Pinhole;
pub(crate) use propagate::SearchOptions;
pub(crate) use score::{Kernel, SourceView};
