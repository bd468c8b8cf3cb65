//! How good a cloud, a trajectory or a length is, measured against a reference.
//!
//! This package never imports the code that it judges. The cloud metrics are those of Rofallski, Tholen, Helmholz, Parnum
//! & Luhmann, *Measuring artificial reefs using a multi-camera system for unmanned underwater vehicles*, ISPRS Archives,
//! 2020, section 5 (number of points, mean cloud-to-mesh distance, signal-to-noise ratio, surface density, integrity),
//! and those of Knapitsch et al., *Tanks and Temples*, ACM TOG, 2017 (accuracy, completeness, F-score). Each field of
//! [`CloudMetrics`] states its formula. All results are the same to the bit at any number of threads.

mod cloud_metrics;
mod distance;
mod error;
mod grid;
mod length;
mod morton;
mod statistics;
mod surface;
#[cfg(test)]
mod tests;
pub mod trajectory;

pub use cloud_metrics::{CloudMetrics, EvalOptions, Percentiles, evaluate};
pub use distance::{Reference, distances};
pub use error::EvalError;
pub use length::{LengthCheck, LengthSummary, summarise_lengths};
