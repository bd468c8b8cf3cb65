//! `sfm eval`.

use super::args::EvalArgs;
use super::dispatch::{print, start_threads};
use crate::reference::read_reference;
use anyhow::{Context, Result};
use eval::{EvalOptions, evaluate};
use scene::format::read_ply_cloud;
use std::fmt::Write;

pub(super) fn eval(args: &EvalArgs) -> Result<()> {
    start_threads(args.threads)?;
    let name = || args.cloud.display().to_string();
    let bytes = std::fs::read(&args.cloud).with_context(name)?;
    let (cloud, dropped) = read_ply_cloud(bytes.as_slice()).with_context(name)?;
    if dropped.points > 0 {
        eprintln!("warning: {}: {} points without a finite position are left out", args.cloud.display(), dropped.points);
    }
    let reference = read_reference(&args.reference)?;
    let options = EvalOptions {
        gsd_m: args.gsd_m,
        threshold_m: args.threshold_m,
        density_radius_m: args.density_radius_m,
        grid_m: args.grid_m,
        ..EvalOptions::default()
    };
    let metrics = evaluate(&cloud, &reference, &options)?;
    if args.json {
        return print(&format!("{}\n", serde_json::to_string_pretty(&metrics)?));
    }
    let mut text = String::new();
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "{what:<34}{value}");
    };
    line("points", metrics.points.to_string());
    line("threshold, m", format!("{:.4}", metrics.threshold_m));
    line("cloud to reference, mean, m", format!("{:.6}", metrics.c2m_mean_m));
    line("cloud to reference, RMS, m", format!("{:.6}", metrics.c2m_rms_m));
    if let Some(signed) = metrics.c2m_signed_mean_m {
        line("cloud to reference, signed mean, m", format!(" {signed:.6}"));
    }
    line("signal-to-noise ratio, %", format!("{:.1}", 100.0 * metrics.snr));
    line("surface density, points / m2", format!("{:.1}", metrics.surface_density_per_m2));
    line("integrity, %", format!("{:.1}", 100.0 * metrics.integrity));
    line("integrity as coverage, %", format!("{:.1}", 100.0 * metrics.integrity_coverage));
    line("completeness, %", format!("{:.1}", 100.0 * metrics.completeness));
    line("F-score, %", format!("{:.1}", 100.0 * metrics.f_score));
    print(&text)
}
