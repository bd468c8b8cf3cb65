//! The surface through the dense cloud, and its measures.

use super::densify;
use crate::config::Config;
use crate::stage::{Outcome, Stage, Work, no_inputs};
use crate::store::{Fingerprint, Warning};
use crate::surfacing;
use ::surface::{PoissonOptions, Resolution};
use anyhow::{Context, Result};
use scene::format::{read_ply_cloud, write_ply_mesh};
use serde_json::{Value, json};

/// The stage.
pub const STAGE: Stage = Stage { name: "surface", version: 1, upstream: &["densify"], options, inputs: no_inputs, work };

/// The mesh.
pub const MESH: &str = "surface/mesh.ply";

fn options(config: &Config) -> Value {
    json!(config.surface)
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let (cloud, _) = read_ply_cloud(work.read("densify", densify::CLOUD)?.as_slice()).context(densify::CLOUD)?;
    let config = &work.config.surface;
    let none = |message: String| Outcome {
        figures: json!({ "note": "no surface" }),
        warnings: vec![Warning { about: "surface".to_owned(), message }],
    };
    let gsd = work.done.get("densify").and_then(|s| s.figures["ground_sample_distance"].as_f64());
    let Some(cell) = config.cell_m.or(gsd.map(|g| 2.0 * g)) else {
        return Ok(none("no surface: there is no dense cloud".to_owned()));
    };
    let options = PoissonOptions {
        resolution: Resolution::Cell(cell),
        screening: config.screening,
        samples_per_cell: config.samples_per_cell,
        sigma_weights: config.sigma_weights,
        closed: config.closed,
        ..PoissonOptions::default()
    };
    work.progress.begin("surface", 0);
    // A cloud that has no surface is no reason to go without all other figures.
    let (mesh, mut figures) = match surfacing::make(&cloud, &options, config.trim) {
        Ok(made) => made,
        Err(e) => return Ok(none(format!("no surface: {e}"))),
    };
    let mut bytes = Vec::new();
    write_ply_mesh(&mesh, &mut bytes)?;
    work.files.save(MESH, Fingerprint::of_bytes(&bytes), &bytes)?;
    figures["note"] = json!(format!("{} triangles, {:.4} of area", mesh.faces.len(), figures["area"].as_f64().unwrap_or_default()));
    Ok(Outcome { figures, warnings: Vec::new() })
}
