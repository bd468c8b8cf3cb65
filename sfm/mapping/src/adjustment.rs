//! Hands the model, or a part of it, to the bundle adjuster.

use crate::error::MapError;
use crate::input::RigMode;
use crate::lengths::Known;
use crate::model::Model;
use crate::options::OrientOptions;
use nalgebra::Vector2;
use scene::camera::{MAX_CAMERA_PARAMS, ParamKind};
use scene::{FrameId, ImageId, PointId};
use solve::adjust::{
    AdjustOptions, AdjustSummary, CameraBlock, ImageObservation, Loss, ParamPrior, PointBlock, PoseBlock, PosePrior, Problem, adjust,
};

/// Loss of positions, directions and headings: acoustic positions jump by tens of metres, compasses near steel by tens of degrees.
pub(crate) const SENSOR_LOSS: Loss = Loss::Cauchy { scale_px: 3.0 };

/// No parameter of a model moves by a larger share of it when it is adjusted again.
const PARAMETER_TOLERANCE: f64 = 1e-9;

/// How hard an adjustment of the whole model tries.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    pub loss: Loss,
    pub max_iterations: usize,
    pub function_tolerance: f64,
}

impl Effort {
    /// Until nothing moves: the adjustment of what this leaves changes nothing.
    pub(crate) fn last(options: &OrientOptions) -> Self {
        Self { loss: options.loss, max_iterations: 200, function_tolerance: 0.0 }
    }
}

/// What may move.
pub(crate) struct Scope<'a> {
    /// Frames whose pose is refined.
    pub free_frames: &'a [bool],
    /// Points that take part; all of them are refined.
    pub points: &'a [PointId],
    /// Interior orientation and rig are refined as far as the input allows.
    pub calibration: bool,
    /// What is known besides the images, and takes part.
    pub known: Option<&'a Known>,
}

/// Adjusts all oriented frames, all points, and interior orientation and rig as far as the input allows.
pub(crate) fn adjust_all(
    model: &mut Model,
    known: Option<&Known>,
    effort: Effort,
    options: &OrientOptions,
) -> Result<AdjustSummary, MapError> {
    let free_frames = vec![true; model.frames.len()];
    let points: Vec<PointId> = model.points().map(|(id, _)| id).collect();
    run(model, &Scope { free_frames: &free_frames, points: &points, calibration: true, known }, effort, options)
}

/// The problem of [`adjust_all`], and where the elements of the model stand in it.
pub(crate) fn whole_problem(model: &Model, known: Option<&Known>, options: &OrientOptions) -> (Problem, ProblemMap) {
    let free_frames = vec![true; model.frames.len()];
    let points: Vec<PointId> = model.points().map(|(id, _)| id).collect();
    build(model, &Scope { free_frames: &free_frames, points: &points, calibration: true, known }, options)
}

/// Adjusts the scope and writes the result back.
pub(crate) fn run(model: &mut Model, scope: &Scope, effort: Effort, options: &OrientOptions) -> Result<AdjustSummary, MapError> {
    let (mut problem, map) = build(model, scope, options);
    let adjust_options = AdjustOptions {
        loss: effort.loss,
        max_iterations: effort.max_iterations,
        function_tolerance: effort.function_tolerance,
        parameter_tolerance: PARAMETER_TOLERANCE,
        sensor_loss: SENSOR_LOSS,
        ..AdjustOptions::default()
    };
    let summary = adjust(&mut problem, &adjust_options)?;
    write_back(model, scope, &problem, &map);
    Ok(summary)
}

/// Where the elements of the model stand in the problem.
pub(crate) struct ProblemMap {
    frames: Vec<Option<u32>>,
    /// First sensor of each rig.
    first_sensor: Vec<u32>,
}

impl ProblemMap {
    /// Where a frame stands in the problem.
    pub(crate) fn frame(&self, frame: usize) -> Option<u32> {
        self.frames[frame]
    }
}

fn build(model: &Model, scope: &Scope, options: &OrientOptions) -> (Problem, ProblemMap) {
    let oriented = model.oriented_images();
    let cameras = model.cameras.iter().enumerate().map(|(c, _)| camera_block(model, c, &oriented, scope.calibration, options)).collect();
    let mut sensors = Vec::new();
    let mut first_sensor = Vec::new();
    for rig in &model.rigs {
        first_sensor.push(sensors.len() as u32);
        for (i, sensor) in rig.sensors.iter().enumerate() {
            let free = scope.calibration && i > 0 && is_sensor_free(model, sensor.camera.index());
            sensors.push(PoseBlock { pose: sensor.cam_from_rig, free, prior: sensor_prior(model, sensor.camera.index()).filter(|_| free) });
        }
    }
    let mut frames = Vec::new();
    let frame_map: Vec<Option<u32>> = model
        .frames
        .iter()
        .enumerate()
        .map(|(f, frame)| {
            frame.rig_from_world.map(|pose| {
                frames.push(PoseBlock { pose, free: scope.free_frames[f], prior: None });
                frames.len() as u32 - 1
            })
        })
        .collect();
    let map = ProblemMap { frames: frame_map, first_sensor };
    let mut points = Vec::with_capacity(scope.points.len());
    let mut observations = Vec::new();
    for &id in scope.points {
        let Some(point) = model.point(id) else { continue };
        let index = points.len() as u32;
        points.push(PointBlock { xyz: point.xyz, free: true });
        for &o in &point.track {
            observations.extend(observe(model, &map, o.image, index, model.pixel(o), model.sigma_px(o)));
        }
    }
    let mut problem = Problem { cameras, sensors, frames, points, observations, ..Problem::default() };
    if let Some(known) = scope.known {
        known.add_to(
            &mut problem,
            |image| sensor_of(model, &map, image),
            |pick, point| observe(model, &map, pick.image, point, pick.pixel.into(), pick.sigma_px),
        );
        known.ties.add_to(&mut problem, model, &map);
    }
    (problem, map)
}

/// Frame and sensor of an oriented image in the problem.
pub(crate) fn sensor_of(model: &Model, map: &ProblemMap, image: ImageId) -> Option<(u32, u32)> {
    let frame = model.images[image.index()].frame;
    let rig = model.frames[frame.index()].rig;
    let place = model.rigs[rig.index()].sensors.iter().position(|s| s.camera == model.images[image.index()].camera)?;
    Some((map.frames[frame.index()]?, map.first_sensor[rig.index()] + place as u32))
}

pub(crate) fn observe(
    model: &Model,
    map: &ProblemMap,
    image: ImageId,
    point: u32,
    pixel: Vector2<f64>,
    sigma_px: f64,
) -> Option<ImageObservation> {
    let (frame, sensor) = sensor_of(model, map, image)?;
    Some(ImageObservation { frame, sensor, camera: model.images[image.index()].camera.0, point, pixel, sigma_px })
}

fn camera_block(model: &Model, camera: usize, oriented: &[ImageId], calibration: bool, options: &OrientOptions) -> CameraBlock {
    let block = model.cameras[camera];
    let images = oriented.iter().filter(|i| model.images[i.index()].camera.index() == camera).count();
    let refine = calibration && !model.input.cameras[camera].fixed && images >= options.refine_interior_from;
    let input = &model.input.cameras[camera];
    let (mut free, mut priors) = ([false; MAX_CAMERA_PARAMS], [None; MAX_CAMERA_PARAMS]);
    for (k, kind) in block.model().param_kinds().iter().enumerate() {
        let sigma = input.sigmas.get(k).copied().flatten();
        let asked = *kind != ParamKind::PrincipalPoint || options.refine_principal_point || sigma.is_some();
        free[k] = refine && asked && !input.held.get(k).is_some_and(|h| *h);
        priors[k] = sigma.map(|sigma| ParamPrior { value: input.camera.params()[k], sigma });
    }
    CameraBlock { camera: block, free, priors }
}

/// A camera's pose in the rig is refined when it is not given, or given with a standard deviation.
fn is_sensor_free(model: &Model, camera: usize) -> bool {
    let rig = &model.input.rig;
    rig.mode == RigMode::Rigid && rig.poses.get(camera).copied().flatten().is_none_or(|pose| pose.sigma.is_some())
}

fn sensor_prior(model: &Model, camera: usize) -> Option<PosePrior> {
    let pose = model.input.rig.poses.get(camera).copied().flatten()?;
    let (sigma_rotation_rad, sigma_translation) = pose.sigma?;
    Some(PosePrior { pose: pose.cam_from_rig, sigma_rotation_rad, sigma_translation })
}

fn write_back(model: &mut Model, scope: &Scope, problem: &Problem, map: &ProblemMap) {
    for (camera, block) in model.cameras.iter_mut().zip(&problem.cameras) {
        *camera = block.camera;
    }
    for (rig, &first) in model.rigs.iter_mut().zip(&map.first_sensor) {
        for (i, sensor) in rig.sensors.iter_mut().enumerate() {
            sensor.cam_from_rig = problem.sensors[first as usize + i].pose;
        }
    }
    for (frame, slot) in model.frames.iter_mut().zip(&map.frames) {
        if let Some(slot) = slot {
            frame.rig_from_world = Some(problem.frames[*slot as usize].pose);
        }
    }
    let existing = scope.points.iter().filter(|&&id| model.point(id).is_some()).copied().collect::<Vec<_>>();
    for (id, block) in existing.into_iter().zip(&problem.points) {
        model.set_xyz(id, block.xyz);
    }
}

/// The frames that share most points with `frame`, the best first; at most `count`.
pub(crate) fn neighbours(model: &Model, frame: FrameId, count: usize) -> Vec<FrameId> {
    let mut shared = vec![0usize; model.frames.len()];
    for &image in &model.frame_images[frame.index()] {
        for id in crate::triangulation::points_in(model, image) {
            for o in model.point(id).map_or(&[][..], |p| &p.track) {
                shared[model.images[o.image.index()].frame.index()] += 1;
            }
        }
    }
    shared[frame.index()] = 0;
    let mut ranked: Vec<usize> = (0..shared.len()).filter(|&f| shared[f] > 0).collect();
    ranked.sort_by_key(|&f| (std::cmp::Reverse(shared[f]), f));
    ranked.truncate(count);
    ranked.into_iter().map(FrameId::new).collect()
}

/// Adjusts a frame, its best neighbours and the points that it sees; everything else stays.
pub(crate) fn adjust_around(model: &mut Model, frame: FrameId, neighbour_count: usize, options: &OrientOptions) -> Result<(), MapError> {
    let mut free_frames = vec![false; model.frames.len()];
    free_frames[frame.index()] = true;
    for neighbour in neighbours(model, frame, neighbour_count) {
        free_frames[neighbour.index()] = true;
    }
    let mut points: Vec<PointId> =
        model.frame_images[frame.index()].iter().flat_map(|&i| crate::triangulation::points_in(model, i)).collect();
    points.sort_unstable();
    points.dedup();
    let effort = Effort { loss: Loss::SoftL1 { scale_px: 1.0 }, max_iterations: 15, function_tolerance: 1e-4 };
    run(model, &Scope { free_frames: &free_frames, points: &points, calibration: false, known: None }, effort, options)?;
    Ok(())
}
