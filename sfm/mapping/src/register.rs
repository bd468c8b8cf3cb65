//! The pose of a new frame from the points that it sees.

use crate::model::Model;
use crate::options::OrientOptions;
use scene::{FrameId, Observation, PointId};
use solve::absolute::{Correspondence, Sensor, estimate_absolute_pose};
use solve::ransac::RansacOptions;

/// What came of trying to register a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Registration {
    Done,
    /// Inliers found among so many correspondences.
    Failed {
        inliers: usize,
        correspondences: usize,
    },
}

/// Frames that are not oriented and see enough of the model, the best first.
pub(crate) fn candidates(model: &Model, allowed: &[bool], options: &OrientOptions) -> Vec<FrameId> {
    let mut ranked: Vec<(u64, FrameId)> = (0..model.frames.len())
        .map(FrameId::new)
        .filter(|f| allowed[f.index()] && model.frames[f.index()].rig_from_world.is_none())
        .filter_map(|f| {
            let images = &model.frame_images[f.index()];
            let count: usize = images.iter().map(|&i| model.visibility(i).count()).sum();
            let score = images.iter().map(|&i| model.visibility(i).score()).sum();
            (count >= options.register_min_inliers).then_some((score, f))
        })
        .collect();
    ranked.sort_by_key(|&(score, frame)| (std::cmp::Reverse(score), frame));
    ranked.into_iter().map(|(_, frame)| frame).collect()
}

/// Orients a frame by P3P and LO-RANSAC over all its images, and adds the inliers to their points.
pub(crate) fn register_frame(model: &mut Model, frame: FrameId, options: &OrientOptions) -> Registration {
    let images = model.frame_images[frame.index()].clone();
    let sensors: Vec<Sensor> = images.iter().map(|&i| Sensor { camera: *model.camera(i), cam_from_rig: model.cam_from_rig(i) }).collect();
    let mut found: Vec<(Observation, PointId)> = Vec::new();
    let mut correspondences = Vec::new();
    for (sensor, &image) in images.iter().enumerate() {
        for o in model.keypoints_of(image) {
            let start = found.len();
            for id in model.graph.of(o).iter().filter_map(|&link| model.point_of(link)) {
                if let Some(point) = model.point(id)
                    && !found[start..].contains(&(o, id))
                {
                    found.push((o, id));
                    correspondences.push(Correspondence { sensor, pixel: model.pixel(o), x_in_world: point.xyz });
                }
            }
        }
    }
    let ransac = RansacOptions {
        max_error: options.register_max_error_px,
        confidence: 0.9999,
        min_iterations: 50,
        max_iterations: 5000,
        // Every frame has draws of its own, the same ones in whatever order frames come.
        seed: options.seed ^ (u64::from(frame.0) << 20),
    };
    let failed = |inliers| Registration::Failed { inliers, correspondences: correspondences.len() };
    let Some(estimate) = estimate_absolute_pose(&sensors, &correspondences, &ransac) else { return failed(0) };
    let inliers = estimate.inliers.len();
    if inliers < options.register_min_inliers || (inliers as f64) < options.register_min_inlier_share * correspondences.len() as f64 {
        return failed(inliers);
    }
    model.frames[frame.index()].rig_from_world = Some(estimate.model);
    for &i in &estimate.inliers {
        let (o, id) = found[i];
        if model.point_of(o).is_none() && model.point(id).is_some_and(|p| !p.sees(o.image)) {
            model.add_observation(id, o);
        }
    }
    Registration::Done
}
