//! Which pixels show structure, and which only water.

use super::images::{ImageEntry, ImageList};
use super::mask_votes::{glimpse_file, single_file, vote_on_all};
use super::single_masks::{Singles, thresholds};
use crate::config::{Config, MaskStrategy};
use crate::masker::Masker;
use crate::moving::{self, Moving};
use crate::stage::{Outcome, Stage, Work};
use crate::store::{Fingerprint, Hashes, Warning};
use anyhow::{Context, Result};
use rayon::prelude::*;
use scene::Mask;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// The stage.
pub const STAGE: Stage = Stage { name: "mask", version: 3, upstream: &["ingest"], options, inputs, work };

fn options(config: &Config) -> Value {
    let mut options = single_options(config);
    if config.mask.vote > 0 && config.mask.strategy != MaskStrategy::None {
        options["vote"] = json!(config.mask.vote);
    }
    if let Some(moving) = &config.mask.moving {
        options["moving"] = json!(moving);
    }
    options
}

/// What the mask of a single image depends on.
pub(super) fn single_options(config: &Config) -> Value {
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

/// Every file that the patterns could mean, or the model with its card; and the labels of what moves.
fn inputs(config: &Config, hashes: &Hashes) -> BTreeMap<String, String> {
    let mut inputs = BTreeMap::new();
    if config.mask.strategy.has_ml() {
        inputs = match &config.mask.ml.model {
            Some(model) => hashes.of_files(vec![("model".to_owned(), model.clone()), ("card".to_owned(), model.with_extension("toml"))]),
            None => BTreeMap::from([("model".to_owned(), models::sha256(models::BUILT_IN_CARD.as_bytes()))]),
        };
    }
    let mut files: Vec<(String, PathBuf)> = Vec::new();
    if config.mask.strategy == MaskStrategy::Files {
        for camera in &config.cameras {
            let Some(pattern) = &camera.mask else { continue };
            // Folders may hold signs that a pattern takes for its own; the stem stands for any text.
            let parts: Vec<String> = pattern.file("{stem}").to_string_lossy().split("{stem}").map(glob::Pattern::escape).collect();
            let found = glob::glob(&parts.join("*")).into_iter().flatten().flatten();
            files.extend(found.map(|f| (format!("{}/{}", camera.name, f.file_name().unwrap_or_default().to_string_lossy()), f)));
        }
    }
    if let Some(moving) = &config.mask.moving {
        // A folder that cannot be read is told when the stage runs.
        let labels = moving::files(&moving.folder).unwrap_or_default();
        files.extend(labels.into_iter().map(|(name, path)| (format!("moving/{name}"), path)));
    }
    inputs.extend(hashes.of_files(files));
    inputs
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
    let config = &work.config.mask;
    let strategy = config.strategy;
    let moving = config.moving.as_ref().map_or_else(|| Ok(Moving::default()), |m| Moving::read(&m.folder, &m.labels, &list))?;
    if strategy == MaskStrategy::None && config.moving.is_none() {
        return Ok(Outcome { figures: json!({"strategy": strategy, "note": "none"}), warnings: Vec::new() });
    }
    let masker = Masker::new(config)?;
    let thresholds = thresholds(work, &list, &masker)?;
    let mut warnings: Vec<Warning> = moving
        .unusable
        .iter()
        .map(|(file, reason)| Warning { about: file.clone(), message: format!("nothing is cut out of masks by it: {reason}") })
        .collect();
    let singles = Singles { work, list: &list, masker, thresholds, moving };
    let file = |image: &ImageEntry| mask_file(&list, strategy, image);
    let votes = config.vote > 0 && strategy != MaskStrategy::None;
    work.progress.begin("masks", list.images.len());
    let made: Vec<Result<Option<Result<Fingerprint, String>>>> = list
        .images
        .par_iter()
        .map(|image| {
            work.progress.advance(1);
            if votes {
                let glimpse = glimpse_file(&list, image);
                return singles.make(image, &single_file(&list, image, strategy.name()), Some(&glimpse), false).map(Some);
            }
            let all_takes_part = strategy == MaskStrategy::None && singles.moving.fingerprint(image).is_none();
            if all_takes_part { Ok(None) } else { singles.make(image, &file(image), None, true).map(Some) }
        })
        .collect();
    let mut keys = Vec::with_capacity(made.len());
    for (image, made) in list.images.iter().zip(made) {
        keys.push(match made? {
            None => None,
            Some(Ok(key)) => Some(key),
            Some(Err(message)) => {
                warnings.push(Warning { about: image.name.clone(), message: format!("{message}; all of the image takes part") });
                None
            }
        });
    }
    if votes {
        vote_on_all(&singles, &keys, &file)?;
    }
    let shares = shares(work, &list, &keys, &file)?;
    let mut figures = figures(&list, &shares, strategy);
    if let Some((name, sha256)) = singles.masker.model() {
        figures["classifier"] = json!({"name": name, "sha256": sha256, "runtime": singles.masker.library()});
    }
    write_ratios(work, &list, &shares)?;
    Ok(Outcome { figures, warnings })
}

/// The share of structure of each mask; none where an image has no mask.
fn shares(
    work: &Work<'_>,
    list: &ImageList,
    keys: &[Option<Fingerprint>],
    file: &(dyn Fn(&ImageEntry) -> String + Sync),
) -> Result<Vec<Option<f64>>> {
    let share = |(image, key): (&ImageEntry, &Option<Fingerprint>)| -> Result<Option<f64>> {
        if key.is_none() {
            return Ok(None);
        }
        // Also of a mask that an earlier run made.
        let bytes = std::fs::read(work.store.path(&file(image)))?;
        Ok(Some(masking::structure_share(&imaging::decode_grey_u8(&bytes)?)))
    };
    list.images.par_iter().zip(keys).map(share).collect()
}

fn figures(list: &ImageList, shares: &[Option<f64>], strategy: MaskStrategy) -> Value {
    let mut per_camera = vec![(0.0, 0usize); list.cameras.len()];
    let (mut empty, mut masks, mut masked) = (Vec::new(), 0usize, 0.0);
    for (image, share) in list.images.iter().zip(shares) {
        let Some(share) = share else { continue };
        (masks, masked) = (masks + 1, masked + 1.0 - share);
        let (sum, n) = &mut per_camera[image.camera];
        (*sum, *n) = (*sum + 1.0 - share, *n + 1);
        if *share == 0.0 {
            empty.push(image.name.clone());
        }
    }
    let ratio = |sum: f64, n: usize| (n > 0).then(|| sum / n as f64);
    let masked_ratio = ratio(masked, masks);
    let of_camera = |(name, (sum, n)): (&String, &(f64, usize))| (name.clone(), ratio(*sum, *n).into());
    let per_camera: serde_json::Map<String, Value> = list.cameras.iter().map(|c| &c.name).zip(&per_camera).map(of_camera).collect();
    json!({
        "strategy": strategy,
        "masks": masks,
        "empty": empty.len(),
        "empty_images": empty,
        "masked_ratio": masked_ratio,
        "masked_ratio_by_camera": per_camera,
        "note": format!("{masks} masks, {:.0} % of the pixels masked", 100.0 * masked_ratio.unwrap_or(0.0)),
    })
}

/// Where the masked ratio of each image stands.
fn ratios_file(strategy: MaskStrategy) -> String {
    format!("masks/{}/masked_ratio.csv", strategy.name())
}

fn write_ratios(work: &Work<'_>, list: &ImageList, shares: &[Option<f64>]) -> Result<()> {
    let mut text = String::from("image,masked_ratio\n");
    for (image, share) in list.images.iter().zip(shares) {
        if let Some(share) = share {
            let _ = writeln!(text, "{},{:.4}", image.name, 1.0 - share);
        }
    }
    work.files.item(&ratios_file(work.config.mask.strategy), Fingerprint::of_bytes(text.as_bytes()), || Ok(text.into_bytes()))
}
