//! Places that look like the meeting of four squares.

use crate::sample::{bilinear, inside};
use nalgebra::Vector2;
use scene::Raster;
use std::f64::consts::{PI, TAU};

/// Radii of the rings about a candidate that are read, pixels; the first that shows four sectors counts.
const RINGS_PX: [f64; 3] = [5.0, 3.5, 8.0];
const RING_SAMPLES: usize = 32;
/// Saddle strength (of an image with standard deviation 1, smoothed by 1.5 pixels a full crossing has about 0.1) of the weakest candidate.
const MIN_STRENGTH: f32 = 0.004;
/// Opposite edges leave a corner at 180 degrees but for perspective and distortion.
const MAX_BEND: f64 = 0.6;
/// Two edges cross at this angle or more, radians.
const MIN_SECTOR: f64 = 0.35;

/// A candidate in the pixels of its level.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub at: Vector2<f64>,
    /// Directions of the four edges, radians, ascending: clockwise on the screen.
    pub edges: [f64; 4],
    /// Whether the square after the first edge is bright; they alternate.
    pub first_bright: bool,
}

impl Candidate {
    /// +1 where the square between edge `k` and the next one is bright, else -1.
    pub(super) fn side(&self, k: usize) -> f64 {
        if k.is_multiple_of(2) == self.first_bright { 1.0 } else { -1.0 }
    }
}

/// The strongest candidates, at most `count`, strongest first.
pub(super) fn candidates(image: &Raster<f32>, count: usize) -> Vec<Candidate> {
    let mut peaks = peaks(&strengths(image));
    // Ties by place, so that the order is one.
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    peaks.into_iter().filter_map(|(_, (y, x))| candidate(image, &Vector2::new(x as f64 + 0.5, y as f64 + 0.5))).take(count).collect()
}

/// Ixy^2 - Ixx Iyy, positive where the grey values form a saddle (Beaudet 1978).
fn strengths(image: &Raster<f32>) -> Raster<f32> {
    let (w, h) = (image.width(), image.height());
    let mut out = Raster::filled(w, h, 0.0f32);
    for y in 2..h.saturating_sub(2) {
        let (above, row, below) = (image.row(y - 1), image.row(y), image.row(y + 1));
        let strengths = &mut out.row_mut(y)[2..w - 2];
        for (k, value) in strengths.iter_mut().enumerate() {
            let x = k + 2;
            let xx = row[x + 1] - 2.0 * row[x] + row[x - 1];
            let yy = below[x] - 2.0 * row[x] + above[x];
            let xy = 0.25 * (below[x + 1] - below[x - 1] - above[x + 1] + above[x - 1]);
            *value = xy * xy - xx * yy;
        }
    }
    out
}

/// Local maxima in 5 x 5 pixels: strength, row and column.
fn peaks(strengths: &Raster<f32>) -> Vec<(f32, (usize, usize))> {
    let (w, h) = (strengths.width(), strengths.height());
    let mut found = Vec::new();
    for y in 4..h.saturating_sub(4) {
        for x in 4..w.saturating_sub(4) {
            let value = strengths[(x, y)];
            if value < MIN_STRENGTH {
                continue;
            }
            let beaten = |j: usize, i: usize| {
                let other = strengths[(i, j)];
                other > value || (other == value && (j, i) < (y, x))
            };
            if !(y - 2..=y + 2).any(|j| (x - 2..=x + 2).any(|i| beaten(j, i))) {
                found.push((value, (y, x)));
            }
        }
    }
    found
}

fn candidate(image: &Raster<f32>, at: &Vector2<f64>) -> Option<Candidate> {
    RINGS_PX.iter().find_map(|&radius| ring(image, at, radius))
}

/// Reads a ring: four sectors of alternating brightness, opposite ones alike.
fn ring(image: &Raster<f32>, at: &Vector2<f64>, radius: f64) -> Option<Candidate> {
    if !inside(image, at, radius + 1.0) {
        return None;
    }
    let angle = |k: usize| k as f64 * TAU / RING_SAMPLES as f64;
    let values: [f64; RING_SAMPLES] =
        std::array::from_fn(|k| bilinear(image, at.x + radius * angle(k).cos(), at.y + radius * angle(k).sin()));
    let mean = values.iter().sum::<f64>() / RING_SAMPLES as f64;
    let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / RING_SAMPLES as f64).sqrt();
    // Opposite values are alike where squares meet, and differ on a single edge.
    let half = RING_SAMPLES / 2;
    let odd = (0..half).map(|k| (values[k] - values[k + half]).powi(2)).sum::<f64>() / half as f64;
    if spread < 0.1 || odd > 1.2 * spread * spread {
        return None;
    }
    let mut edges = Vec::new();
    let mut first_bright = false;
    for k in 0..RING_SAMPLES {
        let (a, b) = (values[k] - mean, values[(k + 1) % RING_SAMPLES] - mean);
        if (a < 0.0) != (b < 0.0) {
            if edges.is_empty() {
                first_bright = b >= 0.0;
            }
            edges.push(angle(k) + a / (a - b) * TAU / RING_SAMPLES as f64);
        }
    }
    let edges: [f64; 4] = edges.try_into().ok()?;
    let sectors: [f64; 4] = std::array::from_fn(|k| (edges[(k + 1) % 4] - edges[k]).rem_euclid(TAU));
    let straight = |k: usize| ((edges[k + 2] - edges[k]) - PI).abs() < MAX_BEND;
    (sectors.iter().all(|s| *s > MIN_SECTOR) && straight(0) && straight(1)).then_some(Candidate { at: *at, edges, first_bright })
}
