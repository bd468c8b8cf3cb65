//! From keypoints in oriented images to points: continue, create, complete and merge tracks.

use crate::model::Model;
use crate::options::OrientOptions;
use nalgebra::Vector3;
use scene::{FrameId, ImageId, Observation, PointId};
use solve::triangulate::{View, triangulate_robust};
use std::collections::BTreeSet;

/// Steps from keypoint to keypoint along matches when a track is completed.
const COMPLETE_STEPS: usize = 5;

/// Gives every free keypoint of a frame to a point, or makes a new one. Returns the number of observations added.
pub(crate) fn triangulate_frame(model: &mut Model, frame: FrameId, options: &OrientOptions) -> usize {
    let before = model.observation_count();
    for image in model.frame_images[frame.index()].clone() {
        for o in model.keypoints_of(image) {
            if model.point_of(o).is_none() && !continue_track(model, o, options) {
                create_tracks(model, o, options);
            }
        }
    }
    model.observation_count().saturating_sub(before)
}

/// Adds a free keypoint to the point that it was matched with and fits best.
fn continue_track(model: &mut Model, o: Observation, options: &OrientOptions) -> bool {
    let mut best: Option<(f64, PointId)> = None;
    for &link in model.graph.of(o) {
        let Some(id) = model.point_of(link) else { continue };
        let Some(point) = model.point(id) else { continue };
        if point.sees(o.image) {
            continue;
        }
        if let Some(error) = model.reprojection_error(&point.xyz, o)
            && model.is_inlier(o, error, options.max_error_px)
            && best.is_none_or(|(least, _)| error < least)
        {
            best = Some((error, id));
        }
    }
    best.is_some_and(|(_, id)| {
        model.add_observation(id, o);
        true
    })
}

/// Makes points from a free keypoint and the free keypoints in oriented images that it was matched with.
fn create_tracks(model: &mut Model, o: Observation, options: &OrientOptions) {
    let mut candidates = vec![o];
    for &link in model.graph.of(o) {
        let fresh = model.point_of(link).is_none() && candidates.iter().all(|c| c.image != link.image);
        if fresh && model.is_oriented(link.image) {
            candidates.push(link);
        }
    }
    while candidates.len() >= 2 {
        let views: Vec<View> = candidates.iter().filter_map(|&c| view(model, c)).collect();
        if views.len() != candidates.len() {
            return;
        }
        let Some((xyz, inliers)) = triangulate_robust(&views, options.max_error_px, options.min_angle_deg.to_radians()) else { return };
        let track: Vec<Observation> = candidates.iter().zip(&inliers).filter(|&(_, &inlier)| inlier).map(|(&c, _)| c).collect();
        if track.len() < 2 {
            return;
        }
        model.add_point(xyz, &track);
        // What did not fit may show another point: wrong matches often come in groups.
        let mut rest = inliers.iter().map(|&inlier| !inlier);
        candidates.retain(|_| rest.next().unwrap_or(false));
        if candidates.len() < 3 {
            return;
        }
    }
}

pub(crate) fn view(model: &Model, o: Observation) -> Option<View> {
    View::new(*model.camera(o.image), &model.cam_from_world(o.image)?, model.pixel(o))
}

/// Adds to each point the free keypoints that are matched, directly or over others, with its observations and fit.
/// Returns the number added.
pub(crate) fn complete_tracks(model: &mut Model, options: &OrientOptions) -> usize {
    let before = model.observation_count();
    for slot in 0..model.point_slots() {
        let id = PointId::new(slot);
        let Some(point) = model.point(id) else { continue };
        let xyz = point.xyz;
        let mut front = point.track.clone();
        for _ in 0..COMPLETE_STEPS {
            let mut added = Vec::new();
            for &o in &front {
                let graph = model.graph;
                for &link in graph.of(o) {
                    if model.point_of(link).is_none()
                        && model.point(id).is_some_and(|p| !p.sees(link.image))
                        && model.reprojection_error(&xyz, link).is_some_and(|e| model.is_inlier(link, e, options.max_error_px))
                    {
                        model.add_observation(id, link);
                        added.push(link);
                    }
                }
            }
            if added.is_empty() {
                break;
            }
            front = added;
        }
    }
    model.observation_count() - before
}

/// Joins points whose observations are matched with each other, where one position fits all. Returns the number of
/// observations in joined points.
pub(crate) fn merge_tracks(model: &mut Model, options: &OrientOptions) -> usize {
    let mut tried = BTreeSet::new();
    let mut merged = 0;
    // Joined points get new ids at the end of the list, and are visited in their turn.
    let mut slot = 0;
    while slot < model.point_slots() {
        let id = PointId::new(slot);
        slot += 1;
        let Some(partner) = merge_partner(model, id, options, &mut tried) else { continue };
        let (Some(a), Some(b)) = (model.remove_point(id), model.remove_point(partner.id)) else { continue };
        let mut track = partner.track;
        track.sort_unstable();
        merged += a.track.len().min(b.track.len());
        model.add_point(partner.xyz, &track);
    }
    merged
}

struct Partner {
    id: PointId,
    xyz: Vector3<f64>,
    track: Vec<Observation>,
}

fn merge_partner(model: &Model, id: PointId, options: &OrientOptions, tried: &mut BTreeSet<(PointId, PointId)>) -> Option<Partner> {
    let point = model.point(id)?;
    for &o in &point.track {
        for &link in model.graph.of(o) {
            let Some(other_id) = model.point_of(link) else { continue };
            if other_id == id || !tried.insert((id.min(other_id), id.max(other_id))) {
                continue;
            }
            let Some(other) = model.point(other_id) else { continue };
            let (n, m) = (point.track.len() as f64, other.track.len() as f64);
            let xyz = (point.xyz * n + other.xyz * m) / (n + m);
            if let Some(track) = joined_track(model, &xyz, &point.track, &other.track, options.max_error_px) {
                return Some(Partner { id: other_id, xyz, track });
            }
        }
    }
    None
}

/// Both tracks as one, the better observation where both see an image; `None` when one does not fit.
fn joined_track(model: &Model, xyz: &Vector3<f64>, a: &[Observation], b: &[Observation], max_error_px: f64) -> Option<Vec<Observation>> {
    let mut track: Vec<(Observation, f64)> = Vec::with_capacity(a.len() + b.len());
    for &o in a.iter().chain(b) {
        let error = model.reprojection_error(xyz, o).filter(|&e| model.is_inlier(o, e, max_error_px))?;
        match track.iter_mut().find(|(other, _)| other.image == o.image) {
            Some(known) if known.1 > error => *known = (o, error),
            Some(_) => {}
            None => track.push((o, error)),
        }
    }
    Some(track.into_iter().map(|(o, _)| o).collect())
}

/// Gives every free keypoint of every oriented image another chance. Returns the number of observations added.
pub(crate) fn retriangulate(model: &mut Model, options: &OrientOptions) -> usize {
    model.oriented_frames().into_iter().map(|frame| triangulate_frame(model, frame, options)).sum()
}

/// Points seen by an image.
pub(crate) fn points_in<'m, 'i>(model: &'m Model<'i>, image: ImageId) -> impl Iterator<Item = PointId> + use<'m, 'i> {
    model.keypoints_of(image).filter_map(|o| model.point_of(o))
}
