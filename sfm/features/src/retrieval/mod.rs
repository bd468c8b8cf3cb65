//! Which images may show the same place: a vocabulary learned from the dive itself, Hamming embedding and votes.
//!
//! A [`Codebook`] splits the space of descriptors into words, by k-means within k-means (Nistér & Stewénius, CVPR 2006) on a bounded sample
//! of the dive. [`Codebook::describe`] stores for the best features of an image their words and signatures of 64 bits: on which side of
//! the word's centre they lie along as many directions (Jégou, Douze & Schmid, ECCV 2008). The index (private, behind
//! [`pairs::loop_candidates`](crate::pairs::loop_candidates)) lets every feature vote for the images that have one of the same word and a
//! similar signature; one feature has one vote an image, so that repeated texture does not win (Jégou, Douze & Schmid, CVPR 2009). Words are
//! about equally frequent, having been learned from the dive: weights by their rarity (Sivic & Zisserman, ICCV 2003) did not help.
//!
//! Why not VLAD (Jégou et al., CVPR 2010), which is smaller still: a sea floor repeats itself, and on it the sums of residuals of thousands
//! of alike features tell less than a few hundred features one by one.
//!
//! Bits: everything is integer arithmetic, so thread count and instruction set change nothing.

mod codebook;
mod hamming;
mod index;
mod kmeans;
mod options;

#[cfg(test)]
mod tests;

pub use codebook::{Codebook, GlobalDescriptor};
pub(crate) use index::Index;
pub use options::RetrievalOptions;
