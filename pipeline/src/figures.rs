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
    json!({
        "dive": config.name,
        "version": env!("CARGO_PKG_VERSION"),
        "images": {"found": figure("ingest", "found"), "total": figure("ingest", "usable"), "oriented": figure("orient", "oriented")},
        "frames": {"total": figure("ingest", "frames")},
        "cameras": figure("ingest", "cameras"),
        "masks": part("mask", &["strategy", "masks", "empty", "masked_ratio"]),
        "warnings": warnings,
    })
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
