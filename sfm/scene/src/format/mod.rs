//! File formats: COLMAP models, nerfstudio and Bundler files, PLY clouds and meshes, OBJ, OFF, STL and GLB
//! meshes, points as text.
//!
//! Readers trust nothing: every count is checked against what is left of the file before memory is taken for it, and a
//! broken file gives a [`FormatError`] that says where. Writers give the same bytes for the same value.

mod bundler;
mod bytes;
pub mod colmap;
mod error;
mod glb;
mod nerfstudio;
mod obj;
mod off;
pub mod ply;
mod stl;
#[cfg(test)]
mod testing;
mod xyz;

pub use bundler::{read_bundler, write_bundler};
pub use colmap::{ColmapModel, read_colmap_binary, read_colmap_model, read_colmap_text, write_colmap_binary, write_colmap_text};
pub use error::FormatError;
pub use glb::write_glb_mesh;
pub use nerfstudio::{read_nerfstudio, write_nerfstudio};
pub use obj::{read_obj_mesh, write_obj_mesh};
pub use off::read_off_mesh;
pub use ply::{Dropped, read_ply_cloud, read_ply_mesh, read_ply_positions, write_ply_cloud, write_ply_mesh};
pub use stl::read_stl_mesh;
pub use xyz::read_xyz;
