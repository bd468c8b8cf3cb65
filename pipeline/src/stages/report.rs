//! Every figure of every stage, in one file for programs and one page for people.

use super::page::page;
use crate::config::Config;
use crate::figures;
use crate::report::render;
use crate::stage::{Outcome, Stage, Work, no_inputs};
use crate::store::Fingerprint;
use anyhow::Result;
use serde_json::{Value, json};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "report",
    version: 1,
    upstream: &["ingest", "mask", "features", "matching", "orient", "densify", "surface", "evaluate"],
    options,
    inputs: no_inputs,
    work,
};

fn options(config: &Config) -> Value {
    json!({"name": config.name, "report": config.report})
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let report = figures::report(work.config, work.done);
    let json = format!("{report:#}\n");
    let html = render(&page(work, &report)?);
    for (path, text) in [("report.json", &json), ("report.html", &html)] {
        work.files.save(path, Fingerprint::of_bytes(text.as_bytes()), text.as_bytes())?;
    }
    Ok(Outcome { figures: json!({"note": "report.json, report.html"}), warnings: Vec::new() })
}
