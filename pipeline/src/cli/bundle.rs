//! `sfm bundle`.

use super::args::BundleArgs;
use super::dispatch::{print, start_threads};
use crate::clock::{Timing, Watch};
use anyhow::{Context, Result};
use nalgebra::Vector2;
use scene::camera::{MAX_CAMERA_PARAMS, ParamKind};
use scene::format::read_colmap_model;
use scene::{ImageId, Reconstruction};
use serde_json::json;
use solve::adjust::{AdjustOptions, AdjustSummary, CameraBlock, ImageObservation, PointBlock, PoseBlock, Problem, adjust};
use solve::bal::parse_bal;

pub(super) fn bundle(args: &BundleArgs) -> Result<()> {
    start_threads(args.threads)?;
    let name = || args.problem.display().to_string();
    let mut problem = if args.problem.is_dir() {
        problem_of(&read_colmap_model(&args.problem)?).with_context(name)?
    } else {
        parse_bal(&std::fs::read_to_string(&args.problem).with_context(name)?).with_context(name)?
    };
    let watch = Watch::start();
    let summary = adjust(&mut problem, &AdjustOptions { max_iterations: args.iterations as usize, ..AdjustOptions::default() })?;
    let timing = watch.read();
    let termination = format!("{:?}", summary.termination).to_lowercase();
    if args.json {
        let figures = json!({
            "initial_cost": summary.initial_cost, "final_cost": summary.final_cost, "iterations": summary.iterations,
            "termination": termination, "observations": summary.observations, "observations_left_out": summary.observations_left_out,
            "parameters": summary.free.total, "reprojection_rms_px": summary.reprojection.rms_px, "seconds": timing.seconds,
            "cpu_seconds": timing.cpu_seconds,
        });
        return print(&format!("{}\n", serde_json::to_string_pretty(&figures)?));
    }
    print(&text(&summary, &termination, &timing))
}

fn text(summary: &AdjustSummary, termination: &str, timing: &Timing) -> String {
    let left_out = match summary.observations_left_out {
        0 => String::new(),
        n => format!("; {n} left out, whose points do not project at the start"),
    };
    let of_processors = timing.cpu_seconds.map_or(String::new(), |s| format!(", {s:.2} s of processor"));
    format!(
        "{} observations, {} parameters{left_out}\ncost {:.6} to {:.6} in {} iterations, {termination}\nRMS {:.3} px, {:.2} s{of_processors}\n",
        summary.observations,
        summary.free.total,
        summary.initial_cost,
        summary.final_cost,
        summary.iterations,
        summary.reprojection.rms_px,
        timing.seconds
    )
}

/// A model as a problem: poses, points, focal lengths and distortion are free, and so are the poses in the rig of all cameras but
/// the first; observations weigh alike.
fn problem_of(model: &Reconstruction) -> Result<Problem> {
    let mut problem = Problem::default();
    for camera in &model.cameras {
        let mut free = [false; MAX_CAMERA_PARAMS];
        free.iter_mut().zip(camera.model().param_kinds()).for_each(|(free, kind)| *free = *kind != ParamKind::PrincipalPoint);
        problem.cameras.push(CameraBlock { free, ..CameraBlock::fixed(*camera) });
    }
    let mut first_sensor = Vec::new();
    for rig in &model.rigs {
        first_sensor.push(problem.sensors.len());
        let sensors = rig.sensors.iter().enumerate();
        problem.sensors.extend(sensors.map(|(i, s)| PoseBlock { free: i > 0, ..PoseBlock::fixed(s.cam_from_rig) }));
    }
    // Frames that are not oriented see nothing.
    problem.frames =
        model.frames.iter().map(|f| f.rig_from_world.map_or(PoseBlock::fixed(scene::Rigid3::identity()), PoseBlock::free)).collect();
    let sensor_of = |image: ImageId| {
        let image = &model.images[image.index()];
        let rig = model.frames[image.frame.index()].rig.index();
        let place = model.rigs[rig].sensors.iter().position(|s| s.camera == image.camera);
        place.map(|p| (first_sensor[rig] + p) as u32).with_context(|| format!("the camera of {} is not part of its rig", image.name))
    };
    for point in &model.points {
        let index = problem.points.len() as u32;
        problem.points.push(PointBlock { xyz: point.xyz, free: true });
        for &o in &point.track {
            let image = &model.images[o.image.index()];
            let pixel: Vector2<f64> = model.pixel(o);
            let (frame, sensor, camera) = (image.frame.0, sensor_of(o.image)?, image.camera.0);
            problem.observations.push(ImageObservation { frame, sensor, camera, point: index, pixel, sigma_px: 1.0 });
        }
    }
    Ok(problem)
}
