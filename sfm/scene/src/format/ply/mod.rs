//! PLY clouds and meshes (G. Turk, *The PLY polygon file format*, Stanford, 1994).

mod ascii;
mod counted;
mod elements;
mod positions;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use positions::read_ply_positions;
pub(super) use read::drop_not_finite;
pub use read::{Dropped, read_ply_cloud, read_ply_mesh};
pub use write::{write_ply_cloud, write_ply_mesh};
