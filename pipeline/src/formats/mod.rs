//! Layouts of the intermediate files, checked when read: little-endian binaries of one length only, and interior orientations as text.

mod bytes;
mod calibration;
mod features;
mod matches;

pub use bytes::FormatError;
pub use calibration::{read_calibration, write_calibration};
pub use features::{StoredFeatures, read_features, write_features};
pub use matches::{read_matches, write_matches};
