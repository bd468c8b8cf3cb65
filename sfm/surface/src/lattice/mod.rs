//! Sparse lattices: values in bricks of 8 x 8 x 8 nodes.

mod bricks;
mod halo;
mod morton;

pub(crate) use bricks::{Bricks, NONE};
pub(crate) use halo::{HALO, halo_index, load_halo};
pub(crate) use morton::{Coordinates, decode, encode};

/// Nodes along the edge of a brick.
pub(crate) const EDGE: usize = 8;
/// Nodes of a brick.
pub(crate) const NODES: usize = EDGE * EDGE * EDGE;
