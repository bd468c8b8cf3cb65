//! Layouts of the intermediate files: little-endian, of one length only, checked when read.

mod bytes;
mod features;
mod matches;

pub use bytes::FormatError;
pub use features::{StoredFeatures, read_features, write_features};
pub use matches::{read_matches, write_matches};
