//! What the vehicle logs on a dive.

mod log;
mod options;
#[cfg(test)]
mod tests;

pub use log::{Reading, SensorLog, log};
pub use options::SensorOptions;
