//! Errors of `sfm synth`.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

impl SynthError {
    /// Whether the command line or the settings are wrong, rather than a file or the disk.
    #[must_use]
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::NoFolder | Self::Scene { .. } | Self::Options { .. })
    }
}

/// Why a dive cannot be written.
#[derive(Debug, Error)]
pub enum SynthError {
    /// Something lies in the folder.
    #[error("{} is not empty\n  hint: name a new folder; nothing has been written", folder.display())]
    NotEmpty {
        /// The folder.
        folder: PathBuf,
    },
    /// A dive of other options was begun in the folder.
    #[error("{} holds a part of another dive\n  hint: remove it, or name a new folder; nothing has been written", folder.display())]
    OtherDive {
        /// The folder.
        folder: PathBuf,
    },
    /// A file or folder cannot be read or written.
    #[error("{}: {cause}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// There is a file of settings, and nothing to write into.
    #[error("no folder to write into\n  hint: sfm synth SCENE.toml FOLDER")]
    NoFolder,
    /// A file of settings is wrong.
    #[error("{}: {detail}", path.display())]
    Scene {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with line and key.
        detail: String,
    },
    /// The settings describe nothing that can be rendered.
    #[error("{detail}\n  hint: docs/synth.md lists what can be set")]
    Options {
        /// Which key, and what it may be.
        detail: String,
    },
}
