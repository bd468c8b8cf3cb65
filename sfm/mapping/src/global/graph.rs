//! The view graph of frames: which pairs of images agree about the rotations.

use crate::model::Model;
use nalgebra::{UnitQuaternion, Vector2};
use rayon::prelude::*;
use scene::{FrameId, ImageId, Observation, PairConfiguration, VerifiedPair};
use solve::averaging::{AveragingOptions, RelativeRotation, average_rotations, components};
use solve::relative::pose_from_essential;

/// Matches of a pair that decide between the poses of its essential matrix.
const MAX_TESTED: usize = 200;
/// Pairs that deviate by more from the averaged rotations are wrong.
const MAX_DEVIATION_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Times that wrong pairs are looked for.
const ROUNDS: usize = 3;

/// Frames with rotations that the pairs agree on.
pub(super) struct ViewGraph {
    /// The frames, ascending.
    pub frames: Vec<FrameId>,
    /// `rig_from_world` of each.
    pub rotations: Vec<UnitQuaternion<f64>>,
    /// Pairs that agree, between these frames or inside one, by their position in the input.
    pub pairs: Vec<usize>,
    /// Position in `frames` of each frame of the model.
    pub place: Vec<Option<usize>>,
}

struct Edge {
    pair: usize,
    frames: (usize, usize),
    b_from_a: UnitQuaternion<f64>,
    weight: f64,
}

impl ViewGraph {
    /// The largest connected part, rotations averaged and wrong pairs dropped; `None` where there is no pair, or the average fails.
    pub fn new(model: &Model, allowed: &[bool]) -> Option<Self> {
        let all: Vec<Option<Edge>> =
            model.input.pairs.par_iter().enumerate().map(|(i, pair)| relative_rotation(model, i, pair, allowed)).collect();
        let mut edges: Vec<Edge> = all.into_iter().flatten().collect();
        // Sums run in an order that does not depend on that of the pairs.
        edges.sort_by_key(|e| model.input.pairs[e.pair].images);
        let (mut frames, mut rotations) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let largest = components(model.frames.len(), edges.iter().map(|e| e.frames)).swap_remove(0);
            let mut place = vec![None; model.frames.len()];
            largest.iter().enumerate().for_each(|(i, &f)| place[f] = Some(i));
            edges.retain(|e| place[e.frames.0].is_some() && place[e.frames.1].is_some());
            let relative =
                |e: &Edge| Some(RelativeRotation { a: place[e.frames.0]?, b: place[e.frames.1]?, b_from_a: e.b_from_a, weight: e.weight });
            let relative: Vec<RelativeRotation> = edges.iter().filter_map(relative).collect();
            let averaged = average_rotations(largest.len(), &relative, &AveragingOptions::default()).ok()?;
            (frames, rotations) = (largest, averaged.rotations);
            let before = edges.len();
            let mut residuals = averaged.residuals_rad.iter();
            edges.retain(|_| residuals.next().is_some_and(|r| *r <= MAX_DEVIATION_RAD));
            if edges.len() == before {
                break;
            }
        }
        if edges.is_empty() {
            return None;
        }
        let mut place = vec![None; model.frames.len()];
        frames.iter().enumerate().for_each(|(i, &f)| place[f] = Some(i));
        let frame = |i: ImageId| model.images[i.index()].frame.index();
        let inside = |pair: &VerifiedPair| {
            let (a, b) = (frame(pair.images.0), frame(pair.images.1));
            a == b && place[a].is_some()
        };
        let mut pairs: Vec<usize> = edges.iter().map(|e| e.pair).collect();
        pairs.extend(model.input.pairs.iter().enumerate().filter(|(_, p)| inside(p)).map(|(i, _)| i));
        pairs.sort_unstable();
        Some(Self { frames: frames.into_iter().map(FrameId::new).collect(), rotations, pairs, place })
    }
}

/// Rotation between the frames of a pair of images with an essential matrix.
fn relative_rotation(model: &Model, index: usize, pair: &VerifiedPair, allowed: &[bool]) -> Option<Edge> {
    let PairConfiguration::Calibrated { essential } = &pair.configuration else { return None };
    let (a, b) = pair.images;
    let frames = (model.images[a.index()].frame.index(), model.images[b.index()].frame.index());
    if frames.0 == frames.1 || !allowed[frames.0] || !allowed[frames.1] {
        return None;
    }
    let step = (pair.matches.len() / MAX_TESTED).max(1);
    let ray = |image: ImageId, keypoint| model.camera(image).unproject(&model.pixel(Observation { image, keypoint }));
    let rays = pair.matches.iter().step_by(step).filter_map(|&(ka, kb)| Some((ray(a, ka)?, ray(b, kb)?)));
    let (xa, xb): (Vec<Vector2<f64>>, Vec<Vector2<f64>>) = rays.unzip();
    let pose = pose_from_essential(essential, &xa, &xb)?;
    let cam_from_rig = |i: ImageId| model.cam_from_rig(i).rotation;
    let b_from_a = cam_from_rig(b).inverse() * pose.cam2_from_cam1.rotation * cam_from_rig(a);
    Some(Edge { pair: index, frames, b_from_a, weight: pair.matches.len() as f64 })
}
