//! From oriented images to a dense cloud: view selection, depth maps, consistency and fusion.
//!
//! The caller works image by image: [`select_views`] and [`depth_range`] from the sparse points, [`estimate_depth`] on the views at
//! working resolution ([`Quality`]), [`DepthMap::to_bytes`] to store the result; then [`fuse`] reads the maps back on demand. Everything is a
//! function of its arguments alone, to the bit, at any number of threads.

mod bytes;
mod cache;
mod consistency;
mod depth_map;
mod error;
mod estimate;
mod fuse;
mod isolated;
mod patchmatch;
mod quality;
mod rays;
mod seeds;
mod select;
mod view;

pub use depth_map::{DepthMap, ground_sample_distance};
pub use error::DenseError;
pub use estimate::{DepthOptions, estimate_depth, estimate_depth_from_seeds};
pub use fuse::{Fusion, FusionOptions, FusionSummary, fuse};
pub use quality::{Quality, fit};
pub use rays::RayOffsets;
pub use select::{DepthSeed, ViewSelectionOptions, depth_range, depth_seeds, select_views};
pub use view::View;
