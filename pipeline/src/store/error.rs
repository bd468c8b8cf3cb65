//! What goes wrong with the output folder.

use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the store could not do its work. What was in the folder before is still there.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The folder cannot be made or written to.
    #[error("cannot write to the output folder {folder}: {cause}", folder = folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// A file could not be written, renamed or removed.
    #[error("cannot write {path}: {cause}{hint}", path = path.display(), hint = hint(cause))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// A file could not be read.
    #[error("cannot read {path}: {cause}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// The folder holds something of a name that the run would use, and no run of ours wrote it.
    #[error(
        "{path} exists, and was not written by sfm; nothing was changed\n  hint: name an empty or new folder as `output` in [dive]",
        path = path.display()
    )]
    Foreign {
        /// What is in the way.
        path: PathBuf,
    },
    /// Another run writes to the folder.
    #[error("another run of sfm is writing to {folder}\n  hint: wait for it, or name another `output` in [dive]", folder = folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// A file is not what the stage wrote.
    #[error("{path} is not as the stage `{stage}` wrote it\n  hint: `sfm run --force {stage}` makes it anew", path = path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The stage that made it.
        stage: String,
    },
    /// A stage asks for a file that the stage before did not make.
    #[error("the stage `{stage}` made no {path}")]
    NoOutput {
        /// The file.
        path: String,
        /// The stage that should have made it.
        stage: String,
    },
}

fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull => "\n  hint: make room on the disk and start again: the run goes on where it stopped",
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "\n  hint: name a folder that you may write to as `output` in [dive]"
        }
        _ => "",
    }
}

impl StoreError {
    pub(super) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |cause| Self::Write { path, cause }
    }

    pub(super) fn read(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |cause| Self::Read { path, cause }
    }
}
