//! Circular targets: where exactly is the centre of the one that somebody pointed at.

mod eccentricity;
mod ellipse;
mod find;
mod fit;
mod measure;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use measure::{CircleTarget, NoTarget, measure_circle};
