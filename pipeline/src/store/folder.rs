//! The output folder: who owns it, and how files get into it.

use super::disk::{Disk, RealDisk};
use super::{Stamp, StoreError};
use std::fs::{File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Says that sfm owns the folder; locked while a run writes to it.
const MARKER: &str = ".sfm";
const MARKER_TEXT: &[u8] = b"This folder is written by sfm. Runs lock this file.\n";
/// Where files are written before they are renamed into place.
const TEMPORARY: &str = ".tmp";
/// Where stamps and journals lie.
const STAMPS: &str = "stamps";
/// Everything that a run may write, directly below the folder.
pub(super) const OURS: &[&str] = &[
    super::hashes::FILE,
    TEMPORARY,
    STAMPS,
    "run.toml",
    "frames",
    "calib",
    "masks",
    "features",
    "matches",
    "sparse",
    "depth",
    "dense",
    "surface",
    "eval",
    "report.json",
    "report.html",
    "log.jsonl",
    "timings.json",
];

/// The output folder of a run, locked as long as this lives.
pub struct Store {
    root: PathBuf,
    disk: Box<dyn Disk>,
    next_temporary: AtomicU64,
    _lock: File,
}

impl Store {
    /// Opens, and makes if need be, an output folder.
    ///
    /// # Errors
    /// [`StoreError`] when it cannot be written, is in use, or holds files of our names that are not ours.
    pub fn open(root: &Path) -> Result<Self, StoreError> {
        Self::open_with(root, Box::new(RealDisk))
    }

    /// The same, with a disk of one's own.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_with(root: &Path, disk: Box<dyn Disk>) -> Result<Self, StoreError> {
        let folder_error = |cause| StoreError::Folder { folder: root.to_path_buf(), cause };
        disk.create_folder(root).map_err(folder_error)?;
        let marker = root.join(MARKER);
        if !marker.exists() {
            if let Some(name) = OURS.iter().find(|name| root.join(name).exists()) {
                return Err(StoreError::Foreign { path: root.join(name) });
            }
            // Written in place: before it is whole, nothing else is written.
            disk.write(&marker, MARKER_TEXT).map_err(folder_error)?;
        }
        let lock = OpenOptions::new().append(true).open(&marker).map_err(folder_error)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StoreError::Busy { folder: root.to_path_buf() }),
            Err(TryLockError::Error(source)) => return Err(folder_error(source)),
        }
        let store = Self { root: root.to_path_buf(), disk, next_temporary: AtomicU64::new(0), _lock: lock };
        if std::fs::read(&marker).map_err(StoreError::read(&marker))? != MARKER_TEXT {
            store.disk.write(&marker, MARKER_TEXT).map_err(StoreError::write(&marker))?;
        }
        store.clear_temporary()?;
        Ok(store)
    }

    /// The folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    pub(super) fn disk(&self) -> &dyn Disk {
        self.disk.as_ref()
    }

    /// A path in the folder, from its relative form with `/`.
    #[must_use]
    pub fn path(&self, relative: &str) -> PathBuf {
        self.root.join(relative)
    }

    /// Writes a file: whole and on the medium, or not at all.
    ///
    /// # Errors
    /// [`StoreError::Write`].
    pub fn write(&self, relative: &str, bytes: &[u8]) -> Result<(), StoreError> {
        self.write_recorded(relative, bytes, || Ok(()))
    }

    /// The same; `record` is called when all but the last step, the renaming, is done.
    pub(super) fn write_recorded(
        &self,
        relative: &str,
        bytes: &[u8],
        record: impl FnOnce() -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let target = self.path(relative);
        let temporary = self.path(&format!("{TEMPORARY}/{}", self.next_temporary.fetch_add(1, Ordering::Relaxed)));
        for folder in [temporary.parent(), target.parent()].into_iter().flatten() {
            self.disk.create_folder(folder).map_err(StoreError::write(folder))?;
        }
        let written = self.disk.write(&temporary, bytes).map_err(StoreError::write(&target)).and_then(|()| record());
        let written = written.and_then(|()| self.disk.rename(&temporary, &target).map_err(StoreError::write(&target)));
        if written.is_err() {
            // The first error is the one to tell; what is left here is cleared by the next run at the latest.
            let _ = self.disk.remove(&temporary);
        }
        written
    }

    /// Removes what stopped runs left of files that they were writing.
    ///
    /// # Errors
    /// [`StoreError::Write`].
    pub fn clear_temporary(&self) -> Result<(), StoreError> {
        let folder = self.path(TEMPORARY);
        let Ok(entries) = std::fs::read_dir(&folder) else { return Ok(()) };
        for entry in entries.flatten() {
            self.disk.remove(&entry.path()).map_err(StoreError::write(&entry.path()))?;
        }
        self.disk.remove_folder(&folder).map_err(StoreError::write(&folder))
    }

    /// Removes a file that a run of ours wrote, and the folders above it that are empty then.
    pub(super) fn remove(&self, relative: &str) -> Result<(), StoreError> {
        let path = self.path(relative);
        self.disk.remove(&path).map_err(StoreError::write(&path))?;
        let mut folder = Path::new(relative).parent();
        while let Some(parent) = folder.filter(|p| !p.as_os_str().is_empty()) {
            if self.disk.remove_folder(&self.root.join(parent)).is_err() {
                break;
            }
            folder = parent.parent();
        }
        Ok(())
    }
}

pub(super) fn stamp_file(stage: &str) -> String {
    format!("{STAMPS}/{stage}.json")
}

pub(super) fn journal_file(stage: &str) -> String {
    format!("{STAMPS}/{stage}.journal")
}

/// The stamp of a stage in an output folder; `None` when there is none that can be read.
#[must_use]
pub fn read_stamp(root: &Path, stage: &str) -> Option<Stamp> {
    serde_json::from_slice(&std::fs::read(root.join(stamp_file(stage))).ok()?).ok()
}

/// Whether a run was stopped inside the stage.
#[must_use]
pub fn is_unfinished(root: &Path, stage: &str) -> bool {
    root.join(journal_file(stage)).exists()
}
