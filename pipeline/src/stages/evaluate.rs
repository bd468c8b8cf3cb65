//! How far the cloud is from the truth, where a truth is known.

use super::{densify, model};
use crate::config::Config;
use crate::reference::{read_positions, read_reference};
use crate::stage::{Outcome, Stage, Work};
use crate::store::{Fingerprint, Hashes, Warning};
use anyhow::{Context, Result};
use eval::trajectory::{Alignment, absolute_error};
use eval::{EvalOptions, evaluate};
use nalgebra::Vector3;
use scene::format::read_ply_cloud;
use scene::{Cloud, ImageId, Reconstruction, Scale, Similarity3};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The stage.
pub const STAGE: Stage = Stage { name: "evaluate", version: 2, upstream: &["mask", "orient", "densify"], options, inputs, work };

/// The figures.
const METRICS: &str = "eval/metrics.json";

fn options(config: &Config) -> Value {
    let e = &config.evaluate;
    json!({
        "reference": e.reference.is_some(), "positions": e.positions.is_some(), "threshold_m": e.threshold_m,
        "density_radius_m": e.density_radius_m, "grid_m": e.grid_m,
    })
}

fn inputs(config: &Config, hashes: &Hashes) -> BTreeMap<String, String> {
    let files = [("reference", &config.evaluate.reference), ("positions", &config.evaluate.positions)];
    hashes.of_files(files.into_iter().filter_map(|(name, path)| Some((name.to_owned(), path.clone()?))).collect())
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let model = model::load(work)?;
    let (cloud, _) = read_ply_cloud(work.read("densify", densify::CLOUD)?.as_slice()).context(densify::CLOUD)?;
    let mut warnings = Vec::new();
    let masked_ratio = work.done.get("mask").map(|stamp| stamp.figures["masked_ratio"].clone());
    let mut figures = json!({"points": cloud.len(), "masked_ratio": masked_ratio});
    let moved = match &work.config.evaluate.positions {
        Some(path) => {
            let known = read_positions(path)?;
            align(&model, &known, &mut figures, &mut warnings)?
        }
        None => None,
    };
    if let Some(path) = &work.config.evaluate.reference {
        let about = |message: &str| Warning { about: "reference".to_owned(), message: message.to_owned() };
        let metric = model.scale == Scale::Metric || moved.is_some();
        if cloud.is_empty() {
            warnings.push(about("there is no dense cloud to compare with it"));
        } else if !metric {
            warnings.push(about("not compared: the scale is arbitrary; give a baseline, a scale bar or [evaluate] positions"));
        } else {
            if moved.is_none() {
                warnings.push(about("compared as it lies: without [evaluate] positions the cloud is not moved to it"));
            }
            let reference = read_reference(path)?;
            let scale = moved.map_or(1.0, |m| m.scale);
            let gsd = work.done.get("densify").and_then(|s| s.figures["ground_sample_distance"].as_f64());
            let options = EvalOptions {
                gsd_m: gsd.map(|g| g * scale),
                threshold_m: work.config.evaluate.threshold_m,
                density_radius_m: work.config.evaluate.density_radius_m,
                grid_m: work.config.evaluate.grid_m,
                ..EvalOptions::default()
            };
            let metrics = evaluate(&moved_cloud(cloud, moved), &reference, &options)?;
            warnings.extend(metrics.warnings.iter().map(|w| about(w)));
            merge(&mut figures, serde_json::to_value(metrics)?);
        }
    }
    let text = serde_json::to_vec_pretty(&figures)?;
    work.files.save(METRICS, Fingerprint::of_bytes(&text), &text)?;
    let note = figures["c2m_mean_m"].as_f64().map_or("no reference".to_owned(), |mean| format!("mean distance {mean:.4} m"));
    merge(&mut figures, json!({ "note": note }));
    Ok(Outcome { figures, warnings })
}

fn merge(into: &mut Value, from: Value) {
    if let (Value::Object(into), Value::Object(from)) = (into, from) {
        into.extend(from);
    }
}

/// Moves the model to known positions of its projection centres: rigidly where it is metric, with scale where not.
fn align(
    model: &Reconstruction,
    known: &BTreeMap<String, Vector3<f64>>,
    figures: &mut Value,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Similarity3>> {
    let centre = |i: usize| model.cam_from_world(ImageId::new(i)).map(|pose| pose.centre());
    let (mut found, mut truth) = (Vec::new(), Vec::new());
    for (i, image) in model.images.iter().enumerate() {
        if let (Some(f), Some(t)) = (centre(i), known.get(&image.name)) {
            found.push(f);
            truth.push(*t);
        }
    }
    let metric = model.scale == Scale::Metric;
    let Some(moved) = Similarity3::align(&found, &truth, !metric) else {
        let message = format!("{} known positions belong to oriented images; three that are not on one line are needed", found.len());
        warnings.push(Warning { about: "positions".to_owned(), message });
        return Ok(None);
    };
    let error = absolute_error(&found, &truth, if metric { Alignment::Se3 } else { Alignment::Sim3 })?;
    merge(figures, json!({ "positions": error }));
    Ok(Some(moved))
}

fn moved_cloud(mut cloud: Cloud, moved: Option<Similarity3>) -> Cloud {
    if let Some(moved) = moved {
        for position in &mut cloud.positions {
            *position = moved.apply(&position.coords).into();
        }
    }
    cloud
}
