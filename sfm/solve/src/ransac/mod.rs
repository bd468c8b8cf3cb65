//! Robust estimation of a model from correspondences with outliers: LO-RANSAC in three parts that vary alone.
//!
//! - an [`Estimator`] knows the model: it solves a minimal sample, measures errors and refines;
//! - a [`Sampler`] draws minimal samples: [`UniformSampler`], [`GroupedSampler`];
//! - a [`Scoring`] turns errors into a cost: [`Msac`], [`InlierCount`].
//!
//! [`run`] joins them; [`improve`] starts from a model instead of samples. Results depend on the input and the seed alone.

mod engine;
mod sampler;
mod scoring;
#[cfg(test)]
mod tests;

pub use engine::{Estimator, Ransac, RansacOptions, improve, run};
pub use sampler::{GroupedSampler, Sampler, UniformSampler};
pub use scoring::{InlierCount, Msac, Scoring};
