//! Errors that decide the exit code.

use thiserror::Error;

/// The images give no result: nothing is wrong with the program or the disk.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct NoResult(pub String);
