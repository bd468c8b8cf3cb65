//! Renders a dive and writes frames, truth, sensor log and dive.toml.

use super::dive_toml::dive_toml;
use super::error::SynthError;
use super::folder::Folder;
use super::preview::Preview;
use super::truth::{encode_depth, write_truth};
use crate::progress::Progress;
use anyhow::Result;
use imaging::{encode_jpeg_rgb, encode_png_grey, encode_png_grey16, encode_png_rgb};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use synthetic::dive::{DiveOptions, DiveScene, SeenFaces};

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The configuration.
    pub dive_toml: PathBuf,
    /// Frames of all cameras.
    pub images: usize,
}

/// Writes a dive into an empty or new folder: `frames/C1/0000.jpg` and so on, `sensors.csv`, `dive.toml`, and below `truth` all that is
/// known (docs/synth.md lists it). The same options give the same bytes, on any number of threads.
///
/// # Errors
/// When the options are not possible, the folder is not empty or cannot be written.
pub fn synth(root: &Path, options: &DiveOptions, progress: &dyn Progress) -> Result<Written> {
    options.check().map_err(|detail| SynthError::Options { detail })?;
    let folder = Folder::begin(root, &format!("{options:?}\n"))?;
    let dive = DiveScene::new(options).map_err(|detail| SynthError::Options { detail })?;
    let mesh = dive.world.mesh();
    let (seen, preview) = (SeenFaces::new(mesh.faces.len()), Preview::new(&dive));
    // Exposure after exposure: a run that is looked at while it is written shows all cameras.
    let shots: Vec<(usize, usize)> = (0..dive.exposures()).flat_map(|e| (0..dive.cameras.len()).map(move |c| (c, e))).collect();
    progress.begin("frames", shots.len());
    shots.par_iter().try_for_each(|&(camera, exposure)| -> Result<()> {
        let image = dive.render(camera, exposure);
        let write = |kind: &str, extension: &str, bytes: &[u8]| {
            folder.write(&format!("{kind}/{}", DiveScene::name(camera, exposure, extension)), bytes)
        };
        let frame = match options.response.jpeg_quality {
            0 => encode_png_rgb(&image.rgb)?,
            quality => encode_jpeg_rgb(&image.rgb, quality)?,
        };
        write("frames", options.frame_extension(), &frame)?;
        write("truth/masks", "png", &encode_png_grey(&image.mask)?)?;
        write("truth/labels", "png", &encode_png_grey(&image.labels)?)?;
        write("truth/depth", "png", &encode_png_grey16(&encode_depth(&image.depth))?)?;
        seen.add(&image);
        preview.add(&image);
        progress.advance(1);
        Ok(())
    })?;
    write_truth(&folder, &dive, &mesh, &seen)?;
    folder.write("truth/preview.png", &preview.encode()?)?;
    let log = synthetic::sensors::log(&dive.motion, &options.water, &options.sensors, options.seed);
    folder.write("sensors.csv", log.to_csv().as_bytes())?;
    folder.write("dive.toml", dive_toml(&dive).as_bytes())?;
    let dive_toml = folder.path("dive.toml");
    folder.finish()?;
    Ok(Written { dive_toml, images: shots.len() })
}
