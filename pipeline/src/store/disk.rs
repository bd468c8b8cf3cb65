//! The few operations on files that the store is made of.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

/// Changes to files. A trait, so that tests can stop a run between any two of them.
pub trait Disk: Send + Sync {
    /// Makes a folder and those above it, if need be.
    ///
    /// # Errors
    /// As `std::fs::create_dir_all`.
    fn create_folder(&self, path: &Path) -> io::Result<()>;
    /// Writes a whole new file and waits until it is on the medium.
    ///
    /// # Errors
    /// As `std::io::Write::write_all`.
    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()>;
    /// Adds to the end of a file.
    ///
    /// # Errors
    /// As `std::io::Write::write_all`.
    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()>;
    /// Renames a file over another, at once.
    ///
    /// # Errors
    /// As `std::fs::rename`.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Removes a file.
    ///
    /// # Errors
    /// As `std::fs::remove_file`.
    fn remove(&self, path: &Path) -> io::Result<()>;
    /// Removes a folder if it is empty.
    ///
    /// # Errors
    /// As `std::fs::remove_dir`.
    fn remove_folder(&self, path: &Path) -> io::Result<()>;
    /// Waits until the names in a folder are on the medium.
    ///
    /// # Errors
    /// As `std::fs::File::sync_all`.
    fn sync_folder(&self, path: &Path) -> io::Result<()>;
}

/// The disk.
#[derive(Clone, Copy, Debug, Default)]
pub struct RealDisk;

impl Disk for RealDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        std::fs::create_dir_all(path)
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let mut file = File::create(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    }

    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        OpenOptions::new().create(true).append(true).open(path)?.write_all(bytes)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        std::fs::rename(from, to)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }

    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        std::fs::remove_dir(path)
    }

    fn sync_folder(&self, path: &Path) -> io::Result<()> {
        // A folder can be opened as a file, and synced, on Unix only.
        if cfg!(unix) { File::open(path)?.sync_all() } else { Ok(()) }
    }
}
