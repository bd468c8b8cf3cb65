//! How good a cloud, a trajectory or a length is, measured against a reference.
//!
//! This package never imports the code that it judges. The cloud metrics are those of Rofallski, Tholen, Helmholz, Parnum
//! & Luhmann, *Measuring artificial reefs using a multi-camera system for unmanned underwater vehicles*, ISPRS Archives,
//! 2020, section 5 (number of points, mean cloud-to-mesh distance, signal-to-noise ratio, surface density, integrity),
//! and those of Knapitsch et al., *Tanks and Temples*, ACM TOG, 2017 (accuracy, completeness, F-score). Each field of
//! [`CloudMetrics`] states its formula. All results are the same to the bit at any number of threads.

mod cloud_metrics;
pub mod dem;
mod distance;
mod distribution;
mod error;
mod gather;
mod grid;
mod hilbert;
mod icp;
mod length;
mod m3c2;
mod neighbours;
mod points;
mod region;
pub mod relative_pose;
mod statistics;
mod surface;
#[cfg(test)]
mod tests;
pub mod trajectory;
mod volume;
mod warnings;

pub use cloud_metrics::{CloudMetrics, CurvePoint, EachDistance, EvalOptions, Percentiles, evaluate, evaluate_each};
pub use distance::{Reference, distances};
pub use distribution::{Histogram, NormalFit, WeibullFit};
pub use error::EvalError;
pub use icp::{IcpSummary, icp};
pub use length::{LengthCheck, LengthSummary, summarise_lengths};
pub use m3c2::{M3c2Options, M3c2Point, M3c2Summary, m3c2};
pub use points::{EachPiece, Points, Prepared};
pub use region::Region;
pub use volume::{MeshSize, mesh_size};
