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
pub const STAGE: Stage = Stage { name: "surface", version: 2, upstream: &["densify"], options, inputs: no_inputs, work };

/// Below this share of supported surface the volume is doubted: in tests, 95 % leave errors of 3 %.
const SUPPORTED: f64 = 0.9;
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
    let supported = figures.pointer("/over_plane/supported").and_then(Value::as_f64);
    let mut warnings = Vec::new();
    if let Some(share) = supported.filter(|&s| s < SUPPORTED) {
        let message = format!(
            "only {:.0} % of the surface that the volume lies under is supported by points, the rest was closed by the reconstruction: \
             the volume is no measurement",
            100.0 * share
        );
        warnings.push(Warning { about: "volume".to_owned(), message });
    }
    Ok(Outcome { figures, warnings })
}
