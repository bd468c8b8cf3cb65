//! `sfm calibrate`: from photographs of a target to files that dive.toml reads, and the check whether they are still true.

mod check;
mod drawings;
mod figures;
mod files;
mod page;
mod photographs;
mod record;
mod solve;

pub use check::{Check, check};
pub use record::Record;
pub use solve::{Made, make};
