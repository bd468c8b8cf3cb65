//! The folder that a dive is written into: an empty one, or one that was not finished.

use super::error::SynthError;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Lies in the folder until all is written.
const UNFINISHED: &str = ".unfinished";

/// A folder that is being written.
pub(super) struct Folder {
    root: PathBuf,
}

impl Folder {
    /// Begins a dive. `dive` tells it from others: a folder that was left unfinished is gone on with when it is the same.
    pub(super) fn begin(root: &Path, dive: &str) -> Result<Self, SynthError> {
        let folder = Self { root: root.to_path_buf() };
        let marker = folder.root.join(UNFINISHED);
        fs::create_dir_all(root).map_err(failed(root))?;
        match fs::read_to_string(&marker) {
            Ok(text) if text == dive => return Ok(folder),
            Ok(_) => return Err(SynthError::OtherDive { folder: folder.root }),
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failed(&marker)(error)),
            Err(_) => {}
        }
        if fs::read_dir(root).map_err(failed(root))?.next().is_some() {
            return Err(SynthError::NotEmpty { folder: folder.root });
        }
        folder.write(UNFINISHED, dive.as_bytes())?;
        Ok(folder)
    }

    /// A path in the folder, from its relative form with `/`.
    pub(super) fn path(&self, relative: &str) -> PathBuf {
        self.root.join(relative)
    }

    /// Writes a file, and the folders above it.
    pub(super) fn write(&self, relative: &str, bytes: &[u8]) -> Result<(), SynthError> {
        let path = self.path(relative);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(failed(parent))?;
        }
        fs::write(&path, bytes).map_err(failed(&path))
    }

    /// All is written.
    pub(super) fn finish(self) -> Result<(), SynthError> {
        let marker = self.path(UNFINISHED);
        fs::remove_file(&marker).map_err(failed(&marker))
    }
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> SynthError {
    let path = path.to_path_buf();
    move |cause| SynthError::File { path, cause }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unfinished_dive_is_finished_by_the_same_call_and_by_no_other() {
        let parent = tempfile::tempdir().unwrap();
        let root = parent.path().join("reef");
        let killed = Folder::begin(&root, "a").unwrap();
        killed.write("frames/C1/0000.jpg", b"half").unwrap();
        drop(killed);
        assert!(matches!(Folder::begin(&root, "b"), Err(SynthError::OtherDive { .. })));
        let again = Folder::begin(&root, "a").unwrap();
        again.write("frames/C1/0000.jpg", b"whole").unwrap();
        again.finish().unwrap();
        assert_eq!(fs::read(root.join("frames/C1/0000.jpg")).unwrap(), b"whole");
        assert_eq!(fs::read_dir(&root).unwrap().count(), 1, "nothing but the dive is left");
        assert!(matches!(Folder::begin(&root, "a"), Err(SynthError::NotEmpty { .. })));
    }
}
