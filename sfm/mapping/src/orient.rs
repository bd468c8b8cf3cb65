//! The way from verified pairs to models.

use crate::attempt::best_model;
use crate::error::MapError;
use crate::frames::{Layout, known_rig};
use crate::graph::CorrespondenceGraph;
use crate::incremental::{Tries, finish};
use crate::initial::{from_exposures, from_pairs};
use crate::input::{MapInput, RigMode};
use crate::lengths::{Lengths, report_bars, report_baselines, rescale};
use crate::model::Model;
use crate::options::OrientOptions;
use crate::register::Registration;
use crate::rig::{solve_rig, with_rig};
use crate::summary::{LeftOut, OrientSummary, Orientation};
use nalgebra::Vector2;
use scene::{Observation, Point, Reconstruction, Rigid3, Scale};
use solve::adjust::AdjustSummary;

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
    let mut done = first_model(input, &graph, options, &mut notes)?;
    let baselines = report_baselines(&done.model);
    let scale_bars = report_bars(&done.model);
    let mut models = vec![reconstruction(&done.model, done.scale)];
    let mut taken: Vec<bool> = (0..input.images.len()).map(|i| done.model.is_oriented(scene::ImageId::new(i))).collect();
    let left_out_reasons = reasons(&done.model, &done.tries);
    for _ in 0..MAX_FURTHER_MODELS {
        let Some(further) = further_model(input, &graph, &done.model, &taken, options)? else { break };
        for (i, taken) in taken.iter_mut().enumerate() {
            *taken |= further.model.is_oriented(scene::ImageId::new(i));
        }
        models.push(reconstruction(&further.model, further.scale));
        done.model.cameras.clone_from(&further.model.cameras);
    }
    models[1..].sort_by_key(|m| std::cmp::Reverse(m.oriented_images().count()));
    let left_out = (0..input.images.len())
        .filter(|&i| !taken[i])
        .map(|i| LeftOut { image: scene::ImageId::new(i), reason: left_out_reasons[i].clone() })
        .collect();
    Ok(Orientation { models, summary: OrientSummary { adjustment: done.adjustment, left_out, baselines, scale_bars, notes } })
}

struct Done<'a> {
    model: Model<'a>,
    tries: Tries,
    adjustment: AdjustSummary,
    scale: Scale,
}

fn cameras(input: &MapInput) -> Vec<scene::Camera> {
    input.cameras.iter().map(|c| c.camera).collect()
}

fn first_model<'a>(
    input: &'a MapInput,
    graph: &'a CorrespondenceGraph,
    options: &OrientOptions,
    notes: &mut Vec<String>,
) -> Result<Done<'a>, MapError> {
    if let Some(cam_from_rig) = known_rig(input) {
        let layout = Layout::rigid(input, &cam_from_rig);
        let empty = Model::new(input, graph, cameras(input), layout.rigs, layout.frames, layout.images);
        let allowed = vec![true; empty.frames.len()];
        if let Some((mut model, tries)) = best_model(&empty, &from_exposures(&empty, &allowed, options), &allowed, options)? {
            let lengths = Lengths::of(&model);
            let adjustment = finish(&mut model, (!lengths.is_empty()).then_some(&lengths), options)?;
            return Ok(Done { model, tries, adjustment, scale: Scale::Metric });
        }
        notes
            .push("no exposure has enough matches between its cameras: images were oriented one by one, and then joined by the rig".into());
    }
    let layout = Layout::independent(input);
    let empty = Model::new(input, graph, cameras(input), layout.rigs, layout.frames, layout.images);
    let allowed = vec![true; empty.frames.len()];
    let starts = from_pairs(&empty, &allowed, options);
    let none = MapError::NoInitialPair { candidates: starts.tried, best_inliers: starts.best_inliers, needed: options.initial_min_inliers };
    let (mut model, tries) = best_model(&empty, &starts, &allowed, options)?.ok_or(none)?;
    if input.rig.mode == RigMode::Rigid && input.cameras.len() > 1 {
        finish(&mut model, None, options)?;
        match solve_rig(&model) {
            Ok(solved) => {
                let (rig, scale) = scaled_rig(input, solved);
                model = with_rig(&model, &rig);
                if let Some(scale) = scale {
                    rescale(&mut model, scale);
                    for (sensor, pose) in
                        model.rigs[0].sensors.iter_mut().zip(known_rig(input).unwrap_or(rig.iter().map(|p| scaled(p, scale)).collect()))
                    {
                        sensor.cam_from_rig = pose;
                    }
                }
            }
            Err(missing) => notes.push(format!(
                "cameras {} are never oriented together with camera 0: the rig stays unknown and images keep poses of their own",
                missing.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
            )),
        }
    }
    finish_metric(model, tries, options)
}

fn scaled(pose: &Rigid3, scale: f64) -> Rigid3 {
    Rigid3::new(pose.rotation, pose.translation * scale)
}

/// The rig to use, in units of the model, and metres in one of these units where the input knows poses in the rig.
fn scaled_rig(input: &MapInput, solved: Vec<Rigid3>) -> (Vec<Rigid3>, Option<f64>) {
    let Some(known) = known_rig(input) else { return (solved, None) };
    let length = |poses: &[Rigid3]| poses.iter().map(|p| p.translation.norm()).sum::<f64>();
    let scale = length(&known) / length(&solved);
    if scale.is_finite() && scale > 0.0 { (solved, Some(scale)) } else { (solved, None) }
}

/// Brings a model to metres where lengths are known, and adjusts it for the last time.
fn finish_metric<'a>(mut model: Model<'a>, tries: Tries, options: &OrientOptions) -> Result<Done<'a>, MapError> {
    let known_metric = model.rigs.len() == 1 && known_rig(model.input).is_some() && model.cameras.len() > 1;
    let mut scale = if known_metric { Scale::Metric } else { Scale::Arbitrary };
    let lengths = Lengths::of(&model);
    if scale == Scale::Arbitrary
        && let Some(factor) = lengths.scale(&model)
    {
        rescale(&mut model, factor);
        scale = Scale::Metric;
    }
    // Ends of scale bars were placed in the old unit.
    let lengths = Lengths::of(&model);
    let used = (scale == Scale::Metric && !lengths.is_empty()).then_some(&lengths);
    let adjustment = finish(&mut model, used, options)?;
    Ok(Done { model, tries, adjustment, scale })
}

/// Another model from the images that are in none yet.
fn further_model<'a>(
    input: &'a MapInput,
    graph: &'a CorrespondenceGraph,
    first: &Model,
    taken: &[bool],
    options: &OrientOptions,
) -> Result<Option<Done<'a>>, MapError> {
    let layout = Layout::independent(input);
    // Interior orientation that the first model found is the best that is known.
    let empty = Model::new(input, graph, first.cameras.clone(), layout.rigs, layout.frames, layout.images);
    let allowed: Vec<bool> = taken.iter().map(|t| !t).collect();
    if allowed.iter().filter(|a| **a).count() < options.min_model_frames {
        return Ok(None);
    }
    let starts = from_pairs(&empty, &allowed, options);
    let Some((model, tries)) = best_model(&empty, &starts, &allowed, options)? else { return Ok(None) };
    let done = finish_metric(model, tries, options)?;
    Ok((done.model.oriented_frames().len() >= options.min_model_frames).then_some(done))
}

/// Why each image of the first model has no pose.
fn reasons(model: &Model, tries: &Tries) -> Vec<String> {
    (0..model.images.len())
        .map(|i| {
            let image = scene::ImageId::new(i);
            // A rig that was solved for has other frames than the attempt had.
            let outcome = tries.get(model.images[i].frame.index()).and_then(|(_, outcome)| *outcome);
            let visible = model.visibility(image).count();
            match outcome {
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

impl MapInput {
    /// Refuses input that contradicts itself.
    fn check(&self) -> Result<(), MapError> {
        let bad = |what: String| Err(MapError::Inconsistent(what));
        if self.keypoints.len() != self.images.len() {
            return bad(format!("{} images, but keypoints of {}", self.images.len(), self.keypoints.len()));
        }
        let mut seen = std::collections::BTreeSet::new();
        for image in &self.images {
            if image.camera.index() >= self.cameras.len() {
                return bad(format!("image {} was taken by camera {}, which does not exist", image.name, image.camera));
            }
            if self.rig.mode != RigMode::None && !seen.insert((image.camera, image.exposure)) {
                return bad(format!("image {} is the second of camera {} in exposure {}", image.name, image.camera, image.exposure));
            }
        }
        for pair in &self.pairs {
            let (a, b) = (pair.images.0.index(), pair.images.1.index());
            if a == b || a >= self.images.len() || b >= self.images.len() {
                return bad(format!("a pair of images {a} and {b}"));
            }
            let (na, nb) = (self.keypoints[a].len(), self.keypoints[b].len());
            if pair.matches.iter().any(|(ka, kb)| ka.index() >= na || kb.index() >= nb) {
                return bad(format!("a match between images {a} and {b} names a keypoint that does not exist"));
            }
        }
        for keypoints in &self.keypoints {
            if keypoints.iter().any(|k| !Vector2::from(*k).iter().all(|v| v.is_finite())) {
                return bad("a keypoint is not a number".into());
            }
        }
        for baseline in &self.rig.baselines {
            if baseline.cameras.0.index().max(baseline.cameras.1.index()) >= self.cameras.len() || baseline.cameras.0 == baseline.cameras.1
            {
                return bad(format!("a baseline between cameras {} and {}", baseline.cameras.0, baseline.cameras.1));
            }
        }
        for pick in self.scale_bars.iter().flat_map(|bar| bar.ends.iter().flatten()) {
            if pick.image.index() >= self.images.len() {
                return bad(format!("a scale bar is picked in image {}, which does not exist", pick.image));
            }
        }
        Ok(())
    }
}
