//! Which pixels show structure, and which only water.

use super::images::{ImageEntry, ImageList};
use crate::config::{Config, IpConfig, MaskStrategy, Polarity};
use crate::stage::{Outcome, Stage, Work};
use crate::store::{Fingerprint, Hashes, Warning};
use anyhow::{Context, Result};
use rayon::prelude::*;
use scene::Mask;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The stage.
pub const STAGE: Stage = Stage { name: "mask", version: 1, upstream: &["ingest"], options, inputs, work };

fn options(config: &Config) -> Value {
    match config.mask.strategy {
        MaskStrategy::Ip => json!({"strategy": config.mask.strategy, "ip": config.mask.ip}),
        _ => json!({"strategy": config.mask.strategy}),
    }
}

/// Every file that the patterns could mean.
fn inputs(config: &Config, hashes: &Hashes) -> BTreeMap<String, String> {
    if config.mask.strategy != MaskStrategy::Files {
        return BTreeMap::new();
    }
    let mut files: Vec<(String, PathBuf)> = Vec::new();
    for camera in &config.cameras {
        let Some(pattern) = &camera.mask else { continue };
        // Folders may hold signs that a pattern takes for its own; the stem stands for any text.
        let parts: Vec<String> = pattern.file("{stem}").to_string_lossy().split("{stem}").map(glob::Pattern::escape).collect();
        let found = glob::glob(&parts.join("*")).into_iter().flatten().flatten();
        files.extend(found.map(|f| (format!("{}/{}", camera.name, f.file_name().unwrap_or_default().to_string_lossy()), f)));
    }
    hashes.of_files(files)
}

/// Where the mask of an image lies.
fn mask_file(list: &ImageList, strategy: MaskStrategy, image: &ImageEntry) -> String {
    list.path_for(&format!("masks/{}", strategy.name()), image, "png")
}

/// The mask of an image, or `None` when all of it takes part.
///
/// # Errors
/// When the file is missing or damaged.
pub fn load(work: &Work<'_>, list: &ImageList, image: &ImageEntry) -> Result<Option<Mask>> {
    let path = mask_file(list, work.config.mask.strategy, image);
    if !work.has("mask", &path) {
        return Ok(None);
    }
    let bytes = work.read("mask", &path)?;
    Ok(Some(imaging::decode_grey_u8(&bytes).with_context(|| format!("the mask of {}", image.name))?))
}

/// Fingerprint of the mask of an image; of nothing when all of it takes part.
#[must_use]
pub fn content(work: &Work<'_>, list: &ImageList, image: &ImageEntry) -> Fingerprint {
    work.content("mask", &mask_file(list, work.config.mask.strategy, image)).unwrap_or_else(|_| Fingerprint::of_bytes(b""))
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let list = ImageList::load(work)?;
    let strategy = work.config.mask.strategy;
    if strategy == MaskStrategy::None {
        return Ok(Outcome { figures: json!({"strategy": strategy, "note": "none"}), warnings: Vec::new() });
    }
    work.progress.begin("masks", list.images.len());
    let made: Vec<Result<Result<f64, Warning>>> = list
        .images
        .par_iter()
        .map(|image| {
            let made = one_mask(work, &list, image);
            work.progress.advance(1);
            made
        })
        .collect();
    let (mut shares, mut warnings) = (Vec::new(), Vec::new());
    for mask in made {
        match mask? {
            Ok(share) => shares.push(share),
            Err(warning) => warnings.push(warning),
        }
    }
    let masked_ratio = (!shares.is_empty()).then(|| 1.0 - shares.iter().sum::<f64>() / shares.len() as f64);
    let empty = shares.iter().filter(|s| **s == 0.0).count();
    let note = format!("{} masks, {:.0} % of the pixels masked", shares.len(), 100.0 * masked_ratio.unwrap_or(0.0));
    let figures = json!({"strategy": strategy, "masks": shares.len(), "empty": empty, "masked_ratio": masked_ratio, "note": note});
    Ok(Outcome { figures, warnings })
}

/// Makes or takes over a mask; gives its share of structure, or why the image has none.
fn one_mask(work: &Work<'_>, list: &ImageList, image: &ImageEntry) -> Result<Result<f64, Warning>> {
    let path = mask_file(list, work.config.mask.strategy, image);
    let made = match work.config.mask.strategy {
        MaskStrategy::None => return Ok(Ok(1.0)),
        MaskStrategy::Files => from_file(work, image, &path)?,
        MaskStrategy::Ip => by_image_processing(work, list, image, &path)?,
    };
    if let Err(message) = made {
        return Ok(Err(Warning { about: image.name.clone(), message: format!("{message}; all of the image takes part") }));
    }
    // Also of a mask that an earlier run made.
    let bytes = std::fs::read(work.store.path(&path))?;
    Ok(Ok(masking::structure_share(&imaging::decode_grey_u8(&bytes)?)))
}

fn from_file(work: &Work<'_>, image: &ImageEntry, path: &str) -> Result<Result<(), String>> {
    let Some(pattern) = &work.config.cameras[image.camera].mask else { return Ok(Err("its camera has no masks".to_owned())) };
    let bytes = match std::fs::read(pattern.file(&image.stem)) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Err("it has no mask file".to_owned())),
        Err(e) => return Ok(Err(format!("its mask cannot be read: {}", e.kind()))),
    };
    let size = (image.width as usize, image.height as usize);
    let mask = imaging::decode_grey_u8(&bytes)
        .map_err(|e| e.to_string())
        .and_then(|grey| masking::mask_from_file(&grey, size).map_err(|e| e.to_string()));
    match mask {
        Ok(mask) => {
            work.files.item::<anyhow::Error>(path, Fingerprint::of_bytes(&bytes), || Ok(imaging::encode_png_grey(&mask)?))?;
            Ok(Ok(()))
        }
        Err(message) => Ok(Err(format!("its mask cannot be used: {message}"))),
    }
}

fn by_image_processing(work: &Work<'_>, list: &ImageList, image: &ImageEntry, path: &str) -> Result<Result<(), String>> {
    let options = options(work.config).to_string();
    let version = STAGE.version.to_le_bytes();
    let key = Fingerprint::of_parts([
        ("version", version.as_slice()),
        ("options", options.as_bytes()),
        ("image", image.content.as_bytes().as_slice()),
    ]);
    if work.files.reuse(path, key) {
        return Ok(Ok(()));
    }
    match imaging::decode_rgb(&list.bytes(work, image)?) {
        Ok(rgb) => {
            let made = masking::ip_mask(&rgb, &ip_options(&work.config.mask.ip));
            work.files.save(path, key, &imaging::encode_png_grey(&made.mask)?)?;
            Ok(Ok(()))
        }
        Err(error) => Ok(Err(format!("it cannot be masked: {error}"))),
    }
}

fn ip_options(config: &IpConfig) -> masking::IpOptions {
    masking::IpOptions {
        channel: config.channel as usize,
        working_long_side_px: config.working_long_side_px as usize,
        blur_sigma_px: config.blur_sigma_px,
        canny: masking::CannyThresholds { low: config.canny_low, high: config.canny_high },
        closing_radius: config.closing_radius,
        min_structure_area: config.min_structure_area,
        min_hole_area: config.min_hole_area,
        polarity: match config.polarity {
            Polarity::Dark => masking::Polarity::Dark,
            Polarity::Bright => masking::Polarity::Bright,
            Polarity::Auto => masking::Polarity::Auto,
        },
        min_textured_share: config.min_textured_share,
        reach: config.reach,
        min_texture: config.min_texture,
    }
}
