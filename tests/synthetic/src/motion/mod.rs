//! How the rig moves: a smooth path with the unrest of a vehicle in a current.

mod options;
mod path;

pub use options::{MotionKind, MotionOptions};
pub use path::Motion;
