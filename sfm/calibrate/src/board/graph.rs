//! Which candidates are neighbours along an edge of the board.

use super::candidates::Candidate;
use crate::sample::bilinear;
use nalgebra::Vector2;
use scene::Raster;
use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::TAU;

/// How far an edge's direction at a corner may be from that to the neighbour, radians.
const MAX_ANGLE: f64 = 0.4;
/// The longest edge, as a share of the long side.
const MAX_LENGTH: f64 = 0.35;
/// Least difference across an edge half way, standard deviations of the grey values.
const MIN_CONTRAST: f64 = 0.25;

/// Column and row of corners, in a frame of its own, and their place in the list of candidates.
pub(super) type Patch = BTreeMap<(i32, i32), usize>;

/// Steps along edge r, r + 1, r + 2, r + 3 of a corner whose columns grow along edge r.
const STEPS: [(i32, i32); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Patches of corners joined by edges, largest first.
pub(super) fn patches(image: &Raster<f32>, candidates: &[Candidate]) -> Vec<Patch> {
    let links = links(image, candidates);
    let mut taken = vec![false; candidates.len()];
    let mut patches = Vec::new();
    for start in 0..candidates.len() {
        if !taken[start] {
            patches.push(grow(start, &links, &mut taken));
        }
    }
    patches.sort_by_key(|p| std::cmp::Reverse(p.len()));
    patches
}

/// The neighbour along each edge, and the number of the edge there; only where both choose each other.
fn links(image: &Raster<f32>, candidates: &[Candidate]) -> Vec<[Option<(usize, usize)>; 4]> {
    let longest = MAX_LENGTH * image.width().max(image.height()) as f64;
    let chosen: Vec<[Option<(usize, usize)>; 4]> =
        (0..candidates.len()).map(|p| std::array::from_fn(|k| nearest(image, candidates, p, k, longest))).collect();
    let mutual = |p: usize, k: usize| chosen[p][k].filter(|&(q, m)| chosen[q][m] == Some((p, k)));
    (0..candidates.len()).map(|p| std::array::from_fn(|k| mutual(p, k))).collect()
}

fn nearest(image: &Raster<f32>, candidates: &[Candidate], p: usize, k: usize, longest: f64) -> Option<(usize, usize)> {
    let from = &candidates[p];
    let mut best: Option<(f64, (usize, usize))> = None;
    for (q, to) in candidates.iter().enumerate().filter(|(q, _)| *q != p) {
        let d = to.at - from.at;
        let length = d.norm();
        let angle = d.y.atan2(d.x);
        let off = difference(angle, from.edges[k]);
        // What is off its direction counts as farther away.
        let cost = length * (1.0 + off);
        if length > longest || length < 4.0 || off > MAX_ANGLE || best.is_some_and(|(c, _)| c <= cost) {
            continue;
        }
        let back = |m: &usize| difference(angle + TAU / 2.0, to.edges[*m]) < MAX_ANGLE;
        // Seen from the other end, the square on one side of the edge is on the other.
        let Some(m) = (0..4).find(back).filter(|&m| from.side(k) == -to.side(m)) else { continue };
        if is_edge(image, &from.at, &d, from.side(k)) {
            best = Some((cost, (q, m)));
        }
    }
    best.map(|(_, link)| link)
}

/// Whether the grey values along the way are higher on the side that is said to be bright.
fn is_edge(image: &Raster<f32>, from: &Vector2<f64>, d: &Vector2<f64>, side: f64) -> bool {
    let across = Vector2::new(-d.y, d.x) * 0.18;
    [0.3, 0.5, 0.7].iter().all(|&share| {
        let middle = from + d * share;
        let (a, b) = (middle + across, middle - across);
        side * (bilinear(image, a.x, a.y) - bilinear(image, b.x, b.y)) > MIN_CONTRAST
    })
}

fn difference(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(TAU);
    d.min(TAU - d)
}

/// Everything that hangs together with a corner, which is (0, 0).
fn grow(start: usize, links: &[[Option<(usize, usize)>; 4]], taken: &mut [bool]) -> Patch {
    let mut patch = Patch::from([((0, 0), start)]);
    taken[start] = true;
    let mut queue = VecDeque::from([(start, (0, 0), 0)]);
    while let Some((p, (i, j), turn)) = queue.pop_front() {
        for (a, (di, dj)) in STEPS.iter().enumerate() {
            let Some((q, m)) = links[p][(turn + a) % 4] else { continue };
            let place = (i + di, j + dj);
            if taken[q] || patch.contains_key(&place) {
                continue;
            }
            taken[q] = true;
            patch.insert(place, q);
            // Edge m of q leads back: it is the one against the step.
            queue.push_back((q, place, (m + 4 - (a + 2) % 4) % 4));
        }
    }
    patch
}
