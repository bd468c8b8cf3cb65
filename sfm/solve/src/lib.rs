//! Minimal solvers, robust estimation and adjustment.

pub mod absolute;
mod numeric;
pub mod ransac;
pub mod relative;
#[cfg(test)]
mod testing;
pub mod triangulate;
