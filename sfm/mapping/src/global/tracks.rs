//! Tracks of the pairs that agree, and the few of them that place the frames.

use super::graph::ViewGraph;
use crate::model::Model;
use scene::{ImageId, KeypointIndex, Observation};

/// Tracks that a frame should have a part in.
const WANTED_FRAME_TRACKS: usize = 200;
/// Frames with fewer cannot be placed.
pub(super) const MIN_FRAME_TRACKS: usize = 15;
/// Images that a track should be seen in: with two, its place says nothing about theirs.
const MIN_LENGTH: usize = 3;

/// Tracks, observations sorted: the longest first as long as a frame that they touch wants more.
pub(super) fn tracks(model: &Model, graph: &ViewGraph) -> Vec<Vec<Observation>> {
    let mut all = connected(model, graph);
    all.retain(|track| track.len() >= MIN_LENGTH);
    all.sort_by(|a, b| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
    let mut count = vec![0usize; graph.frames.len()];
    all.retain(|track| {
        let places: Vec<usize> = track.iter().filter_map(|o| graph.place[model.images[o.image.index()].frame.index()]).collect();
        let wanted = places.iter().any(|&p| count[p] < WANTED_FRAME_TRACKS);
        if wanted {
            places.iter().for_each(|&p| count[p] += 1);
        }
        wanted
    });
    all
}

/// Connected keypoints; those that show a point twice in an image are left out.
fn connected(model: &Model, graph: &ViewGraph) -> Vec<Vec<Observation>> {
    let mut first = vec![0u32];
    for keypoints in &model.input.keypoints {
        first.push(first[first.len() - 1] + keypoints.len() as u32);
    }
    let mut parent: Vec<u32> = (0..first[first.len() - 1]).collect();
    for pair in graph.pairs.iter().map(|&i| &model.input.pairs[i]) {
        let [start_a, start_b] = [pair.images.0, pair.images.1].map(|i| first[i.index()]);
        for &(ka, kb) in &pair.matches {
            let (a, b) = (root(&mut parent, start_a + ka.0), root(&mut parent, start_b + kb.0));
            // The smaller is the root: it does not depend on the order of the pairs.
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut index_of = vec![u32::MAX; parent.len()];
    let mut found: Vec<Vec<Observation>> = Vec::new();
    for image in 0..model.images.len() {
        for keypoint in 0..model.input.keypoints[image].len() {
            let node = first[image] + keypoint as u32;
            let top = root(&mut parent, node) as usize;
            let o = Observation { image: ImageId::new(image), keypoint: KeypointIndex::new(keypoint) };
            if index_of[top] == u32::MAX {
                index_of[top] = found.len() as u32;
                found.push(Vec::new());
            }
            found[index_of[top] as usize].push(o);
        }
    }
    found.retain(|track| track.len() > 1 && track.windows(2).all(|w| w[0].image != w[1].image));
    found
}

fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
