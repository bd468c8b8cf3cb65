//! The figures of an orientation.

use super::images::ImageList;
use super::interior::Start;
use super::orient::Told;
use crate::config::Config;
use mapping::{
    CameraResiduals, ControlPointReport, InstrumentReport, InteriorSigma, LengthId, OrientSummary, Orientation, Quality, RegionResiduals,
    camera_residuals,
};
use scene::{Camera, CameraId, Reconstruction, Scale};
use serde_json::{Map, Value, json};

pub(super) fn figures(
    config: &Config,
    list: &ImageList,
    starts: &[Start],
    orientation: &Orientation,
    model: &Reconstruction,
    told: &Told,
) -> Value {
    let summary = &orientation.summary;
    let oriented = model.oriented_images().count();
    let scale = match model.scale {
        Scale::Metric => "metric",
        Scale::Arbitrary => "arbitrary",
    };
    let models: Vec<Value> =
        orientation.models.iter().map(|m| json!({"images": m.oriented_images().count(), "points": m.points.len()})).collect();
    let rms = model.reprojection_rms();
    let note = format!("{oriented} of {} images, {} points, {rms:.2} px, {scale}", list.images.len(), model.points.len());
    let made = summary.made.as_ref();
    json!({
        "oriented": oriented, "points": model.points.len(), "observations": model.observation_count(), "reprojection_rms_px": rms,
        "reprojection_mean_px": model.mean_point_error(), "scale": scale, "cameras": cameras(list, starts, summary, model),
        "baselines": baselines(list, summary), "rig_poses": rig_poses(list, summary), "scale_bars": scale_bars(config, summary, told), "models": models, "note": note,
        "length_error": length_error(summary), "precision": precision(summary, model), "world": world(summary),
        "control_points": control_points(config, summary, told),
        "mapper": {
            "way": made.map(|m| if m.global { "global" } else { "incremental" }), "reason": made.map(|m| &m.reason),
        },
        "adjustment": {
            "initial_cost": summary.adjustment.initial_cost, "final_cost": summary.adjustment.final_cost,
            "iterations": summary.adjustment.iterations, "termination": format!("{:?}", summary.adjustment.termination).to_lowercase(),
        },
    })
}

fn cameras(list: &ImageList, starts: &[Start], summary: &OrientSummary, model: &Reconstruction) -> Vec<Value> {
    let residuals = camera_residuals(model);
    let entry = |c: usize| {
        let camera = &model.cameras[c];
        let params: Map<String, Value> =
            camera.model().param_names().iter().zip(camera.params()).map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
        let sigma = summary.quality.as_ref().ok().and_then(|q| q.cameras.get(c)).filter(|s| !s.parameters.is_empty());
        json!({
            "name": list.cameras[c].name, "model": camera.model().name(), "start": starts[c].origin, "params": params,
            "sigmas": sigma.map(|s| sigmas(camera, s)), "correlations": sigma.map(|s| &s.correlations), "residuals": of_camera(&residuals[c]),
        })
    };
    (0..model.cameras.len()).map(entry).collect()
}

fn sigmas(camera: &Camera, sigma: &InteriorSigma) -> Map<String, Value> {
    let names = camera.model().param_names();
    sigma.parameters.iter().zip(&sigma.sigmas).map(|(&k, s)| (names[k].to_owned(), json!(s))).collect()
}

fn of_camera(residuals: &CameraResiduals) -> Value {
    let of = |r: &RegionResiduals| json!({"observations": r.observations, "rms_px": r.rms_px, "mean_px": r.mean_px});
    let mut value = of(&residuals.all);
    value["regions"] = residuals.regions.iter().map(of).collect();
    value
}

/// Normalised residual of a length, and whether it was taken out.
fn test(summary: &OrientSummary, id: LengthId) -> (Option<f64>, bool) {
    let rejected = summary.rejected.iter().find(|(other, _)| *other == id);
    let kept = summary.quality.as_ref().ok().and_then(|q| q.lengths.iter().find(|(other, _)| *other == id)).and_then(|(_, w)| *w);
    (rejected.map(|(_, w)| *w).or(kept), rejected.is_some())
}

fn baselines(list: &ImageList, summary: &OrientSummary) -> Vec<Value> {
    let name = |camera: CameraId| list.cameras[camera.index()].name.clone();
    let baseline = |b: &mapping::BaselineReport| {
        let (test_value, rejected) = test(summary, LengthId::Baseline(b.index));
        json!({
            "between": [name(b.cameras.0), name(b.cameras.1)], "given_m": b.given_m, "found_m": b.found_m, "sigma_m": b.sigma_m,
            "normalised_residual": b.normalised_residual, "test_value": test_value, "rejected": rejected,
        })
    };
    summary.baselines.iter().map(baseline).collect()
}

fn rig_poses(list: &ImageList, summary: &OrientSummary) -> Vec<Value> {
    let pose = |r: &mapping::RigPoseReport| {
        json!({
            "camera": list.cameras[r.camera.index()].name, "turned_deg": r.turned_rad.to_degrees(), "moved_m": r.moved_m,
            "normalised_residual": r.normalised_residual,
        })
    };
    summary.rig_poses.iter().map(pose).collect()
}

fn scale_bars(config: &Config, summary: &OrientSummary, told: &Told) -> Vec<Value> {
    let bar = |b: &mapping::ScaleBarReport| {
        let (test_value, rejected) = test(summary, LengthId::ScaleBar(b.index));
        json!({
            "name": config.scale_bars[b.index].name, "given_m": b.given_m, "found_m": b.found_m,
            "error_m": b.found_m.map(|found| found - b.given_m), "check": b.check,
            "normalised_residual": b.normalised_residual.or(test_value), "rejected": rejected, "targets": told.bar_targets[b.index],
        })
    };
    summary.scale_bars.iter().map(bar).collect()
}

fn world(summary: &OrientSummary) -> Value {
    let Some(world) = &summary.world else { return Value::Null };
    let of = |report: &Option<InstrumentReport>, rms: &str, unit: f64| {
        let figures = |r: &InstrumentReport| json!({"readings": r.readings, "outliers": r.outliers, rms: r.rms * unit, "sigma0": r.sigma0});
        report.as_ref().map(figures)
    };
    let degrees = 1f64.to_degrees();
    json!({
        "horizontal": of(&world.horizontal, "rms_m", 1.0), "height": of(&world.height, "rms_m", 1.0),
        "tilt": of(&world.tilt, "rms_deg", degrees), "heading": of(&world.heading, "rms_deg", degrees),
    })
}

fn control_points(config: &Config, summary: &OrientSummary, told: &Told) -> Vec<Value> {
    let point = |p: &ControlPointReport| {
        json!({
            "name": config.control_points[p.index].name, "error_m": p.error_m.map(|e| [e.x, e.y, e.z]),
            "normalised_residual": p.normalised_residual, "check": p.check, "targets": told.control_targets[p.index],
        })
    };
    summary.world.iter().flat_map(|w| &w.control_points).map(point).collect()
}

/// Of the lengths that were held out.
fn length_error(summary: &OrientSummary) -> Value {
    let errors: Vec<f64> = summary.scale_bars.iter().filter(|b| b.check).filter_map(|b| Some(b.found_m? - b.given_m)).collect();
    if errors.is_empty() {
        return Value::Null;
    }
    let n = errors.len() as f64;
    json!({
        "checks": errors.len(), "mean_m": errors.iter().sum::<f64>() / n, "rms_m": (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
        "max_m": errors.iter().fold(0.0, |m: f64, e| m.max(e.abs())),
    })
}

fn precision(summary: &OrientSummary, model: &Reconstruction) -> Value {
    let quality = match &summary.quality {
        Ok(quality) => quality,
        Err(error) => return json!({"missing": error.to_string()}),
    };
    let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let poses = || quality.images.iter().flatten();
    let centres = median_and_max(poses().map(|p| norm(&p.centre)).collect());
    let rotations = median_and_max(poses().map(|p| norm(&p.rotation_rad).to_degrees()).collect());
    let points = median_and_max(quality.points.iter().flatten().copied().collect());
    json!({
        "datum": model.images[quality.datum.index()].name,
        "datum_in_world": quality.datum_in_world.map(|p| json!({
            "centre_m": p.centre, "rotation_deg": p.rotation_rad.map(f64::to_degrees),
        })), "redundancy": quality.redundancy, "sigma0_image": quality.sigma0_image,
        "sigma0_baselines": quality.sigma0_baselines, "sigma0_scale_bars": quality.sigma0_scale_bars,
        "baseline_bend": quality.baseline_bend,
        "centre_median": centres.map(|c| c.0), "centre_max": centres.map(|c| c.1),
        "rotation_median_deg": rotations.map(|r| r.0), "rotation_max_deg": rotations.map(|r| r.1), "point_median": points.map(|p| p.0),
    })
}

fn median_and_max(mut values: Vec<f64>) -> Option<(f64, f64)> {
    values.sort_by(f64::total_cmp);
    Some((*values.get(values.len() / 2)?, *values.last()?))
}

/// A table of the standard deviations of every oriented image.
pub(super) fn precision_table(model: &Reconstruction, quality: &Quality) -> String {
    let mut text = String::from("image,centre_x,centre_y,centre_z,rotation_x_deg,rotation_y_deg,rotation_z_deg\n");
    for (image, sigma) in model.images.iter().zip(&quality.images) {
        let Some(sigma) = sigma else { continue };
        let turns = sigma.rotation_rad.map(f64::to_degrees);
        let cells: Vec<String> = sigma.centre.iter().chain(&turns).map(|v| format!("{v:.3e}")).collect();
        text.push_str(&format!("{},{}\n", image.name, cells.join(",")));
    }
    text
}
