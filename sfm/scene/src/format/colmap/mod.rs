//! Models as COLMAP 3.12 and later store them: `cameras`, `rigs`, `frames`, `images`, `points3D`, binary or text.
//!
//! Conventions agree (`b_from_a`, x right, y down, the centre of the top-left pixel at (0.5, 0.5)), so values are
//! copied; ids are ours plus one, because COLMAP's database counts from one. Only oriented frames and their images are
//! written; observations in other images are left out, and so is a point without any observation left. The unit of the
//! world ([`crate::Scale`]) has no place in the format.

mod camera;
mod model;
mod read;
mod read_text;
#[cfg(test)]
mod tests;
mod write_binary;
mod write_text;

pub use model::ColmapModel;
pub use read::{ColmapFiles, read_colmap, read_colmap_binary};
pub use read_text::{read_colmap_model, read_colmap_text};

use super::FormatError;
use crate::Reconstruction;
use std::io::Write;
use std::path::Path;

/// Writes `cameras.bin`, `rigs.bin`, `frames.bin`, `images.bin` and `points3D.bin` into `dir`, which is made if needed.
///
/// # Errors
/// As [`ColmapModel::new`]; [`FormatError::File`] where a file cannot be written.
pub fn write_colmap_binary(reconstruction: &Reconstruction, dir: &Path) -> Result<(), FormatError> {
    let model = ColmapModel::new(reconstruction)?;
    let file = |name: &str, write: &dyn Fn(&mut dyn Write) -> std::io::Result<()>| write_file(&dir.join(name), write);
    std::fs::create_dir_all(dir).map_err(FormatError::file(dir))?;
    file("cameras.bin", &|out| model.write_cameras_binary(out))?;
    file("rigs.bin", &|out| model.write_rigs_binary(out))?;
    file("frames.bin", &|out| model.write_frames_binary(out))?;
    file("images.bin", &|out| model.write_images_binary(out))?;
    file("points3D.bin", &|out| model.write_points_binary(out))
}

/// As [`write_colmap_binary`], as `cameras.txt` and so on. Every number is written so that it reads back exactly.
///
/// COLMAP ends an image name at the first space, so names with spaces need the binary form.
///
/// # Errors
/// As [`write_colmap_binary`].
pub fn write_colmap_text(reconstruction: &Reconstruction, dir: &Path) -> Result<(), FormatError> {
    let model = ColmapModel::new(reconstruction)?;
    let file = |name: &str, write: &dyn Fn(&mut dyn Write) -> std::io::Result<()>| write_file(&dir.join(name), write);
    std::fs::create_dir_all(dir).map_err(FormatError::file(dir))?;
    file("cameras.txt", &|out| model.write_cameras_text(out))?;
    file("rigs.txt", &|out| model.write_rigs_text(out))?;
    file("frames.txt", &|out| model.write_frames_text(out))?;
    file("images.txt", &|out| model.write_images_text(out))?;
    file("points3D.txt", &|out| model.write_points_text(out))
}

fn write_file(path: &Path, write: &dyn Fn(&mut dyn Write) -> std::io::Result<()>) -> Result<(), FormatError> {
    let write_all = || {
        let mut out = std::io::BufWriter::with_capacity(1 << 18, std::fs::File::create(path)?);
        write(&mut out)?;
        out.flush()
    };
    write_all().map_err(FormatError::file(path))
}
