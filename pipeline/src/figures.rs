//! report.json: the figures of every stage, put together.

use crate::clock::Timing;
use crate::config::Config;
use crate::store::Stamp;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// The report of the stages that are done. Figures of stages that are not done are null.
#[must_use]
pub fn report(config: &Config, done: &BTreeMap<&'static str, Stamp>) -> Value {
    let figure = |stage: &str, key: &str| done.get(stage).and_then(|s| s.figures.get(key)).cloned().unwrap_or_default();
    let part = |stage: &str, keys: &[&str]| -> Value {
        keys.iter().map(|key| ((*key).to_owned(), figure(stage, key))).collect::<Map<String, Value>>().into()
    };
    let warnings: Vec<Value> = crate::recipe::RECIPE
        .iter()
        .filter_map(|stage| Some((stage.name, done.get(stage.name)?)))
        .flat_map(|(name, stamp)| stamp.warnings.iter().map(move |w| json!({"stage": name, "about": w.about, "message": w.message})))
        .collect();
    let dense = ["quality", "maps", "depths", "points", "ground_sample_distance"];
    json!({
        "dive": config.name,
        "version": env!("CARGO_PKG_VERSION"),
        "images": {"found": figure("ingest", "found"), "total": figure("ingest", "usable"), "oriented": figure("orient", "oriented")},
        "frames": {"total": figure("ingest", "frames")},
        "cameras": cameras(figure("ingest", "cameras"), &figure("orient", "cameras")),
        "masks": part("mask", &["strategy", "masks", "empty", "empty_images", "masked_ratio", "masked_ratio_by_camera", "classifier"]),
        "features": part("features", &["keypoints", "median"]),
        "matching": part("matching", &["pairs_tried", "pairs_verified", "matches", "calibrated", "uncalibrated", "planar_or_panoramic"]),
        "points": figure("orient", "points"),
        "observations": figure("orient", "observations"),
        "reprojection_rms_px": figure("orient", "reprojection_rms_px"),
        "reprojection_mean_px": figure("orient", "reprojection_mean_px"),
        "scale": figure("orient", "scale"),
        "models": figure("orient", "models"),
        "mapper": figure("orient", "mapper"),
        "adjustment": figure("orient", "adjustment"),
        "precision": figure("orient", "precision"),
        "length_error": figure("orient", "length_error"),
        "baselines": figure("orient", "baselines"),
        "rig_poses": figure("orient", "rig_poses"),
        "scale_bars": figure("orient", "scale_bars"),
        "world": figure("orient", "world"),
        "control_points": figure("orient", "control_points"),
        "dense": part("densify", &dense),
        "surface": stage_figures(done.get("surface").map(|s| &s.figures)),
        "evaluation": stage_figures(done.get("evaluate").map(|s| &s.figures)),
        "warnings": warnings,
    })
}

/// What the images say of each camera, and what the orientation found.
fn cameras(ingested: Value, oriented: &Value) -> Value {
    let Value::Array(mut cameras) = ingested else { return Value::Null };
    for (i, camera) in cameras.iter_mut().enumerate() {
        if let Value::Object(camera) = camera {
            for key in ["model", "start", "params", "sigmas", "correlations", "residuals"] {
                camera.insert(key.to_owned(), oriented[i][key].clone());
            }
        }
    }
    cameras.into()
}

/// The figures without the line for people.
fn stage_figures(figures: Option<&Value>) -> Value {
    let Some(Value::Object(figures)) = figures else { return Value::Null };
    figures.iter().filter(|(key, _)| *key != "note").map(|(k, v)| (k.clone(), v.clone())).collect::<Map<_, _>>().into()
}

/// The report with the time that each stage took, which is not the same in every run.
#[must_use]
pub fn with_timings(mut report: Value, timings: &BTreeMap<String, Timing>) -> Value {
    if let Value::Object(report) = &mut report {
        let stages: Map<String, Value> =
            timings.iter().map(|(name, t)| (name.clone(), json!({"seconds": t.seconds, "cpu_seconds": t.cpu_seconds}))).collect();
        report.insert("stages".to_owned(), stages.into());
    }
    report
}
