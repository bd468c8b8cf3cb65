//! Where every camera stood, and where the points are.

use super::images::{CameraEntry, ImageEntry, ImageList};
use super::interior::{self, Start};
use super::orient_figures::{figures, precision_table};
use super::targets::{Picked, Picker};
use super::{features, matching, model, world};
use crate::config::{Config, Mapper, RigMode, ScaleBarConfig};
use crate::error::NoResult;
use crate::stage::{Outcome, Stage, Work};
use crate::store::{Fingerprint, Hashes, Warning};
use anyhow::{Context, Result};
use mapping::{BaselineInput, CameraInput, ImageInput, MapError, MapInput, OrientOptions, RigInput, RigPoseInput, ScaleBarInput};
use rayon::prelude::*;
use scene::{CameraId, Keypoint, VerifiedPair};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The stage.
pub const STAGE: Stage = Stage { name: "orient", version: 5, upstream: &["ingest", "features", "matching"], options, inputs, work };

/// Standard deviation of a keypoint's position over its scale: what was found in a coarser image is as much less precise (Zeisl, Georgel,
/// Schweiger, Steinbach & Navab, *Estimation of location uncertainty for scale invariant feature points*, BMVC 2009). The finest
/// keypoints of an image that was not doubled have a scale of 2 pixels, and so a standard deviation of one.
const SIGMA_OF_SCALE: f32 = 0.5;

fn options(config: &Config) -> Value {
    let poses: Vec<Value> = config
        .rig
        .poses
        .iter()
        .map(|pose| match pose {
            None => Value::Null,
            Some(pose) => {
                let q = pose.cam_from_rig.rotation.quaternion();
                json!({
                    "quaternion_wxyz": [q.w, q.i, q.j, q.k],
                    "translation_m": pose.cam_from_rig.translation.as_slice(),
                    "sigma": pose.sigma.map(|(radians, metres)| [radians, metres]),
                })
            }
        })
        .collect();
    json!({
        "orient": config.orient,
        "interior": interior::options(config),
        "rig": {"mode": config.rig.mode, "poses": poses, "baselines": config.rig.baselines},
        "scale_bars": config.scale_bars,
        "world": {"origin_m": config.origin_m, "sensors": config.sensors, "control_points": config.control_points},
    })
}

fn inputs(config: &Config, hashes: &Hashes) -> BTreeMap<String, String> {
    hashes.of_files(config.sensors.iter().map(|s| ("sensors".to_owned(), s.file.clone())).collect())
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let list = ImageList::load(work)?;
    let mut warnings = Vec::new();
    let (input, starts, told) = input(work, &list, &mut warnings)?;
    if work.config.rig.mode == RigMode::None && !work.config.rig.baselines.is_empty() {
        let message = "the baselines are not used: rig.mode is \"none\"".to_owned();
        warnings.push(Warning { about: "dive.toml".to_owned(), message });
    }
    work.progress.begin("orienting", 0);
    let orientation = match mapping::orient(&input, &options_of(work.config)) {
        Ok(orientation) => orientation,
        Err(error @ MapError::NoInitialPair { .. }) => return Err(NoResult(error.to_string()).into()),
        Err(error) => return Err(error.into()),
    };
    let largest = orientation.models.first().context("the orientation has no model")?;
    model::save_calibrations(work, largest, &list)?;
    let quality = orientation.summary.quality.as_ref().ok();
    model::save(work, largest, quality.map_or(&[], |q| &q.points), "sparse")?;
    if let Some(quality) = quality {
        let table = precision_table(largest, quality);
        work.files.save("sparse/precision.csv", Fingerprint::of_bytes(table.as_bytes()), table.as_bytes())?;
    }
    for (i, model) in orientation.models.iter().enumerate().skip(1) {
        model::save(work, model, &[], &format!("sparse/{i}"))?;
    }
    warnings.extend(orientation.summary.notes.iter().map(|note| Warning { about: "orientation".to_owned(), message: note.clone() }));
    // Why an image has no keypoints has been told by the stage that found none.
    for out in orientation.summary.left_out.iter().filter(|out| !input.keypoints[out.image.index()].is_empty()) {
        let message = format!("not oriented: {}", out.reason);
        warnings.push(Warning { about: list.images[out.image.index()].name.clone(), message });
    }
    for (i, model) in orientation.models.iter().enumerate().skip(1) {
        let count = model.oriented_images().count();
        let message = format!("{count} images form a model of their own, which could not be joined to the first: sparse/{i}");
        warnings.push(Warning { about: "orientation".to_owned(), message });
    }
    Ok(Outcome { figures: figures(work.config, &list, &starts, &orientation, largest, &told), warnings })
}

pub(super) fn options_of(config: &Config) -> OrientOptions {
    let o = &config.orient;
    OrientOptions {
        mapper: match o.mapper {
            Mapper::Auto => mapping::Mapper::Auto,
            Mapper::Global => mapping::Mapper::Global,
            Mapper::Incremental => mapping::Mapper::Incremental,
        },
        initial_min_inliers: o.initial_min_inliers as usize,
        initial_min_angle_deg: o.initial_min_angle_deg,
        register_max_error_px: o.register_max_error_px,
        register_min_inliers: o.register_min_inliers as usize,
        max_error_px: o.max_error_px,
        min_angle_deg: o.min_angle_deg,
        refine_principal_point: o.refine_principal_point,
        seed: u64::from(o.seed),
        ..OrientOptions::default()
    }
}

fn input(work: &Work<'_>, list: &ImageList, warnings: &mut Vec<Warning>) -> Result<(MapInput, Vec<Start>, Told)> {
    // Descriptors are dropped image by image: all of them would not fit.
    let found: Vec<(Vec<Keypoint>, Vec<[u8; 3]>)> = list
        .images
        .par_iter()
        .map(|image| {
            let stored = features::load(work, list, image)?;
            Ok((stored.features.keypoints, stored.colours))
        })
        .collect::<Result<_>>()?;
    let (keypoints, colours): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let pairs = matching::load(work, list)?;
    let (mut starts, _) = interior::starts(work.config, list)?;
    interior::add_alternatives(&mut starts, list, &keypoints, &pairs, work.config)?;
    let found = Found {
        sigmas_px: keypoints.iter().map(|some| some.iter().map(|k| SIGMA_OF_SCALE * k.scale).collect()).collect(),
        keypoints: keypoints.iter().map(|some| some.iter().map(|k| [k.x, k.y]).collect()).collect(),
        colours,
        pairs,
    };
    let load = |image: &ImageEntry| list.bytes(work, image);
    let (input, told) = assemble(work.config, list, &starts, found, &load, warnings)?;
    Ok((input, starts, told))
}

/// What was found in the images, as `mapping` takes it.
pub(super) struct Found {
    pub(super) keypoints: Vec<Vec<[f32; 2]>>,
    pub(super) sigmas_px: Vec<Vec<f32>>,
    pub(super) colours: Vec<Vec<[u8; 3]>>,
    pub(super) pairs: Vec<VerifiedPair>,
}

/// What the report has beside the result of `mapping`.
#[derive(Default)]
pub(super) struct Told {
    /// Targets at the ends of each scale bar, and of each control point.
    pub(super) bar_targets: Vec<[Vec<Value>; 2]>,
    pub(super) control_targets: Vec<Vec<Value>>,
}

/// What was found in the images, with all that dive.toml knows; `load` reads the file of an image, for the targets that are measured.
pub(super) fn assemble(
    config: &Config,
    list: &ImageList,
    starts: &[Start],
    found: Found,
    load: &(dyn Fn(&ImageEntry) -> Result<Vec<u8>> + Sync),
    warnings: &mut Vec<Warning>,
) -> Result<(MapInput, Told)> {
    let picker = Picker { list, cameras: starts.iter().map(|s| s.camera).collect(), load };
    let mut told = Told::default();
    let image = |image: &ImageEntry| ImageInput { name: image.name.clone(), camera: CameraId::new(image.camera), exposure: image.exposure };
    let camera = |(s, entry): (&Start, &CameraEntry)| CameraInput {
        name: entry.name.clone(),
        camera: s.camera,
        fixed: s.fixed,
        held: s.held.clone(),
        sigmas: s.sigmas.clone(),
        alternatives: s.alternatives.clone(),
    };
    let scale_bars = config.scale_bars.iter().map(|bar| scale_bar(bar, &picker, &mut told, warnings)).collect();
    let input = MapInput {
        cameras: starts.iter().zip(&list.cameras).map(camera).collect(),
        images: list.images.iter().map(image).collect(),
        keypoints: found.keypoints,
        sigmas_px: found.sigmas_px,
        colours: found.colours,
        pairs: found.pairs,
        rig: rig(config),
        scale_bars,
        world: world::world(config, &picker, &mut told, warnings)?,
    };
    Ok((input, told))
}

fn rig(config: &Config) -> RigInput {
    let camera = CameraId::new;
    RigInput {
        mode: match config.rig.mode {
            RigMode::Rigid => mapping::RigMode::Rigid,
            RigMode::Baselines => mapping::RigMode::Baselines,
            RigMode::None => mapping::RigMode::None,
        },
        poses: config.rig.poses.iter().map(|p| p.map(|p| RigPoseInput { cam_from_rig: p.cam_from_rig, sigma: p.sigma })).collect(),
        baselines: config
            .rig
            .baselines
            .iter()
            .map(|b| BaselineInput { cameras: (camera(b.cameras.0), camera(b.cameras.1)), length_m: b.length_m, sigma_m: b.sigma_m })
            .collect(),
    }
}

/// A pick in an image that could not be used is a warning.
fn scale_bar(bar: &ScaleBarConfig, picker: &Picker<'_>, told: &mut Told, warnings: &mut Vec<Warning>) -> ScaleBarInput {
    let [a, b] = bar.ends.each_ref().map(|picks| picker.picks(picks, bar.target.as_ref(), &bar.name, warnings));
    let (Picked { picks: first, targets: of_first }, Picked { picks: second, targets: of_second }) = (a, b);
    told.bar_targets.push([of_first, of_second]);
    let ends = [first, second];
    ScaleBarInput { ends, length_m: bar.length_m, sigma_m: bar.sigma_m, check: bar.check }
}
