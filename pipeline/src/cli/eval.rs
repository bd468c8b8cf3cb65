//! `sfm eval`.

use super::args::{Align, EvalArgs};
use super::coloured::Coloured;
use super::dispatch::{print, start_threads};
use crate::reference::{CloudFile, read_numbers, read_reference};
use anyhow::{Context, Result, bail};
use eval::dem::{HeightModel, height_difference};
use eval::{EvalOptions, M3c2Options, Points, Prepared, Reference, Region, evaluate_each, icp, m3c2, mesh_size};
use nalgebra::{Point3, Vector3};
use scene::Similarity3;
use serde_json::{Value, json};
use std::fmt::Write;

pub(super) fn eval(args: &EvalArgs) -> Result<()> {
    start_threads(args.threads)?;
    let reference = read_reference(&args.reference)?;
    let file = CloudFile::new(&args.cloud);
    let region = region(args)?;
    let mut figures = serde_json::Map::new();
    let motion = motion(args, &file, &reference, &mut figures)?;
    let cloud = Prepared { points: &file, motion, region: region.as_ref() };
    let options = EvalOptions {
        gsd_m: args.gsd_m,
        threshold_m: args.threshold_m,
        density_radius_m: args.density_radius_m,
        grid_m: args.grid_m,
        curve_m: args.curve_m.clone(),
        region: region.clone(),
        ..EvalOptions::default()
    };
    let mut out = match &args.out {
        Some(path) => {
            Some(Coloured::new(path, &cloud, matches!(reference, Reference::Mesh(_)), args.threshold_m.or(args.gsd_m.map(|g| 2.0 * g)))?)
        }
        None => None,
    };
    let mut failed = None;
    let metrics = evaluate_each(&cloud, &reference, &options, &mut |points, distances| {
        if let Some(out) = &mut out {
            out.write(points, distances).map_err(|e| {
                let text = format!("{e:#}");
                failed = Some(e);
                eval::EvalError::Input(text)
            })?;
        }
        Ok(())
    });
    if let Some(e) = failed {
        return Err(e);
    }
    let metrics = metrics.with_context(|| format!("{} against {}", args.cloud.display(), args.reference.display()))?;
    if let Some(out) = out {
        out.finish()?;
    }
    let dropped = file.read(&mut |_| Ok(()))?;
    if dropped > 0 {
        eprintln!("warning: {}: {dropped} points without a finite position are left out", args.cloud.display());
    }
    for warning in &metrics.warnings {
        eprintln!("warning: {warning}");
    }
    if let Value::Object(all) = serde_json::to_value(&metrics)? {
        figures.extend(all);
    }
    if let Reference::Mesh(mesh) = &reference {
        figures.insert("reference_size".to_owned(), serde_json::to_value(mesh_size(mesh)?)?);
    }
    more(args, &cloud, &reference, region.as_ref(), &mut figures)?;
    let figures = Value::Object(figures);
    if let Some(path) = &args.csv {
        let mut text = "key,value\n".to_owned();
        rows("", &figures, &mut text);
        std::fs::write(path, text).with_context(|| path.display().to_string())?;
    }
    if args.json { print(&format!("{}\n", serde_json::to_string_pretty(&figures)?)) } else { print(&table(&figures)) }
}

fn region(args: &EvalArgs) -> Result<Option<Region>> {
    let bounds = args.bounds.map(|[low, high]| (Point3::from(low), Point3::from(high)));
    let polygon = match &args.polygon {
        Some(path) => {
            let corners = read_numbers::<2>(path)?;
            if corners.len() < 3 {
                bail!("{}: a polygon has three corners or more, this one {}", path.display(), corners.len());
            }
            corners
        }
        None => Vec::new(),
    };
    Ok((bounds.is_some() || !polygon.is_empty()).then_some(Region { bounds, polygon }))
}

/// The motion onto the reference that was asked for: corresponding points first, then the closest points.
fn motion(
    args: &EvalArgs,
    file: &CloudFile<'_>,
    reference: &Reference,
    figures: &mut serde_json::Map<String, Value>,
) -> Result<Option<Similarity3>> {
    let mut motion = None;
    if let Some(path) = &args.correspondences {
        let rows = read_numbers::<6>(path)?;
        let (from, to): (Vec<_>, Vec<_>) = rows.iter().map(|&[x, y, z, a, b, c]| (Vector3::new(x, y, z), Vector3::new(a, b, c))).unzip();
        let Some(found) = Similarity3::align(&from, &to, args.free_scale) else {
            bail!("{}: {} points; three or more that are not on one line are needed", path.display(), rows.len());
        };
        let rms = (from.iter().zip(&to).map(|(f, t)| (found.apply(f) - t).norm_squared()).sum::<f64>() / from.len() as f64).sqrt();
        figures.insert("correspondences".to_owned(), json!({ "count": from.len(), "rms_m": rms }));
        motion = Some(found);
    }
    if let Some(align) = args.align {
        let moved = Prepared { points: file, motion, region: None };
        let (step, summary) = icp(&thinned(&moved)?, reference, align == Align::IcpScale)?;
        if !summary.converged {
            eprintln!("warning: the alignment still moved after {} steps", summary.iterations);
        }
        figures.insert("icp".to_owned(), serde_json::to_value(summary)?);
        motion = Some(motion.map_or(step, |first| Similarity3 {
            scale: step.scale * first.scale,
            rotation: step.rotation * first.rotation,
            translation: step.apply(&first.translation),
        }));
    }
    if let Some(m) = &motion {
        let (q, t) = (m.rotation.coords, m.translation);
        figures.insert("motion".to_owned(), json!({ "scale": m.scale, "quaternion_xyzw": q.as_slice(), "translation_m": t.as_slice() }));
    }
    Ok(motion)
}

/// Evenly spaced points, at most 20,000, of a cloud of any size.
fn thinned(points: &dyn Points) -> Result<Vec<Point3<f64>>> {
    let mut count = 0usize;
    points.visit(&mut |piece| {
        count += piece.len();
        Ok(())
    })?;
    let (stride, mut start, mut all) = (count.div_ceil(20_000).max(1), 0usize, Vec::new());
    points.visit(&mut |piece| {
        let first = (stride - start % stride) % stride;
        all.extend(piece.iter().skip(first).step_by(stride));
        start += piece.len();
        Ok(())
    })?;
    Ok(all)
}

/// Height models and M3C2, where asked for.
fn more(
    args: &EvalArgs,
    cloud: &dyn Points,
    reference: &Reference,
    region: Option<&Region>,
    figures: &mut serde_json::Map<String, Value>,
) -> Result<()> {
    if let Some(cell) = args.dem_cell_m {
        let surface = reference.points_over_area(cell / 4.0, region);
        let bounds = |i: usize| surface.iter().map(|p| p[i]).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let [(x0, x1), (y0, y1)] = [bounds(0), bounds(1)];
        let mut first = HeightModel::new([x0, y0], [x1, y1], cell)?;
        let mut second = first.clone();
        first.add(&surface);
        cloud.visit(&mut |piece| {
            second.add(piece);
            Ok(())
        })?;
        figures.insert("dem_of_difference".to_owned(), serde_json::to_value(height_difference(&first, &second, 0.0)?)?);
    }
    if let Some(scale) = args.m3c2_m {
        let Reference::Cloud(other) = reference else { bail!("--m3c2-m: the reference has to be a cloud, this one is a mesh") };
        let mut all = Vec::new();
        cloud.visit(&mut |piece| {
            all.extend_from_slice(piece);
            Ok(())
        })?;
        let options = M3c2Options {
            normal_scale_m: 3.0 * scale,
            projection_scale_m: scale,
            max_depth_m: 3.0 * scale,
            registration_m: args.registration_m,
            max_core_points: 20_000,
        };
        let core: Vec<_> = other.positions.iter().filter(|p| region.is_none_or(|r| r.contains(p))).copied().collect();
        figures.insert("m3c2".to_owned(), serde_json::to_value(m3c2(&all, &core, &options)?.0)?);
    }
    Ok(())
}

/// Every number below a value as a line of `key,value`; keys of nested values are joined by dots.
fn rows(key: &str, value: &Value, out: &mut String) {
    let below = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
    match value {
        Value::Object(fields) => fields.iter().for_each(|(name, value)| rows(&below(name), value, out)),
        Value::Array(values) => values.iter().enumerate().for_each(|(i, value)| rows(&below(&i.to_string()), value, out)),
        Value::Null => {}
        Value::String(text) => {
            let _ = writeln!(out, "{key},\"{}\"", text.replace('"', "\"\""));
        }
        other => {
            let _ = writeln!(out, "{key},{other}");
        }
    }
}

fn table(figures: &Value) -> String {
    let mut text = String::new();
    let mut line = |what: &str, value: Option<String>| {
        if let Some(value) = value {
            let _ = writeln!(text, "{what:<34}{value}");
        }
    };
    let metres = |key: &str, digits: usize| figures.pointer(key).and_then(Value::as_f64).map(|v| format!("{v:.digits$}"));
    let percent = |key: &str| figures.pointer(key).and_then(Value::as_f64).map(|v| format!("{:.1}", 100.0 * v));
    line("points", figures["points"].as_u64().map(|n| n.to_string()));
    line("threshold, m", metres("/threshold_m", 4));
    line("cloud to reference, mean, m", metres("/c2m_mean_m", 6));
    line("cloud to reference, RMS, m", metres("/c2m_rms_m", 6));
    line("cloud to reference, signed mean, m", metres("/c2m_signed_mean_m", 6).map(|v| format!(" {v}")));
    line("cloud to reference, median, m", metres("/c2m_median_m", 6));
    line("median absolute deviation, m", metres("/c2m_mad_m", 6));
    line("95 % of the points within, m", metres("/c2m_percentiles_m/p95_m", 6));
    line("signal-to-noise ratio, %", percent("/snr"));
    line("surface density, points / m2", metres("/surface_density_per_m2", 1));
    line("integrity, %", percent("/integrity"));
    line("integrity as coverage, %", percent("/integrity_coverage"));
    line("completeness, %", percent("/completeness"));
    line("F-score, %", percent("/f_score"));
    line("aligned, RMS along normals, m", metres("/icp/rms_after_m", 6));
    line("volume raised, m3", metres("/dem_of_difference/raised_m3", 6));
    line("volume lowered, m3", metres("/dem_of_difference/lowered_m3", 6));
    line("M3C2, mean, m", metres("/m3c2/mean_m", 6));
    line("M3C2, level of detection, m", metres("/m3c2/mean_detection_m", 6));
    line("M3C2, significant, %", percent("/m3c2/significant"));
    text
}
