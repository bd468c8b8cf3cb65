//! Chequerboards in photographs.

mod candidates;
mod detect;
mod graph;
mod grid;
mod order;
mod pattern;
#[cfg(test)]
mod tests;

pub use detect::{Board, BoardFinding, detect_board};
