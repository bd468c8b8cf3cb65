//! Positions of the frames of a view graph.

use super::graph::ViewGraph;
use crate::model::Model;
use nalgebra::Vector3;
use scene::{Observation, Rigid3};
use solve::averaging::{Bearing, PositioningOptions, position};

/// Frames with their poses, and the points that gave them.
pub(super) struct Placed {
    /// `rig_from_world` of each frame of the graph.
    pub poses: Vec<Rigid3>,
    pub points: Vec<(Vector3<f64>, Vec<Observation>)>,
}

/// Positions from the directions of tracks; `metric` uses the arms of the cameras in the rig, whose scale is the world's then.
pub(super) fn place(model: &Model, graph: &ViewGraph, tracks: &[Vec<Observation>], metric: bool, seed: u64) -> Option<Placed> {
    let mut bearings = Vec::new();
    for (point, track) in tracks.iter().enumerate() {
        for &o in track {
            let Some(node) = graph.place[model.images[o.image.index()].frame.index()] else { continue };
            let cam_from_rig = model.cam_from_rig(o.image);
            let Some(ray) = model.camera(o.image).ray(&model.pixel(o)) else { continue };
            let world_from_rig = graph.rotations[node].inverse();
            let offset = if metric { world_from_rig * cam_from_rig.centre() } else { Vector3::zeros() };
            let direction = world_from_rig * (cam_from_rig.rotation.inverse() * ray);
            bearings.push(Bearing { node: node as u32, point: point as u32, direction, offset });
        }
    }
    let options = PositioningOptions { seed, ..PositioningOptions::default() };
    let found = position(graph.frames.len(), tracks.len(), &bearings, &options)?;
    let poses = graph.rotations.iter().zip(&found.nodes).map(|(&r, c)| Rigid3::new(r, -(r * c))).collect();
    Some(Placed { poses, points: found.points.into_iter().zip(tracks.iter().cloned()).collect() })
}
