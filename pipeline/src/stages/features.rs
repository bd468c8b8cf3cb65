//! Distinctive points of every image.

use super::images::{ImageEntry, ImageList};
use super::mask;
use crate::config::{Config, FeatureMethod, FeaturesConfig};
use crate::error::NoResult;
use crate::formats::{StoredFeatures, read_features, write_features};
use crate::stage::{Outcome, Stage, Work, no_inputs};
use crate::store::{Fingerprint, Warning};
use anyhow::{Context, Result};
use features::{FeatureError, HarrisOptions, SiftOptions};
use rayon::prelude::*;
use scene::{Features, Keypoint, Mask, Raster};
use serde_json::{Value, json};

/// The stage.
pub const STAGE: Stage = Stage { name: "features", version: 2, upstream: &["ingest", "mask"], options, inputs: no_inputs, work };

/// An image of fewer keypoints is told.
const FEW: usize = 100;

fn options(config: &Config) -> Value {
    json!(config.features)
}

/// Where the features of an image lie.
fn file(list: &ImageList, image: &ImageEntry) -> String {
    list.path_for("features", image, "bin")
}

/// The features of an image.
///
/// # Errors
/// When the file is missing or damaged.
pub fn load(work: &Work<'_>, list: &ImageList, image: &ImageEntry) -> Result<StoredFeatures> {
    read_features(&work.read("features", &file(list, image))?).with_context(|| format!("the features of {}", image.name))
}

/// Fingerprint of the features of an image.
///
/// # Errors
/// When there are none.
pub fn content(work: &Work<'_>, list: &ImageList, image: &ImageEntry) -> Result<Fingerprint> {
    Ok(work.content("features", &file(list, image))?)
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let list = ImageList::load(work)?;
    work.progress.begin("features", list.images.len());
    let found: Vec<Result<(usize, Option<Warning>)>> = list
        .images
        .par_iter()
        .map(|image| {
            let found = one_image(work, &list, image);
            work.progress.advance(1);
            found
        })
        .collect();
    let (mut counts, mut warnings) = (Vec::with_capacity(found.len()), Vec::new());
    for image in found {
        let (count, warning) = image?;
        counts.push(count);
        warnings.extend(warning);
    }
    let total: usize = counts.iter().sum();
    if total == 0 {
        return Err(NoResult("no image shows anything that could be found again: uniform, masked or damaged images only".to_owned()).into());
    }
    let mut sorted = counts.clone();
    sorted.sort_unstable();
    let median = sorted[sorted.len() / 2];
    let per_image: serde_json::Map<String, Value> = list.images.iter().zip(&counts).map(|(i, n)| (i.name.clone(), (*n).into())).collect();
    let note = format!("{total} keypoints in {} images, median {median}", counts.len());
    Ok(Outcome { figures: json!({"keypoints": total, "median": median, "per_image": per_image, "note": note}), warnings })
}

/// Number of keypoints of an image, and what is the matter with it.
fn one_image(work: &Work<'_>, list: &ImageList, image: &ImageEntry) -> Result<(usize, Option<Warning>)> {
    let warning = |message: String| Some(Warning { about: image.name.clone(), message });
    let path = file(list, image);
    let (options, version) = (options(work.config).to_string(), STAGE.version.to_le_bytes());
    let key = Fingerprint::of_parts([
        ("version", version.as_slice()),
        ("options", options.as_bytes()),
        ("image", image.content.as_bytes().as_slice()),
        ("mask", mask::content(work, list, image).as_bytes().as_slice()),
    ]);
    if mask::is_empty(work, image) {
        // Nothing but water, as the figures of the masks list it.
        work.files.item::<anyhow::Error>(&path, key, || Ok(write_features(&StoredFeatures::default())))?;
        return Ok((0, None));
    }
    let mut damage = None;
    if !work.files.reuse(&path, key) {
        let stored = match decode(&list.bytes(work, image)?) {
            Ok((grey, rgb)) => extract(work, &grey, &rgb, mask::load(work, list, image)?.as_ref())?,
            Err(error) => {
                damage = Some(error.to_string());
                StoredFeatures::default()
            }
        };
        work.files.save(&path, key, &write_features(&stored))?;
        if damage.is_none() {
            return Ok(judge(stored.features.len(), warning));
        }
    } else {
        let stored = read_features(&std::fs::read(work.store.path(&path))?)?;
        if !stored.features.is_empty() {
            return Ok(judge(stored.features.len(), warning));
        }
        // An image without features may be damaged: only decoding tells, also when an earlier run did it.
        damage = decode(&list.bytes(work, image)?).err().map(|e| e.to_string());
    }
    Ok(match damage {
        Some(error) => (0, warning(format!("not used: {error}"))),
        None => judge(0, warning),
    })
}

fn judge(count: usize, warning: impl Fn(String) -> Option<Warning>) -> (usize, Option<Warning>) {
    (count, if count < FEW { warning(format!("has {count} keypoints only: little texture, or masked")) } else { None })
}

/// Grey and colour; a single decoding where the image has 8 bits.
fn decode(bytes: &[u8]) -> Result<(Raster<f32>, Raster<[u8; 3]>), imaging::ImagingError> {
    let bits = imaging::probe(bytes)?.bits_per_channel;
    let rgb = imaging::decode_rgb(bytes)?;
    let grey = if bits <= 8 { imaging::grey_from_rgb(&rgb) } else { imaging::decode_grey(bytes)? };
    Ok((grey, rgb))
}

/// The features of an image by the method that was asked for.
fn find(config: &FeaturesConfig, grey: &Raster<f32>, mask: Option<&Mask>) -> Result<Features, FeatureError> {
    match config.method {
        FeatureMethod::Sift => {
            let options = SiftOptions {
                max_features: config.max_keypoints as usize,
                double_image: (grey.width() * grey.height()) as f64 <= 1e6 * config.double_up_to_mpx,
                contrast_threshold: config.contrast_threshold as f32,
                ..SiftOptions::default()
            };
            features::extract(grey, mask, &options)
        }
        FeatureMethod::HarrisNcc => {
            let options = HarrisOptions { max_features: config.max_keypoints as usize, ..HarrisOptions::default() };
            features::extract_harris(grey, mask, &options)
        }
    }
}

fn extract(work: &Work<'_>, grey: &Raster<f32>, rgb: &Raster<[u8; 3]>, mask: Option<&Mask>) -> Result<StoredFeatures> {
    let features = find(&work.config.features, grey, mask)?;
    let colour = |k: &Keypoint| rgb.at_point(f64::from(k.x), f64::from(k.y)).copied().unwrap_or_default();
    let colours = features.keypoints.iter().map(colour).collect();
    Ok(StoredFeatures { features, colours })
}
