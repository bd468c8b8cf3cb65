//! Every figure of every stage, in one file for programs and one page for people.

use crate::config::Config;
use crate::figures;
use crate::stage::{Outcome, Stage, Work, no_inputs};
use crate::store::Fingerprint;
use anyhow::Result;
use serde_json::{Value, json};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "report",
    version: 1,
    upstream: &["ingest", "mask", "features", "matching", "orient", "densify", "evaluate"],
    options,
    inputs: no_inputs,
    work,
};

fn options(config: &Config) -> Value {
    json!({"name": config.name})
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let report = figures::report(work.config, work.done);
    let text = format!("{report:#}\n");
    work.files.save("report.json", Fingerprint::of_bytes(text.as_bytes()), text.as_bytes())?;
    Ok(Outcome { figures: json!({"note": "report.json"}), warnings: Vec::new() })
}
