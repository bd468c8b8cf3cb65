//! Matches whose keypoints turn alike from one image to the other.
//!
//! All of a pair's right matches turn by about the rotation of the camera about its axis, wrong ones by anything. A cheap way to raise the
//! share of inliers before RANSAC, and to see that a pair has nothing in common.

use scene::{Features, KeypointIndex};
use std::f32::consts::TAU;

const BINS: usize = 36;
/// Width of the window: 60 degrees. The perspective of a tilt of 45 degrees turns directions by up to 10, SIFT's own error is about 10.
const WINDOW: usize = 6;

/// Positions in `tentative` of the matches in the window of rotations that holds most, rising.
pub(super) fn coherent(a: &Features, b: &Features, tentative: &[(KeypointIndex, KeypointIndex)]) -> Vec<usize> {
    let bins: Vec<usize> = tentative
        .iter()
        .map(|&(i, j)| {
            let turn = (b.keypoints[j.index()].orientation - a.keypoints[i.index()].orientation) / TAU;
            // What is not a number becomes 0.
            ((turn - turn.floor()) * BINS as f32) as usize % BINS
        })
        .collect();
    let mut counts = [0; BINS];
    for &bin in &bins {
        counts[bin] += 1;
    }
    let inside = |start: usize| (0..WINDOW).map(|k| counts[(start + k) % BINS]).sum::<usize>();
    let mut best = 0;
    for start in 1..BINS {
        if inside(start) > inside(best) {
            best = start;
        }
    }
    (0..bins.len()).filter(|&i| (bins[i] + BINS - best) % BINS < WINDOW).collect()
}
