//! `sfm surface`.

use super::args::SurfaceArgs;
use super::dispatch::{print, start_threads};
use crate::surfacing;
use ::surface::{PoissonOptions, Resolution};
use anyhow::{Context, Result, bail};
use scene::Mesh;
use scene::format::{read_ply_cloud, write_glb_mesh, write_obj_mesh, write_ply_mesh};
use serde_json::Value;
use std::fmt::Write;
use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;

/// Writes a mesh.
type Writer = fn(&Mesh, BufWriter<File>) -> Result<(), scene::format::FormatError>;

pub(super) fn surface(args: &SurfaceArgs) -> Result<()> {
    start_threads(args.threads)?;
    let write = writer(&args.out)?;
    let name = || args.cloud.display().to_string();
    let (cloud, dropped) = read_ply_cloud(BufReader::new(File::open(&args.cloud).with_context(name)?)).with_context(name)?;
    let defaults = PoissonOptions::default();
    let resolution = match (args.cell, args.depth) {
        (Some(cell), _) => Resolution::Cell(cell),
        (None, Some(depth)) => Resolution::Depth(depth),
        (None, None) => defaults.resolution,
    };
    let options = PoissonOptions {
        resolution,
        screening: args.screening.unwrap_or(defaults.screening),
        sigma_weights: args.sigma_weights,
        closed: args.closed,
        ..defaults
    };
    if args.sigma_weights && cloud.sigmas.is_empty() {
        bail!("{}: --sigma-weights needs a property sigma, which the cloud has not", args.cloud.display());
    }
    let (mesh, figures) = surfacing::make(&cloud, &options, args.trim).with_context(name)?;
    let out = || args.out.display().to_string();
    write(&mesh, BufWriter::new(File::create(&args.out).with_context(out)?)).with_context(out)?;
    let unused = dropped.points as u64 + cloud.len() as u64 - figures["points"].as_u64().unwrap_or_default();
    if unused > 0 {
        eprintln!("warning: {}: {unused} points without a finite position or a normal are left out", args.cloud.display());
    }
    if args.json { print(&format!("{figures:#}\n")) } else { print(&table(&figures)) }
}

fn writer(path: &Path) -> Result<Writer> {
    match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("ply") => Ok(write_ply_mesh),
        Some("obj") => Ok(write_obj_mesh),
        Some("glb") => Ok(write_glb_mesh),
        _ => bail!("{}: a mesh is written as .ply, .obj or .glb", path.display()),
    }
}

fn table(figures: &Value) -> String {
    let mut text = String::new();
    let rows = [
        ("triangles", "/faces", 0),
        ("edge of a cell", "/cell", 5),
        ("cut off, share of the area", "/trimmed_share", 4),
        ("area", "/area", 5),
        ("enclosed volume", "/closed_volume", 6),
        ("holes", "/holes/count", 0),
        ("their area", "/holes/area", 5),
        ("volume above the fitted plane", "/over_plane/above", 6),
        ("volume below it", "/over_plane/below", 6),
        ("footprint", "/over_plane/footprint", 5),
        ("supported by points, share", "/over_plane/supported", 4),
        ("rugosity, area by footprint", "/rugosity", 4),
        ("rugosity, chain by tape, mean", "/profiles/mean", 4),
    ];
    for (what, key, digits) in rows {
        if let Some(value) = figures.pointer(key).and_then(Value::as_f64) {
            let _ = writeln!(text, "{what:<34}{value:.digits$}");
        }
    }
    text
}
