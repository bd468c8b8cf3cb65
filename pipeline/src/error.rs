//! Errors that decide the exit code.

use thiserror::Error;

/// What dive.toml says cannot belong to the images, which only they tell.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct Misfit(pub String);

/// The images give no result: nothing is wrong with the program or the disk.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct NoResult(pub String);
