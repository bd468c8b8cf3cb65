//! Finds the images, leaves out what cannot be used, and says which were exposed together.

use super::images::{CameraEntry, FILE, ImageEntry, ImageList, frame_file};
use super::interior;
use super::pairing::{self, Exposure};
use crate::config::{CameraConfig, Config, ImageSource};
use crate::error::NoResult;
use crate::stage::{Outcome, Stage, Work};
use crate::store::{Fingerprint, Hashes, Warning};
use anyhow::{Context, Result};
use imaging::video::Video;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The stage.
pub const STAGE: Stage = Stage { name: "ingest", version: 2, upstream: &[], options, inputs, work };

/// Frames of a video that are encoded at a time; bounds the memory.
const FRAMES_AT_ONCE: usize = 8;

fn options(config: &Config) -> Value {
    let cameras: Vec<Value> = config
        .cameras
        .iter()
        .map(|camera| match &camera.images {
            ImageSource::Files(_) => json!({"name": camera.name}),
            ImageSource::Video { rate_hz, offset_secs, .. } => {
                json!({"name": camera.name, "rate_hz": rate_hz, "offset_secs": offset_secs})
            }
        })
        .collect();
    json!({"frames_from": config.frames_from, "camera": cameras})
}

fn inputs(config: &Config, hashes: &Hashes) -> BTreeMap<String, String> {
    let files = config.cameras.iter().flat_map(|camera| match &camera.images {
        ImageSource::Files(files) => files.iter().enumerate().map(|(i, f)| (input_name(camera, i, f), f.clone())).collect(),
        ImageSource::Video { file, .. } => vec![(format!("{} video", camera.name), file.clone())],
    });
    hashes.of_files(files.collect())
}

/// Name of a file among the inputs: with its position, since order pairs images up and names may repeat.
fn input_name(camera: &CameraConfig, position: usize, file: &Path) -> String {
    format!("{}/{} ({})", camera.name, file_name(file), position + 1)
}

fn file_name(file: &Path) -> String {
    file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

fn stem_of(file: &Path) -> String {
    file.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A file or a video frame that can be read.
struct Found {
    entry: ImageEntry,
    focal_px: Option<f64>,
    exposure: Exposure,
}

#[derive(Serialize)]
struct Figures {
    found: usize,
    usable: usize,
    frames: usize,
    cameras: Vec<CameraFigures>,
}

#[derive(Serialize)]
struct CameraFigures {
    name: String,
    images: usize,
    size: Option<(u32, u32)>,
    exif_focal_px: Option<f64>,
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let mut warnings = Vec::new();
    let mut list = ImageList { cameras: Vec::new(), images: Vec::new(), found: 0 };
    let mut exposures = Vec::new();
    let mut contents = BTreeMap::new();
    for (index, camera) in work.config.cameras.iter().enumerate() {
        let (found, looked_at) = match &camera.images {
            ImageSource::Files(files) => (read_files(work, index, files, &mut warnings), files.len()),
            ImageSource::Video { file, rate_hz, offset_secs } => {
                let found = read_video(work, index, file, *rate_hz, *offset_secs, &mut warnings)?;
                let count = found.len();
                (found, count)
            }
        };
        list.found += looked_at;
        let (entry, usable) = usable(camera, found, &mut contents, &mut warnings);
        list.cameras.push(entry);
        for image in usable {
            exposures.push(image.exposure);
            list.images.push(image.entry);
        }
    }
    if list.images.is_empty() {
        let reason = warnings.first().map(|w| format!("; {}: {}", w.about, w.message)).unwrap_or_default();
        return Err(NoResult(format!("none of the {} images can be used{reason}", list.found)).into());
    }
    // A calibration that cannot belong to the images is told before hours are spent on them.
    interior::starts(work.config, &list)?;
    let names: Vec<&str> = list.cameras.iter().map(|c| c.name.as_str()).collect();
    let (numbers, pairing_warnings) = pairing::pair_up(&names, &exposures, work.config.frames_from);
    warnings.extend(pairing_warnings);
    for (image, number) in list.images.iter_mut().zip(numbers) {
        image.exposure = number;
    }
    let text = serde_json::to_vec_pretty(&list)?;
    work.files.save(FILE, Fingerprint::of_bytes(&text), &text)?;
    let figures = figures(&list);
    Ok(Outcome { figures: serde_json::to_value(figures)?, warnings })
}

fn figures(list: &ImageList) -> Figures {
    let count = |camera: usize| list.images.iter().filter(|i| i.camera == camera).count();
    let cameras = list.cameras.iter().enumerate();
    Figures {
        found: list.found,
        usable: list.images.len(),
        frames: list.images.iter().map(|i| i.exposure).collect::<BTreeSet<_>>().len(),
        cameras: cameras
            .map(|(i, c)| CameraFigures { name: c.name.clone(), images: count(i), size: c.size, exif_focal_px: c.exif_focal_px })
            .collect(),
    }
}

/// Reads the headers of a camera's files; one that cannot be read is a warning.
fn read_files(work: &Work<'_>, camera: usize, files: &[std::path::PathBuf], warnings: &mut Vec<Warning>) -> Vec<Found> {
    let name = &work.config.cameras[camera].name;
    work.progress.begin(&format!("reading {name}"), files.len());
    let read: Vec<Result<Found, Warning>> = files
        .par_iter()
        .enumerate()
        .map(|(position, file)| {
            let found = read_file(name, camera, position, file);
            work.progress.advance(1);
            found
        })
        .collect();
    let mut found = Vec::with_capacity(files.len());
    for image in read {
        match image {
            Ok(image) => found.push(image),
            Err(warning) => warnings.push(warning),
        }
    }
    found
}

fn read_file(camera_name: &str, camera: usize, position: usize, file: &Path) -> Result<Found, Warning> {
    let name = format!("{camera_name}/{}", file_name(file));
    let left_out = |reason: String| Warning { about: name.clone(), message: format!("left out: {reason}") };
    let bytes = std::fs::read(file).map_err(|e| left_out(e.kind().to_string()))?;
    let info = imaging::probe(&bytes).map_err(|e| left_out(e.to_string()))?;
    let stem = stem_of(file);
    Ok(Found {
        focal_px: info.exif.focal_px(info.width, info.height).filter(|f| f.is_finite() && *f > 0.0),
        exposure: Exposure { camera, position, stem: stem.clone(), time_secs: info.exif.time_secs },
        entry: ImageEntry {
            camera,
            stem,
            position: Some(position),
            exposure: 0,
            time_secs: info.exif.time_secs,
            width: info.width,
            height: info.height,
            content: Fingerprint::of_bytes(&bytes),
            name,
        },
    })
}

/// Extracts the frames of a video into the store.
fn read_video(
    work: &Work<'_>,
    camera: usize,
    file: &Path,
    rate_hz: f64,
    offset_secs: f64,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Found>> {
    let name = work.config.cameras[camera].name.clone();
    let video_content = Fingerprint::of_file(file).with_context(|| format!("cannot read {}", file.display()))?;
    let video = Video::open(file)?;
    let announced = video.info().duration_secs.map_or(0, |d| ((d - offset_secs) * rate_hz).ceil().max(0.0) as usize);
    work.progress.begin(&format!("extracting {name}"), announced);
    let mut frames = video.frames(rate_hz, offset_secs)?;
    let mut found = Vec::new();
    let mut stopped = None;
    while stopped.is_none() {
        let mut batch = Vec::with_capacity(FRAMES_AT_ONCE);
        for frame in frames.by_ref().take(FRAMES_AT_ONCE) {
            match frame {
                Ok(frame) => batch.push(frame),
                Err(error) => stopped = Some(error.to_string()),
            }
        }
        if batch.is_empty() {
            break;
        }
        let first = found.len();
        let saved: Vec<Result<Found>> = batch
            .into_par_iter()
            .enumerate()
            .map(|(i, (time, image))| {
                let position = first + i;
                let stem = format!("{position:06}");
                let at = [rate_hz.to_le_bytes(), offset_secs.to_le_bytes(), (position as u64).to_le_bytes()].concat();
                let key = Fingerprint::of_parts([("video", video_content.as_bytes().as_slice()), ("at", &at)]);
                let path = frame_file(&name, &stem);
                work.files.item::<anyhow::Error>(&path, key, || Ok(imaging::encode_png_rgb(&image)?))?;
                work.progress.advance(1);
                let entry = ImageEntry {
                    name: format!("{name}/{stem}.png"),
                    camera,
                    stem: stem.clone(),
                    position: None,
                    exposure: 0,
                    time_secs: Some(time - offset_secs),
                    width: image.width() as u32,
                    height: image.height() as u32,
                    content: Fingerprint::of_file(&work.store.path(&path))?,
                };
                let exposure = Exposure { camera, position, stem, time_secs: Some(time - offset_secs) };
                Ok(Found { entry, focal_px: None, exposure })
            })
            .collect();
        for image in saved {
            found.push(image?);
        }
    }
    if stopped.is_some() {
        // The message of the decoder names the path, which must not enter an artefact.
        let message = format!("the video ends early or is damaged after {} frames; they are used", found.len());
        warnings.push(Warning { about: name, message });
    }
    Ok(found)
}

/// Leaves out images of another size, repeated names and copies.
fn usable(
    camera: &CameraConfig,
    found: Vec<Found>,
    contents: &mut BTreeMap<Fingerprint, String>,
    warnings: &mut Vec<Warning>,
) -> (CameraEntry, Vec<Found>) {
    let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for image in &found {
        *sizes.entry((image.entry.width, image.entry.height)).or_default() += 1;
    }
    // The most frequent size; of several the largest.
    let size = sizes.iter().max_by_key(|(size, count)| (**count, **size)).map(|(size, _)| *size);
    let mut stems: BTreeMap<String, String> = BTreeMap::new();
    let mut usable: Vec<Found> = Vec::with_capacity(found.len());
    for image in found {
        let entry = &image.entry;
        let mut leave_out = |reason: String| warnings.push(Warning { about: entry.name.clone(), message: format!("left out: {reason}") });
        if let Some((width, height)) = size.filter(|s| *s != (entry.width, entry.height)) {
            leave_out(format!("it has {} x {} pixels, most images of {} have {width} x {height}", entry.width, entry.height, camera.name));
        } else if let Some(first) = stems.get(&entry.stem) {
            leave_out(format!("its name without extension is that of {first}"));
        } else if let Some(first) = contents.get(&entry.content) {
            leave_out(format!("it is a copy of {first}"));
        } else {
            stems.insert(entry.stem.clone(), entry.name.clone());
            contents.insert(entry.content, entry.name.clone());
            usable.push(image);
        }
    }
    if usable.is_empty() {
        warnings.push(Warning { about: camera.name.clone(), message: "has no usable image".to_owned() });
    }
    let mut focals: Vec<f64> = usable.iter().filter_map(|i| i.focal_px).collect();
    focals.sort_by(f64::total_cmp);
    let exif_focal_px = focals.get(focals.len() / 2).copied();
    if let (Some(first), Some(last)) = (focals.first(), focals.last())
        && last / first > 1.02
    {
        let message = format!("its focal length changes from {first:.0} to {last:.0} px (EXIF); one camera has one interior orientation");
        warnings.push(Warning { about: camera.name.clone(), message });
    }
    (CameraEntry { name: camera.name.clone(), size, exif_focal_px }, usable)
}
