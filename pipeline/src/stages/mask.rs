//! Which pixels show structure, and which only water.

use super::images::{ImageEntry, ImageList};
use crate::config::{Config, MaskStrategy, OtsuOf};
use crate::masker::{Masker, ip_options};
use crate::stage::{Outcome, Stage, Work};
use crate::store::{Fingerprint, Hashes, Warning};
use anyhow::{Context, Result};
use rayon::prelude::*;
use scene::Mask;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The stage.
pub const STAGE: Stage = Stage { name: "mask", version: 2, upstream: &["ingest"], options, inputs, work };

fn options(config: &Config) -> Value {
    let mask = &config.mask;
    let mut options = json!({"strategy": mask.strategy});
    if mask.strategy.has_ip() || mask.strategy.has_ml() {
        options["areas"] = json!(mask.areas);
        options["preprocessing"] = json!(mask.preprocessing);
    }
    if mask.strategy.has_ip() {
        options["ip"] = json!(mask.ip);
    }
    if mask.strategy.has_ml() {
        options["ml"] = json!(mask.ml);
    }
    if mask.strategy == MaskStrategy::IpMl {
        options["combine"] = json!(mask.combine);
    }
    options
}

/// Every file that the patterns could mean, or the model with its card.
fn inputs(config: &Config, hashes: &Hashes) -> BTreeMap<String, String> {
    if config.mask.strategy.has_ml() {
        return match &config.mask.ml.model {
            Some(model) => hashes.of_files(vec![("model".to_owned(), model.clone()), ("card".to_owned(), model.with_extension("toml"))]),
            None => BTreeMap::from([("model".to_owned(), models::sha256(models::BUILT_IN_CARD.as_bytes()))]),
        };
    }
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

/// Whether an image shows no structure at all: later stages leave it out.
#[must_use]
pub fn is_empty(work: &Work<'_>, image: &ImageEntry) -> bool {
    let empty = work.done.get("mask").and_then(|stamp| stamp.figures["empty_images"].as_array());
    empty.is_some_and(|names| names.iter().any(|name| name == image.name.as_str()))
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let list = ImageList::load(work)?;
    let strategy = work.config.mask.strategy;
    if strategy == MaskStrategy::None {
        return Ok(Outcome { figures: json!({"strategy": strategy, "note": "none"}), warnings: Vec::new() });
    }
    let masker = Masker::new(&work.config.mask)?;
    let thresholds = thresholds(work, &list, &masker)?;
    work.progress.begin("masks", list.images.len());
    let made: Vec<Result<Result<f64, Warning>>> = list
        .images
        .par_iter()
        .map(|image| {
            let made = one_mask(work, &list, image, &masker, thresholds[image.camera]);
            work.progress.advance(1);
            made
        })
        .collect();
    let (mut shares, mut warnings, mut empty) = (Vec::new(), Vec::new(), Vec::new());
    let mut per_camera = vec![(0.0, 0usize); list.cameras.len()];
    for (image, mask) in list.images.iter().zip(made) {
        match mask? {
            Ok(share) => {
                shares.push(share);
                per_camera[image.camera].0 += 1.0 - share;
                per_camera[image.camera].1 += 1;
                if share == 0.0 {
                    empty.push(image.name.clone());
                }
            }
            Err(warning) => warnings.push(warning),
        }
    }
    let masked_ratio = (!shares.is_empty()).then(|| 1.0 - shares.iter().sum::<f64>() / shares.len() as f64);
    let note = format!("{} masks, {:.0} % of the pixels masked", shares.len(), 100.0 * masked_ratio.unwrap_or(0.0));
    let of_camera = |(name, (sum, n)): (&String, &(f64, usize))| (name.clone(), (*n > 0).then(|| sum / *n as f64).into());
    let per_camera: serde_json::Map<String, Value> = list.cameras.iter().map(|c| &c.name).zip(&per_camera).map(of_camera).collect();
    let mut figures = json!({
        "strategy": strategy,
        "masks": shares.len(),
        "empty": empty.len(),
        "empty_images": empty,
        "masked_ratio": masked_ratio,
        "masked_ratio_by_camera": per_camera,
        "note": note,
    });
    if let Some((name, sha256)) = masker.model() {
        figures["classifier"] = json!({"name": name, "sha256": sha256, "runtime": masker.library()});
    }
    Ok(Outcome { figures, warnings })
}

/// The threshold of each camera, where it is of the whole dive.
fn thresholds(work: &Work<'_>, list: &ImageList, masker: &Masker<'_>) -> Result<Vec<Option<u8>>> {
    let config = &work.config.mask;
    if !config.strategy.has_ip() || config.ip.otsu == OtsuOf::Image {
        return Ok(vec![None; list.cameras.len()]);
    }
    work.progress.begin("grey values", list.images.len());
    let histograms: Vec<Result<Option<[u64; 256]>>> = list
        .images
        .par_iter()
        .map(|image| {
            let rgb = imaging::decode_rgb(&list.bytes(work, image)?);
            work.progress.advance(1);
            // A damaged image is told when its mask is made.
            let Ok(rgb) = rgb else { return Ok(None) };
            let options = ip_options(&config.ip, &config.areas, rgb.width(), rgb.height());
            Ok(Some(masking::histogram(&masker.prepared(rgb), &options)))
        })
        .collect();
    let mut sums = vec![[0u64; 256]; list.cameras.len()];
    for (image, histogram) in list.images.iter().zip(histograms) {
        if let Some(histogram) = histogram? {
            sums[image.camera].iter_mut().zip(histogram).for_each(|(sum, n)| *sum += n);
        }
    }
    Ok(sums.iter().map(|histogram| masking::otsu(histogram).map(|split| split.threshold)).collect())
}

/// Makes or takes over a mask; gives its share of structure, or why the image has none.
fn one_mask(
    work: &Work<'_>,
    list: &ImageList,
    image: &ImageEntry,
    masker: &Masker<'_>,
    threshold: Option<u8>,
) -> Result<Result<f64, Warning>> {
    let path = mask_file(list, work.config.mask.strategy, image);
    let made = match work.config.mask.strategy {
        MaskStrategy::Files => from_file(work, image, &path)?,
        _ => from_image(work, list, image, &path, masker, threshold)?,
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

fn from_image(
    work: &Work<'_>,
    list: &ImageList,
    image: &ImageEntry,
    path: &str,
    masker: &Masker<'_>,
    threshold: Option<u8>,
) -> Result<Result<(), String>> {
    let options = options(work.config).to_string();
    let version = STAGE.version.to_le_bytes();
    let key = Fingerprint::of_parts([
        ("version", version.as_slice()),
        ("options", options.as_bytes()),
        ("image", image.content.as_bytes().as_slice()),
        ("threshold", threshold.as_slice()),
        ("model", masker.model().map_or("", |m| m.1).as_bytes()),
        ("runtime", masker.library().unwrap_or_default().as_bytes()),
    ]);
    if work.files.reuse(path, key) {
        return Ok(Ok(()));
    }
    match imaging::decode_rgb(&list.bytes(work, image)?) {
        Ok(rgb) => {
            let made = masker.mask(&masker.prepared(rgb), threshold).with_context(|| image.name.clone())?;
            work.files.save(path, key, &imaging::encode_png_grey(&made.mask)?)?;
            Ok(Ok(()))
        }
        Err(error) => Ok(Err(format!("it cannot be masked: {error}"))),
    }
}
