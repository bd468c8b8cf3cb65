//! Minimal solvers, robust estimation and adjustment.

pub mod absolute;
pub mod adjust;
pub mod averaging;
pub mod bal;
pub mod lie;
mod numeric;
pub mod ransac;
pub mod relative;
pub mod robust;
#[cfg(test)]
mod testing;
pub mod triangulate;
