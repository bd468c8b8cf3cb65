//! A model that another program made, as a start for the adjustment: its images are those of dive.toml.

use super::images::{CameraEntry, ImageEntry, ImageList, frame_file};
use super::interior::{self, Origin, Start};
use super::model;
use super::orient::{Found, assemble, options_of};
use super::orient_figures::{figures, precision_table};
use super::pairing::{Exposure, pair_up};
use crate::config::{Config, FramesFrom, ImageSource};
use crate::error::{Misfit, NoResult};
use crate::foreign::size_of_file;
use crate::formats::write_calibration;
use crate::store::{Fingerprint, Warning};
use anyhow::{Context, Result};
use mapping::MapError;
use scene::{CameraId, Frame, FrameId, Reconstruction, Rig, RigId, RigSensor, Rigid3};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::ffi::OsStr;

/// A model after its adjustment, and what is told of it.
pub struct Readjusted {
    /// Its files, by name: as in `sparse` and `calib` of a run.
    pub files: Vec<(String, Vec<u8>)>,
    /// Figures as in report.json.
    pub figures: Value,
    /// What a user should know.
    pub warnings: Vec<Warning>,
}

/// Adjusts a model with the rig, lengths, sensors and control points of a dive.toml; nothing is added to it. What dive.toml gives of an
/// interior orientation goes before what the model has.
///
/// # Errors
/// When the model does not belong to the images of dive.toml, or nothing of it is left.
pub fn readjust(config: &Config, given: &Reconstruction) -> Result<Readjusted> {
    if given.points.is_empty() {
        let message = "the model has no points, so that there is nothing to adjust: transforms.json holds cameras only\n  \
                       hint: orient the images with `sfm run`, or give a COLMAP or Bundler model";
        return Err(Misfit(message.to_owned()).into());
    }
    let mut warnings = Vec::new();
    let places = given.images.iter().map(|image| place_of(config, &image.name)).collect::<Result<Vec<_>>>()?;
    let cameras = cameras_of(config, given, &places)?;
    let list = image_list(config, given, &places, &cameras, &mut warnings);
    let start = flat(given, &list, &cameras);
    let (stated, notes) = interior::starts(config, &list)?;
    warnings.extend(notes);
    let starts: Vec<Start> = stated.into_iter().zip(&start.cameras).map(|(stated, &camera)| adopted(stated, camera)).collect();
    let mut colours: Vec<Vec<[u8; 3]>> = given.keypoints.iter().map(|k| vec![[128; 3]; k.len()]).collect();
    for point in &given.points {
        point.track.iter().for_each(|o| colours[o.image.index()][o.keypoint.index()] = point.colour);
    }
    let found = Found { keypoints: given.keypoints.clone(), sigmas_px: vec![Vec::new(); given.images.len()], colours, pairs: Vec::new() };
    let load = |image: &ImageEntry| -> Result<Vec<u8>> {
        let name = &config.cameras[image.camera].name;
        let path = match (&config.cameras[image.camera].images, image.position) {
            (ImageSource::Files(files), Some(position)) => files[position].clone(),
            _ => config.output.join(frame_file(name, &image.stem)),
        };
        std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let (input, told) = assemble(config, &list, &starts, found, &load, &mut warnings)?;
    let orientation = match mapping::readjust(&input, &start, &options_of(config)) {
        Ok(orientation) => orientation,
        Err(error @ MapError::Inconsistent(_)) => return Err(NoResult(error.to_string()).into()),
        Err(error) => return Err(error.into()),
    };
    warnings.extend(orientation.summary.notes.iter().map(|note| Warning { about: "orientation".to_owned(), message: note.clone() }));
    let mut figures = figures(config, &list, &starts, &orientation, &orientation.models[0], &told);
    let told: Vec<Value> = warnings.iter().map(|w| json!({"about": w.about, "message": w.message})).collect();
    figures["warnings"] = told.into();
    let (model, quality) = (&orientation.models[0], orientation.summary.quality.as_ref().ok());
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    files.extend(model::files(model, quality.map_or(&[], |q| &q.points))?.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)));
    files.extend(quality.map(|q| ("precision.csv".to_owned(), precision_table(model, q).into_bytes())));
    let calibrations = model.cameras.iter().zip(&list.cameras);
    files.extend(
        calibrations.map(|(camera, entry)| (model::calibration_file(&entry.name), write_calibration(camera, &entry.name).into_bytes())),
    );
    Ok(Readjusted { files, figures, warnings })
}

/// Width and height of the image of dive.toml that a model calls by a name; `None` where it is none or no file that can be read.
#[must_use]
pub fn size_in_dive(config: &Config, name: &str) -> Option<(u32, u32)> {
    let (camera, position) = place_of(config, name).ok()?;
    match &config.cameras[camera].images {
        ImageSource::Files(files) => size_of_file(&files[position]),
        ImageSource::Video { .. } => None,
    }
}

/// The model's interior orientation, where dive.toml gives none.
fn adopted(given: Start, camera: scene::Camera) -> Start {
    if given.origin == Origin::Given {
        return given;
    }
    let held = if given.held.len() == camera.params().len() { given.held } else { Vec::new() };
    Start { camera, fixed: false, held, sigmas: Vec::new(), origin: Origin::Model, alternatives: Vec::new() }
}

/// Camera and position of an image, by its name in the model: `camera/file`, or the end of the file's path.
fn place_of(config: &Config, name: &str) -> Result<(usize, usize)> {
    let mut ends = Vec::new();
    for (c, camera) in config.cameras.iter().enumerate() {
        let of_camera = name.strip_prefix(&camera.name).and_then(|rest| rest.strip_prefix('/'));
        match &camera.images {
            ImageSource::Files(files) => {
                if let Some(p) = of_camera.and_then(|file| files.iter().position(|p| p.file_name() == Some(OsStr::new(file)))) {
                    return Ok((c, p));
                }
                ends.extend(files.iter().position(|p| p.ends_with(name)).map(|p| (c, p)));
            }
            ImageSource::Video { .. } => {
                if let Some(p) = of_camera.and_then(|file| file.strip_suffix(".png")?.parse().ok()) {
                    return Ok((c, p));
                }
            }
        }
    }
    match ends[..] {
        [place] => Ok(place),
        [] => Err(Misfit(format!(
            "image {name} of the model is none of dive.toml: images are found as `camera/file` or by the end of their path"
        ))
        .into()),
        _ => Err(Misfit(format!(
            "image {name} of the model can be one of several cameras of dive.toml: name the model's images `camera/file`"
        ))
        .into()),
    }
}

/// The camera of the model for each camera of dive.toml.
fn cameras_of(config: &Config, model: &Reconstruction, places: &[(usize, usize)]) -> Result<Vec<CameraId>> {
    let mut used: Vec<BTreeSet<CameraId>> = vec![BTreeSet::new(); config.cameras.len()];
    for (image, &(camera, _)) in model.images.iter().zip(places) {
        used[camera].insert(image.camera);
    }
    let one = |(camera, used): (&crate::config::CameraConfig, &BTreeSet<CameraId>)| match (used.first(), used.len()) {
        (Some(&only), 1) => Ok(only),
        (None, _) => Err(Misfit(format!("the model has no image of camera {}: leave it out of dive.toml", camera.name)).into()),
        (_, n) => {
            Err(Misfit(format!("the model has {n} interior orientations for images of camera {}, which has one", camera.name)).into())
        }
    };
    config.cameras.iter().zip(&used).map(one).collect()
}

fn image_list(
    config: &Config,
    model: &Reconstruction,
    places: &[(usize, usize)],
    cameras: &[CameraId],
    warnings: &mut Vec<Warning>,
) -> ImageList {
    let size = |c: usize| (model.cameras[cameras[c].index()].width(), model.cameras[cameras[c].index()].height());
    let file = |camera: usize, position: usize| match &config.cameras[camera].images {
        ImageSource::Files(files) => files.get(position),
        ImageSource::Video { .. } => None,
    };
    let time = |camera: usize, position: usize| {
        if let ImageSource::Video { rate_hz, .. } = config.cameras[camera].images {
            return Some(position as f64 / rate_hz);
        }
        // Nothing else needs the files themselves.
        let bytes =
            (config.frames_from == FramesFrom::Timestamp || config.sensors.is_some()).then(|| std::fs::read(file(camera, position)?).ok());
        imaging::probe(&bytes??).ok()?.exif.time_secs
    };
    let exposures: Vec<Exposure> = places
        .iter()
        .map(|&(camera, position)| {
            let stem = file(camera, position)
                .and_then(|f| f.file_stem())
                .map_or_else(|| format!("{position:06}"), |s| s.to_string_lossy().into_owned());
            Exposure { camera, position, stem, time_secs: time(camera, position) }
        })
        .collect();
    let names: Vec<&str> = config.cameras.iter().map(|c| c.name.as_str()).collect();
    let (numbers, notes) = pair_up(&names, &exposures, config.frames_from);
    warnings.extend(notes);
    let entry = |((exposure, number), image): ((&Exposure, u32), &scene::Image)| {
        let camera = exposure.camera;
        let file_name = file(camera, exposure.position).and_then(|f| f.file_name()).map(|n| n.to_string_lossy().into_owned());
        let name = file_name.map_or_else(|| image.name.clone(), |n| format!("{}/{n}", names[camera]));
        let ((width, height), content) = (size(camera), Fingerprint::of_bytes(&[]));
        let (stem, time_secs) = (exposure.stem.clone(), exposure.time_secs);
        let position = file(camera, exposure.position).map(|_| exposure.position);
        ImageEntry { name, camera, stem, position, exposure: number, time_secs, width, height, content }
    };
    let entries =
        names.iter().enumerate().map(|(c, name)| CameraEntry { name: (*name).to_owned(), size: Some(size(c)), exif_focal_px: None });
    let images: Vec<ImageEntry> = exposures.iter().zip(numbers).zip(&model.images).map(entry).collect();
    ImageList { cameras: entries.collect(), found: images.len(), images }
}

/// The model with a frame for each image, cameras in the order of dive.toml, and beside them its rig where it has one of all of them.
fn flat(model: &Reconstruction, list: &ImageList, cameras: &[CameraId]) -> Reconstruction {
    let mut rigs: Vec<Rig> = (0..cameras.len()).map(|c| Rig::single(CameraId::new(c))).collect();
    let whole = model.rigs.iter().find_map(|rig| cameras.iter().map(|&c| rig.cam_from_rig(c)).collect::<Option<Vec<Rigid3>>>());
    let are_different = cameras.iter().collect::<BTreeSet<_>>().len() == cameras.len();
    if let Some(poses) = whole.filter(|_| are_different && cameras.len() > 1) {
        let rig_from_first = poses[0].inverse();
        let sensor = |(c, pose): (usize, &Rigid3)| RigSensor { camera: CameraId::new(c), cam_from_rig: *pose * rig_from_first };
        rigs.push(Rig { sensors: poses.iter().enumerate().map(sensor).collect() });
    }
    let frames = list.images.iter().enumerate().map(|(i, entry)| Frame {
        rig: RigId::new(entry.camera),
        exposure: entry.exposure,
        rig_from_world: model.cam_from_world(scene::ImageId::new(i)),
    });
    let image = |(i, entry): (usize, &ImageEntry)| scene::Image {
        name: entry.name.clone(),
        camera: CameraId::new(entry.camera),
        frame: FrameId::new(i),
    };
    Reconstruction {
        cameras: cameras.iter().map(|c| model.cameras[c.index()]).collect(),
        rigs,
        frames: frames.collect(),
        images: list.images.iter().enumerate().map(image).collect(),
        keypoints: model.keypoints.clone(),
        points: model.points.clone(),
        scale: model.scale,
    }
}
