//! Matching of descriptors: exhaustive nearest neighbours with a ratio and a mutual test.
//!
//! The way of a pair: [`packed`] lays both lists out for the instruction set, [`scan`] computes every dot product once and keeps the two
//! nearest of each row and each column, [`matcher`] applies the tests. [`lanes`] says what an instruction set has to offer; [`portable`],
//! [`x86`] and [`arm`] offer it, and [`instructions`] chooses at run time.
//!
//! Bits: distances are integers, so every instruction set gives the same result; ties go to the lower index.

#[cfg(target_arch = "aarch64")]
mod arm;
mod instructions;
mod lanes;
mod matcher;
mod packed;
mod portable;
mod scan;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(test)]
mod tests;

pub(crate) use matcher::nearest;
pub use matcher::{MatchOptions, match_descriptors};
pub(crate) use scan::Nearest;
