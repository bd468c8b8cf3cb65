//! Why a file could not be read or written.

use std::path::PathBuf;
use thiserror::Error;

/// Why a file could not be read or written.
#[derive(Debug, Error)]
pub enum FormatError {
    /// The operating system refused a file of a directory.
    #[error("{}: {cause}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Its reason.
        cause: std::io::Error,
    },
    /// Writing to, or reading from, a stream failed.
    #[error("input or output failed: {0}")]
    Stream(#[from] std::io::Error),
    /// The bytes are not what the format says.
    #[error("{file}, byte {offset}: {what}")]
    Bytes {
        /// Kind or name of the file.
        file: &'static str,
        /// Where reading stopped.
        offset: u64,
        /// What is wrong.
        what: String,
    },
    /// A line of a text file is not what the format says.
    #[error("{file}, line {line}: {what}")]
    Line {
        /// Kind or name of the file.
        file: &'static str,
        /// Which line, from 1.
        line: u64,
        /// What is wrong.
        what: String,
    },
    /// A key of a JSON file is not what the format says.
    #[error("{file}, {key}: {what}")]
    Key {
        /// Kind or name of the file.
        file: &'static str,
        /// Path of the key.
        key: String,
        /// What is wrong.
        what: String,
    },
    /// The value has no form in the format.
    #[error("cannot be written as {format}: {what}")]
    NotRepresentable {
        /// The format.
        format: &'static str,
        /// What is in the way.
        what: String,
    },
}

impl FormatError {
    pub(super) fn file(path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |cause| Self::File { path, cause }
    }
}
