//! Renders a dive and writes frames, truth and dive.toml.

use super::dive_toml::dive_toml;
use super::folder::Folder;
use crate::progress::Progress;
use anyhow::{Context, Result};
use imaging::{encode_jpeg_rgb, encode_png_grey};
use rayon::prelude::*;
use scene::ImageId;
use scene::format::{write_colmap_binary, write_ply_mesh};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use synthetic::dive::{Dive, DiveOptions, DiveScene};

/// Quality of the JPEG files, 1 to 100: what a camera calls its best.
const JPEG_QUALITY: u8 = 95;

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The configuration.
    pub dive_toml: PathBuf,
    /// Frames of all cameras.
    pub images: usize,
}

/// Writes a dive into an empty or new folder: `frames/C1/0000.jpg` and so on, `dive.toml`, and below `truth` the surface,
/// the poses and the masks. The same options give the same bytes, on any number of threads. One frame a thread is held.
///
/// # Errors
/// When the folder is not empty or cannot be written.
pub fn synth(root: &Path, options: &DiveOptions, progress: &dyn Progress) -> Result<Written> {
    let folder = Folder::begin(root, &format!("{options:?}\n"))?;
    let dive = DiveScene::new(options);
    let shots: Vec<(usize, usize)> = (0..dive.cameras.len()).flat_map(|c| (0..options.exposures).map(move |e| (c, e))).collect();
    progress.begin("frames", shots.len());
    shots.par_iter().try_for_each(|&(camera, exposure)| -> Result<()> {
        let image = dive.render(camera, exposure);
        folder.write(&format!("frames/{}", Dive::name(camera, exposure, "jpg")), &encode_jpeg_rgb(&image.rgb, JPEG_QUALITY)?)?;
        folder.write(&format!("truth/masks/{}", Dive::name(camera, exposure, "png")), &encode_png_grey(&image.mask)?)?;
        progress.advance(1);
        Ok(())
    })?;
    write_truth(&folder, &dive)?;
    folder.write("dive.toml", dive_toml(&dive, options).as_bytes())?;
    let dive_toml = folder.path("dive.toml");
    folder.finish()?;
    Ok(Written { dive_toml, images: shots.len() })
}

fn write_truth(folder: &Folder, dive: &DiveScene) -> Result<()> {
    let mut mesh = Vec::new();
    write_ply_mesh(&dive.mesh(), &mut mesh)?;
    folder.write("truth/mesh.ply", &mesh)?;
    let truth = dive.truth("jpg");
    let sparse = folder.path("truth/sparse");
    write_colmap_binary(&truth, &sparse).with_context(|| sparse.display().to_string())?;
    let mut positions = String::from("# image x y z: projection centres in the frame of mesh.ply, metres\n");
    for (i, image) in truth.images.iter().enumerate() {
        let pose = truth.cam_from_world(ImageId::new(i)).context("every frame of a synthetic dive has a pose")?;
        let centre = pose.centre();
        let _ = writeln!(positions, "{} {:.6} {:.6} {:.6}", image.name, centre.x, centre.y, centre.z);
    }
    folder.write("truth/positions.txt", positions.as_bytes())?;
    Ok(())
}
