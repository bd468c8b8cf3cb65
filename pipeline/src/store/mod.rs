//! The output folder: fingerprints, stamps, and files that are whole or absent.
//!
//! - A stage's fingerprint is BLAKE3 over its version, its options, the content of its inputs and the fingerprints
//!   upstream ([`Identity`]).
//! - Files are written to a temporary name, synced and renamed ([`Store::write`]).
//! - A stage is done when its [`Stamp`] is there, matches, and no journal lies beside it ([`StageFiles`]).
//! - Nothing is removed that was not written by a run, or that was changed since.

mod disk;
mod error;
mod fingerprint;
mod folder;
mod hashes;
#[cfg(test)]
mod laws;
mod stage_files;
mod stamp;

pub use disk::{Disk, RealDisk};
pub use error::StoreError;
pub use fingerprint::Fingerprint;
pub use folder::{Store, is_unfinished, read_stamp};
pub use hashes::Hashes;
pub use stage_files::StageFiles;
pub use stamp::{Identity, Output, Stamp, Warning};
