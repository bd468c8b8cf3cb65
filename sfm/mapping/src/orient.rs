//! The way from verified pairs to models.

use crate::attempt::{Attempt, model_of};
use crate::contradiction;
use crate::error::MapError;
use crate::finish::{Done, finish_grown, length_notes};
use crate::frames::{Layout, given_pose, known_rig};
use crate::graph::CorrespondenceGraph;
use crate::incremental::{Tries, finish};
use crate::initial::{Starts, from_exposures, from_pairs};
use crate::input::{MapInput, RigMode};
use crate::interior::{best_interior, is_plausible};
use crate::lengths::{report_bars, report_baselines, rescale};
use crate::model::Model;
use crate::options::OrientOptions;
use crate::register::Registration;
use crate::rig::{solve_rig, with_rig};
use crate::rig_report::{report_rig, rig_notes};
use crate::summary::{LeftOut, OrientSummary, Orientation};
use crate::world_report::report_world;
use scene::{Observation, Point, Reconstruction, Rigid3, Scale};

/// Models beyond the first that are tried.
const MAX_FURTHER_MODELS: usize = 4;

/// Orients the images.
///
/// With [`RigMode::Rigid`] and all poses in the rig known, the model starts from one exposure and is metric from the
/// start; where no exposure has enough matches between its cameras, and where poses in the rig are unknown, the images
/// are oriented one by one first and the rig is solved from them. Known lengths then give the scale and take part in the
/// last adjustment. What cannot be joined to the first model comes out as further models.
///
/// # Errors
/// [`MapError`] when the input contradicts itself or nothing can be oriented.
pub fn orient(input: &MapInput, options: &OrientOptions) -> Result<Orientation, MapError> {
    input.check()?;
    let counts: Vec<usize> = input.keypoints.iter().map(Vec::len).collect();
    let graph = CorrespondenceGraph::new(&counts, &input.pairs);
    let mut notes = Vec::new();
    let done = first_model(input, &graph, options, &mut notes)?;
    let mut further = Vec::new();
    let mut taken: Vec<bool> = (0..input.images.len()).map(|i| done.model.is_oriented(scene::ImageId::new(i))).collect();
    for _ in 0..MAX_FURTHER_MODELS {
        let Some(next) = further_model(input, &graph, &done, &taken, options)? else { break };
        for (i, taken) in taken.iter_mut().enumerate() {
            *taken |= next.model.is_oriented(scene::ImageId::new(i));
        }
        notes.extend(contradiction::note(&next.model, options));
        further.push(reconstruction(&next.model, next.scale));
    }
    let mut out = orientation(input, done, notes, options);
    out.models.extend(further);
    out.models[1..].sort_by_key(|m| std::cmp::Reverse(m.oriented_images().count()));
    out.summary.left_out.retain(|left| !taken[left.image.index()]);
    Ok(out)
}

/// What is told of a finished model.
pub(crate) fn orientation(input: &MapInput, done: Done, mut notes: Vec<String>, options: &OrientOptions) -> Orientation {
    for (c, camera) in done.model.cameras.iter().enumerate().filter(|(c, _)| !input.cameras[*c].fixed) {
        if !is_plausible(camera) {
            notes.push(format!(
                "the interior orientation found for {} is not that of a lens ({} {:?}): do not trust the model, give a calibration",
                input.cameras[c].name,
                camera.model().name(),
                camera.params()
            ));
        }
    }
    let of_lengths = done.quality.as_ref().map_or(&[][..], |q| &q.lengths);
    notes.extend(length_notes(input, done.quality.as_ref().ok(), &done.rejected));
    let rig_poses = report_rig(&done.model, done.scale);
    notes.extend(rig_notes(input, &rig_poses));
    notes.extend(done.known.ties.notes.iter().cloned());
    notes.splice(0..0, contradiction::note(&done.model, options));
    let left_out_reasons = reasons(&done.model, &done.outcomes);
    let left_out = left_out_reasons.into_iter().enumerate().map(|(i, reason)| LeftOut { image: scene::ImageId::new(i), reason });
    let left_out = left_out.filter(|left| !done.model.is_oriented(left.image)).collect();
    let baselines = report_baselines(&done.model, done.scale);
    let scale_bars = report_bars(&done.model, done.scale, of_lengths);
    let world = report_world(&done.model, &done.known.ties);
    let models = vec![reconstruction(&done.model, done.scale)];
    let Done { adjustment, quality, rejected, made, .. } = done;
    Orientation {
        models,
        summary: OrientSummary { adjustment, made, left_out, baselines, rig_poses, scale_bars, world, quality, rejected, notes },
    }
}

/// How the last try of each image's frame went.
fn by_image(model: &Model, tries: &Tries) -> Vec<Option<Registration>> {
    model.images.iter().map(|image| tries[image.frame.index()].outcome).collect()
}

fn first_model<'a>(
    input: &'a MapInput,
    graph: &'a CorrespondenceGraph,
    options: &OrientOptions,
    notes: &mut Vec<String>,
) -> Result<Done<'a>, MapError> {
    let cameras = input.cameras.iter().map(|c| c.camera).collect();
    let layout = Layout::independent(input);
    let mut independent = Model::new(input, graph, cameras, layout.rigs, layout.frames, layout.images);
    let any = vec![true; independent.frames.len()];
    independent.cameras = best_interior(&independent, &any, options)?;
    let mut on_few_exposures = None;
    if let Some(cam_from_rig) = known_rig(input) {
        let taken = vec![false; input.images.len()];
        if let Some(done) = on_rig(input, graph, (independent.cameras.clone(), &cam_from_rig, Scale::Metric), &taken, options)? {
            if done.model.oriented_frames().len() >= options.min_model_frames.min(done.model.frames.len()) {
                return Ok(done);
            }
            on_few_exposures = Some(done);
        }
        notes
            .push("no exposure has enough matches between its cameras: images were oriented one by one, and then joined by the rig".into());
    }
    match (one_by_one(input, &independent, options, notes), on_few_exposures) {
        (Ok(done), Some(few)) if done.model.oriented_images().len() <= few.model.oriented_images().len() => Ok(few),
        (Err(MapError::NoInitialPair { .. }), Some(few)) => Ok(few),
        (done, _) => done,
    }
}

/// A model of images with a pose each, then on the rig where there is one and it can be solved.
fn one_by_one<'a>(
    input: &'a MapInput,
    independent: &Model<'a>,
    options: &OrientOptions,
    notes: &mut Vec<String>,
) -> Result<Done<'a>, MapError> {
    let any = vec![true; independent.frames.len()];
    let none = |starts: &Starts| MapError::NoInitialPair {
        candidates: starts.tried,
        best_inliers: starts.best_inliers,
        needed: options.initial_min_inliers,
    };
    let (mut model, tries, made) = match model_of(independent, || from_pairs(independent, &any, options), &any, false, options)? {
        Attempt::Model(model, tries, made) => (*model, tries, made),
        Attempt::NoModel(starts) => return Err(none(&starts)),
    };
    let outcomes = by_image(&model, &tries);
    let mut scale = Scale::Arbitrary;
    if input.rig.mode == RigMode::Rigid && input.cameras.len() > 1 {
        finish(&mut model, None, options)?;
        match solve_rig(&model) {
            Ok(solved) => {
                model = with_rig(&model, &solved);
                if let Some(factor) = metres_per_unit(input, &solved) {
                    rescale(&mut model, factor);
                    for (c, sensor) in model.rigs[0].sensors.iter_mut().enumerate() {
                        sensor.cam_from_rig = given_pose(input, c).unwrap_or(sensor.cam_from_rig);
                    }
                    scale = Scale::Metric;
                }
            }
            Err(missing) => notes.push(format!(
                "{} and {} are oriented together too rarely: the rig stays unknown and images keep poses of their own",
                missing.iter().map(|c| input.cameras[c.index()].name.as_str()).collect::<Vec<_>>().join(", "),
                input.cameras[0].name
            )),
        }
    }
    let done = Done { made: Some(made), ..finish_grown(model, outcomes, scale, options)? };
    // What grew from a wrong start may fall to nothing.
    if done.is_empty() { Err(none(&from_pairs(independent, &any, options))) } else { Ok(done) }
}

/// A model of the images that are not taken, one pose an exposure, in the unit of the rig; `None` when no exposure has
/// enough matches between its cameras.
fn on_rig<'a>(
    input: &'a MapInput,
    graph: &'a CorrespondenceGraph,
    (cameras, cam_from_rig, scale): (Vec<scene::Camera>, &[Rigid3], Scale),
    taken: &[bool],
    options: &OrientOptions,
) -> Result<Option<Done<'a>>, MapError> {
    let layout = Layout::rigid(input, cam_from_rig);
    let empty = Model::new(input, graph, cameras, layout.rigs, layout.frames, layout.images);
    let allowed: Vec<bool> = empty.frame_images.iter().map(|images| images.iter().all(|i| !taken[i.index()])).collect();
    let starts = || from_exposures(&empty, &allowed, &options.growing());
    let Attempt::Model(model, tries, made) = model_of(&empty, starts, &allowed, true, options)? else { return Ok(None) };
    let outcomes = by_image(&model, &tries);
    let done = Done { made: Some(made), ..finish_grown(*model, outcomes, scale, options)? };
    Ok((!done.model.oriented_frames().is_empty()).then_some(done))
}

/// Metres in one unit of the solved rig, from the cameras whose pose in the rig is given.
fn metres_per_unit(input: &MapInput, solved: &[Rigid3]) -> Option<f64> {
    let (mut given_m, mut found) = (0.0, 0.0);
    for (c, solved) in solved.iter().enumerate() {
        if let Some(given) = given_pose(input, c) {
            given_m += given.translation.norm();
            found += solved.translation.norm();
        }
    }
    Some(given_m / found).filter(|s| s.is_finite() && *s > 0.0)
}

/// Another model from the images that are in none yet.
fn further_model<'a>(
    input: &'a MapInput,
    graph: &'a CorrespondenceGraph,
    first: &Done,
    taken: &[bool],
    options: &OrientOptions,
) -> Result<Option<Done<'a>>, MapError> {
    let allowed: Vec<bool> = taken.iter().map(|t| !t).collect();
    if allowed.iter().filter(|a| **a).count() < options.min_model_frames {
        return Ok(None);
    }
    let enough = |done: &Done| done.model.oriented_frames().len() >= options.min_model_frames.max(1);
    // Interior orientation and rig that the first model found are the best that is known.
    let cameras = first.model.cameras.clone();
    if input.rig.mode == RigMode::Rigid && input.cameras.len() > 1 && first.model.rigs.len() == 1 {
        let cam_from_rig: Vec<Rigid3> = first.model.rigs[0].sensors.iter().map(|s| s.cam_from_rig).collect();
        if let Some(done) = on_rig(input, graph, (cameras.clone(), &cam_from_rig, first.scale), taken, options)?.filter(enough) {
            return Ok(Some(done));
        }
    }
    let layout = Layout::independent(input);
    let empty = Model::new(input, graph, cameras, layout.rigs, layout.frames, layout.images);
    let starts = || from_pairs(&empty, &allowed, options);
    let Attempt::Model(model, tries, _) = model_of(&empty, starts, &allowed, false, options)? else { return Ok(None) };
    let outcomes = by_image(&model, &tries);
    Ok(Some(finish_grown(*model, outcomes, Scale::Arbitrary, options)?).filter(enough))
}

/// Why each image of the first model has no pose.
fn reasons(model: &Model, outcomes: &[Option<Registration>]) -> Vec<String> {
    (0..model.images.len())
        .map(|i| {
            let image = scene::ImageId::new(i);
            let visible = model.visibility(image).count();
            match outcomes[i] {
                _ if model.input.keypoints[i].is_empty() => "no keypoints".into(),
                _ if model.graph.link_count(image) == 0 => "no verified match with any other image".into(),
                Some(Registration::Failed { inliers, correspondences }) => {
                    format!("its pose was refused: {inliers} inliers among {correspondences} matches with scene points")
                }
                _ => format!("only {visible} of its keypoints are matched with scene points"),
            }
        })
        .collect()
}

/// The model as a plain value, points in order of their ids.
fn reconstruction(model: &Model, scale: Scale) -> Reconstruction {
    let points = model
        .points()
        .map(|(_, point)| {
            let mut track = point.track.clone();
            track.sort_unstable();
            let errors: f64 = track.iter().filter_map(|&o| model.reprojection_error(&point.xyz, o)).sum();
            Point { xyz: point.xyz, colour: colour(model, &track), error_px: errors / track.len() as f64, track }
        })
        .collect();
    Reconstruction {
        cameras: model.cameras.clone(),
        rigs: model.rigs.clone(),
        frames: model.frames.clone(),
        images: model.images.clone(),
        keypoints: model.input.keypoints.clone(),
        points,
        scale,
    }
}

/// Mean colour of the observations; grey where none is known.
fn colour(model: &Model, track: &[Observation]) -> [u8; 3] {
    let known: Vec<[u8; 3]> =
        track.iter().filter_map(|o| model.input.colours.get(o.image.index())?.get(o.keypoint.index()).copied()).collect();
    if known.is_empty() {
        return [128; 3];
    }
    std::array::from_fn(|c| {
        let sum: usize = known.iter().map(|colour| usize::from(colour[c])).sum();
        ((sum + known.len() / 2) / known.len()) as u8
    })
}
