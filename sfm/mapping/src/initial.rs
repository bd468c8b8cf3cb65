//! Where a model starts: two images, or one exposure of a calibrated rig.

use crate::model::Model;
use crate::options::OrientOptions;
use nalgebra::{Matrix3, Vector2};
use rayon::prelude::*;
use scene::{FrameId, ImageId, PairConfiguration, Rigid3, VerifiedPair};
use solve::ransac::RansacOptions;
use solve::relative::{estimate_essential, pose_from_essential};
use solve::triangulate::{View, triangulate_robust};

/// Pairs looked at closely.
const MAX_PAIRS: usize = 40;
/// Largest distance from the epipolar line, pixels.
const MAX_ERROR_PX: f64 = 4.0;
/// Least intersection angle of a point of a rig's first exposure: rigs are narrow compared with the way of the vehicle.
const MIN_RIG_ANGLE_DEG: f64 = 0.5;

/// A possible start.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    /// Poses of the frames to begin with.
    pub poses: Vec<(FrameId, Rigid3)>,
    /// Good points.
    pub inliers: usize,
    /// Median intersection angle.
    pub angle_rad: f64,
    score: f64,
}

/// Possible starts, the best first, and the largest number of inliers of any pair.
pub(crate) struct Starts {
    pub ranked: Vec<Start>,
    pub tried: usize,
    pub best_inliers: usize,
}

/// Starts from two images by their relative pose.
///
/// Many inliers, a wide angle (up to the wished one) and a scene that no homography explains are good; images that are
/// matched with many others come first where these are equal.
pub(crate) fn from_pairs(model: &Model, allowed: &[bool], options: &OrientOptions) -> Starts {
    let mut pairs: Vec<&VerifiedPair> = model.input.pairs.iter().filter(|p| is_allowed(model, p, allowed)).collect();
    let promise = |p: &VerifiedPair| p.matches.len() as f64 * (1.2 - planarity(p));
    pairs.sort_by(|a, b| promise(b).total_cmp(&promise(a)).then(a.images.cmp(&b.images)));
    // Neighbours in time have most matches and the narrowest angles: look at the widely spaced ones as well.
    let step = (pairs.len() / MAX_PAIRS).max(1);
    let pairs: Vec<&VerifiedPair> = pairs.iter().step_by(step).take(MAX_PAIRS).copied().collect();
    let starts: Vec<Option<Start>> = pairs.par_iter().map(|pair| relative_start(model, pair, options)).collect();
    let best_inliers = starts.iter().flatten().map(|s| s.inliers).max().unwrap_or(0);
    let mut ranked: Vec<Start> = starts.into_iter().flatten().filter(|s| s.inliers >= options.initial_min_inliers).collect();
    ranked.sort_by(|a, b| b.score.total_cmp(&a.score));
    Starts { ranked, tried: pairs.len(), best_inliers }
}

fn is_allowed(model: &Model, pair: &VerifiedPair, allowed: &[bool]) -> bool {
    let frame = |i: ImageId| model.images[i.index()].frame;
    let (a, b) = (frame(pair.images.0), frame(pair.images.1));
    a != b && allowed[a.index()] && allowed[b.index()] && !matches!(pair.configuration, PairConfiguration::PlanarOrPanoramic { .. })
}

fn planarity(pair: &VerifiedPair) -> f64 {
    (pair.homography_inliers as f64 / pair.matches.len().max(1) as f64).min(1.0)
}

fn relative_start(model: &Model, pair: &VerifiedPair, options: &OrientOptions) -> Option<Start> {
    let (a, b) = pair.images;
    let (camera_a, camera_b) = (model.camera(a), model.camera(b));
    let mut pixels = Vec::with_capacity(pair.matches.len());
    let (mut xa, mut xb): (Vec<Vector2<f64>>, Vec<Vector2<f64>>) = (Vec::new(), Vec::new());
    for &(ka, kb) in &pair.matches {
        let pa = model.pixel(scene::Observation { image: a, keypoint: ka });
        let pb = model.pixel(scene::Observation { image: b, keypoint: kb });
        if let (Some(ua), Some(ub)) = (camera_a.unproject(&pa), camera_b.unproject(&pb)) {
            pixels.push((pa, pb));
            xa.push(ua);
            xb.push(ub);
        }
    }
    let max_error = MAX_ERROR_PX / ((camera_a.mean_focal() + camera_b.mean_focal()) / 2.0);
    let ransac = RansacOptions {
        max_error,
        confidence: 0.9999,
        min_iterations: 100,
        max_iterations: 2000,
        seed: options.seed ^ (u64::from(a.0) << 32 | u64::from(b.0)),
    };
    let estimate = estimate_essential(&xa, &xb, &ransac)?;
    let select = |x: &[Vector2<f64>]| estimate.inliers.iter().map(|&i| x[i]).collect::<Vec<_>>();
    let essential: Matrix3<f64> = estimate.model;
    let pose = pose_from_essential(&essential, &select(&xa), &select(&xb))?;
    let from_a = Rigid3::identity();
    let from_b = pose.cam2_from_cam1;
    let mut angles: Vec<f64> = Vec::new();
    for &i in &estimate.inliers {
        let views = (View::new(*camera_a, &from_a, pixels[i].0), View::new(*camera_b, &from_b, pixels[i].1));
        let (Some(view_a), Some(view_b)) = views else { continue };
        let views = [view_a, view_b];
        if let Some((xyz, inliers)) = triangulate_robust(&views, MAX_ERROR_PX, options.min_angle_deg.to_radians())
            && inliers.iter().all(|&x| x)
        {
            angles.push(solve::triangulate::triangulation_angle(&from_a.centre(), &from_b.centre(), &xyz));
        }
    }
    let inliers = angles.len();
    angles.sort_by(f64::total_cmp);
    let angle_rad = *angles.get(inliers / 2)?;
    let width = (angle_rad / options.initial_min_angle_deg.to_radians()).min(1.0);
    // Motion along the optical axis leaves depth weak in the middle of the image (COLMAP refuses above 0.95).
    let forward = if from_b.translation.z.abs() > 0.95 * from_b.translation.norm() { 0.1 } else { 1.0 };
    let links = (model.graph.link_count(a) + model.graph.link_count(b)) as f64;
    let score = inliers as f64 * width * width * (1.2 - planarity(pair)) * forward * links.sqrt();
    let frame = |i: ImageId| model.images[i.index()].frame;
    // The rig of a frame stands where its camera does, moved back through the rig.
    let poses = vec![(frame(a), model.cam_from_rig(a).inverse() * from_a), (frame(b), model.cam_from_rig(b).inverse() * from_b)];
    Some(Start { poses, inliers, angle_rad, score })
}

/// Starts from one exposure whose cameras' poses in the rig are known: the scale is the rig's.
pub(crate) fn from_exposures(model: &Model, allowed: &[bool], options: &OrientOptions) -> Starts {
    let within: Vec<&VerifiedPair> = model
        .input
        .pairs
        .iter()
        .filter(|p| {
            let frame = model.images[p.images.0.index()].frame;
            frame == model.images[p.images.1.index()].frame && allowed[frame.index()]
        })
        .collect();
    let mut good = vec![(0usize, 0f64); model.frames.len()];
    for pair in &within {
        let (a, b) = pair.images;
        let (from_a, from_b) = (model.cam_from_rig(a), model.cam_from_rig(b));
        for &(ka, kb) in &pair.matches {
            let view = |image: ImageId, keypoint, pose: &Rigid3| {
                View::new(*model.camera(image), pose, model.pixel(scene::Observation { image, keypoint }))
            };
            let (Some(view_a), Some(view_b)) = (view(a, ka, &from_a), view(b, kb, &from_b)) else { continue };
            let views = [view_a, view_b];
            if let Some((xyz, inliers)) = triangulate_robust(&views, options.max_error_px, MIN_RIG_ANGLE_DEG.to_radians())
                && inliers.iter().all(|&x| x)
            {
                let slot = &mut good[model.images[a.index()].frame.index()];
                slot.0 += 1;
                slot.1 += solve::triangulate::triangulation_angle(&from_a.centre(), &from_b.centre(), &xyz);
            }
        }
    }
    let best_inliers = good.iter().map(|g| g.0).max().unwrap_or(0);
    let mut ranked: Vec<Start> = good
        .iter()
        .enumerate()
        .filter(|(_, (count, _))| *count >= options.initial_min_inliers.min(50))
        .map(|(f, &(inliers, angles))| {
            let links: usize = model.frame_images[f].iter().map(|&i| model.graph.link_count(i)).sum();
            Start {
                poses: vec![(FrameId::new(f), Rigid3::identity())],
                inliers,
                angle_rad: angles / inliers as f64,
                score: inliers as f64 * (links as f64).sqrt(),
            }
        })
        .collect();
    ranked.sort_by(|a, b| b.score.total_cmp(&a.score));
    Starts { ranked, tried: within.len(), best_inliers }
}
