//! All poses at once: rotations from pairs, positions from directions, then points and adjustment.

mod bearings;
mod graph;
mod tracks;

use crate::adjustment::{Effort, adjust_all};
use crate::error::MapError;
use crate::filter::filter_points;
use crate::incremental::{Tries, grow};
use crate::model::Model;
use crate::options::OrientOptions;
use crate::triangulation::retriangulate;
use bearings::{Placed, place};
use graph::ViewGraph;
use scene::FrameId;
use solve::adjust::Loss;
use tracks::tracks;

/// Largest reprojection errors while the poses settle, as multiples of the last one: directions alone leave many pixels.
const SETTLING: [f64; 3] = [16.0, 6.0, 2.0];
/// Frames of a component that are worth placing at once.
const MIN_FRAMES: usize = 3;

/// The frames of the largest connected part of the view graph, all placed at once; the others that can be are registered after that.
///
/// Rotations are averaged over the verified pairs, and pairs that disagree are dropped; positions of frames and points follow from the
/// directions to the points of the longest tracks, with the arms of a known rig as their scale (Pan, Barath, Pollefeys & Schoenberger,
/// *Global Structure-from-Motion Revisited*, ECCV 2024); then the adjustment takes over, with ever smaller tolerances. `None` where too few
/// pairs have an essential matrix.
pub(crate) fn global_model<'a>(
    empty: &Model<'a>,
    allowed: &[bool],
    metric: bool,
    options: &OrientOptions,
) -> Result<Option<(Model<'a>, Tries)>, MapError> {
    let growing = &options.growing();
    let Some(graph) = ViewGraph::new(empty, allowed) else { return Ok(None) };
    if graph.frames.len() < MIN_FRAMES {
        return Ok(None);
    }
    let tracks = tracks(empty, &graph);
    let Some(placed) = place(empty, &graph, &tracks, metric, options.seed) else { return Ok(None) };
    let mut model = empty.clone();
    put(&mut model, &graph, &placed);
    for factor in SETTLING {
        let tolerant = OrientOptions { max_error_px: factor * growing.max_error_px, ..growing.clone() };
        filter_points(&mut model, &tolerant);
        drop_bare_frames(&mut model);
        let loss = Loss::Cauchy { scale_px: 0.25 * tolerant.max_error_px };
        adjust_all(&mut model, None, Effort { loss, max_iterations: 20, function_tolerance: 1e-4 }, &tolerant)?;
    }
    filter_points(&mut model, growing);
    drop_bare_frames(&mut model);
    if model.oriented_frames().len() < MIN_FRAMES {
        return Ok(None);
    }
    retriangulate(&mut model, growing);
    let tries = grow(&mut model, allowed, usize::MAX, growing)?;
    Ok((!model.oriented_frames().is_empty()).then_some((model, tries)))
}

fn put(model: &mut Model, graph: &ViewGraph, placed: &Placed) {
    for (&frame, pose) in graph.frames.iter().zip(&placed.poses) {
        model.frames[frame.index()].rig_from_world = Some(*pose);
    }
    for (xyz, track) in &placed.points {
        model.add_point(*xyz, track);
    }
}

/// Takes the pose from frames that hold fewer points than a new frame would need.
fn drop_bare_frames(model: &mut Model) {
    for frame in model.oriented_frames() {
        let seen: usize = model.frame_images[frame.index()].iter().map(|&i| model.observations_in(i)).sum();
        if seen < tracks::MIN_FRAME_TRACKS {
            model.unorient(FrameId::new(frame.index()));
        }
    }
}
