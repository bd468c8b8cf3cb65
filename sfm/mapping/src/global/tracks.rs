//! Tracks of the pairs that agree, and the few of them that place the frames.

use super::graph::ViewGraph;
use crate::model::Model;
use scene::{ImageId, Observation};
use solve::averaging::components;

/// Tracks that a frame should have a part in.
const WANTED_FRAME_TRACKS: usize = 200;
/// Frames with fewer cannot be placed.
pub(super) const MIN_FRAME_TRACKS: usize = 15;
/// Images that a track should be seen in: with two, its place says nothing about theirs.
const MIN_LENGTH: usize = 3;

/// Tracks, observations sorted: the longest first as long as a frame that they touch wants more. Those that show a point twice in an image
/// are left out.
pub(super) fn tracks(model: &Model, graph: &ViewGraph) -> Vec<Vec<Observation>> {
    let keypoints: Vec<Observation> = (0..model.images.len()).map(ImageId::new).flat_map(|image| model.keypoints_of(image)).collect();
    let mut first = vec![0];
    for keypoints in &model.input.keypoints {
        first.push(first[first.len() - 1] + keypoints.len());
    }
    let matches = graph.pairs.iter().map(|&i| &model.input.pairs[i]).flat_map(|pair| {
        let [a, b] = [pair.images.0, pair.images.1].map(|i| first[i.index()]);
        pair.matches.iter().map(move |(ka, kb)| (a + ka.index(), b + kb.index()))
    });
    let mut count = vec![0usize; graph.frames.len()];
    let mut tracks = Vec::new();
    for connected in components(keypoints.len(), matches).into_iter().take_while(|c| c.len() >= MIN_LENGTH) {
        let track: Vec<Observation> = connected.into_iter().map(|k| keypoints[k]).collect();
        if track.windows(2).any(|w| w[0].image == w[1].image) {
            continue;
        }
        let places: Vec<usize> = track.iter().filter_map(|o| graph.place[model.images[o.image.index()].frame.index()]).collect();
        if places.iter().any(|&p| count[p] < WANTED_FRAME_TRACKS) {
            places.iter().for_each(|&p| count[p] += 1);
            tracks.push(track);
        }
    }
    tracks
}
