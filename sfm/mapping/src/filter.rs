//! Throws out what does not fit.

use crate::model::Model;
use crate::options::OrientOptions;
use scene::{Observation, PointId};
use solve::triangulate::triangulation_angle;

/// Removes observations with too large a reprojection error and points with too small an intersection angle. Returns
/// the number of observations removed.
pub(crate) fn filter_points(model: &mut Model, options: &OrientOptions) -> usize {
    let before = model.observation_count();
    let min_angle = options.min_angle_deg.to_radians();
    let centres: Vec<_> = (0..model.images.len()).map(|i| model.cam_from_world(scene::ImageId::new(i)).map(|p| p.centre())).collect();
    for slot in 0..model.point_slots() {
        let id = PointId::new(slot);
        let Some(point) = model.point(id) else { continue };
        let xyz = point.xyz;
        let bad: Vec<Observation> = point
            .track
            .iter()
            .copied()
            .filter(|&o| model.reprojection_error(&xyz, o).is_none_or(|e| !model.is_inlier(o, e, options.max_error_px)))
            .collect();
        for o in bad {
            model.remove_observation(o);
        }
        let Some(point) = model.point(id) else { continue };
        let wide = point.track.iter().enumerate().any(|(i, a)| {
            point.track[..i].iter().any(|b| match (centres[a.image.index()], centres[b.image.index()]) {
                (Some(ca), Some(cb)) => triangulation_angle(&ca, &cb, &xyz) >= min_angle,
                _ => false,
            })
        });
        if !wide {
            model.remove_point(id);
        }
    }
    before - model.observation_count()
}

/// Takes the pose from frames that hardly see the model any more. Returns their number.
pub(crate) fn filter_frames(model: &mut Model, min_observations: usize) -> usize {
    let mut removed = 0;
    for frame in model.oriented_frames() {
        let seen: usize = model.frame_images[frame.index()].iter().map(|&i| model.observations_in(i)).sum();
        if seen < min_observations {
            model.unorient(frame);
            removed += 1;
        }
    }
    removed
}
