//! The list of images that `ingest` makes and every later stage reads.

use crate::config::{Config, ImageSource};
use crate::stage::Work;
use crate::store::Fingerprint;
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

/// Where the list lies in the output folder.
pub const FILE: &str = "frames/images.json";

/// Cameras and images, by id.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageList {
    /// Cameras, in the order of dive.toml.
    pub cameras: Vec<CameraEntry>,
    /// Usable images, camera after camera, in the order of their exposures.
    pub images: Vec<ImageEntry>,
    /// Number of files and video frames that were looked at, usable or not.
    pub found: usize,
}

/// What the images of a camera say about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraEntry {
    /// Its name.
    pub name: String,
    /// Size of its images, pixels; `None` when none is usable.
    pub size: Option<(u32, u32)>,
    /// Median focal length according to EXIF, pixels.
    pub exif_focal_px: Option<f64>,
}

/// One usable image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageEntry {
    /// `camera/file`, unique.
    pub name: String,
    /// Index of its camera.
    pub camera: usize,
    /// Its name without camera and extension, unique in its camera: files made from it are named so.
    pub stem: String,
    /// Position among the camera's files; `None` for a video frame, which lies in the store.
    pub position: Option<usize>,
    /// Number of the simultaneous exposure.
    pub exposure: u32,
    /// When it was taken, seconds; `None` where neither EXIF nor a video tells it.
    pub time_secs: Option<f64>,
    /// Columns, pixels.
    pub width: u32,
    /// Rows, pixels.
    pub height: u32,
    /// BLAKE3 of the file.
    pub content: Fingerprint,
}

impl ImageList {
    /// The list that `ingest` made.
    ///
    /// # Errors
    /// When it is missing or damaged.
    pub fn load(work: &Work<'_>) -> Result<Self> {
        serde_json::from_slice(&work.read("ingest", FILE)?).context("the list of images cannot be read")
    }

    /// The file of an image, whole.
    ///
    /// # Errors
    /// When it cannot be read, or is no longer the one that was ingested.
    pub fn bytes(&self, work: &Work<'_>, image: &ImageEntry) -> Result<Vec<u8>> {
        let Some(position) = image.position else {
            return Ok(work.read("ingest", &frame_file(&self.cameras[image.camera].name, &image.stem))?);
        };
        self.file_bytes(work.config, image, position)
    }

    /// As [`ImageList::bytes`], without a stage.
    ///
    /// # Errors
    /// As there.
    pub fn bytes_in(&self, config: &Config, image: &ImageEntry) -> Result<Vec<u8>> {
        let Some(position) = image.position else {
            let file = config.output.join(frame_file(&self.cameras[image.camera].name, &image.stem));
            return std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()));
        };
        self.file_bytes(config, image, position)
    }

    fn file_bytes(&self, config: &Config, image: &ImageEntry, position: usize) -> Result<Vec<u8>> {
        let ImageSource::Files(files) = &config.cameras[image.camera].images else { bail!("{} is no file", image.name) };
        let bytes = std::fs::read(&files[position]).with_context(|| format!("cannot read {}", files[position].display()))?;
        if Fingerprint::of_bytes(&bytes) != image.content {
            bail!("{} changed while the run was going on; start it again", files[position].display());
        }
        Ok(bytes)
    }

    /// Path of a file that a stage makes for an image: `folder/camera/stem.extension`.
    #[must_use]
    pub fn path_for(&self, folder: &str, image: &ImageEntry, extension: &str) -> String {
        format!("{folder}/{}/{}.{extension}", self.cameras[image.camera].name, image.stem)
    }
}

/// Where a frame of a video is kept.
#[must_use]
pub fn frame_file(camera: &str, stem: &str) -> String {
    format!("frames/{camera}/{stem}.png")
}
