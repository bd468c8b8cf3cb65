//! Regions that could be the disc of a target: near a place, brighter or darker than all about them, as full as an ellipse.

use super::ellipse::Ellipse;
use crate::gaussian_blur;
use nalgebra::{Matrix2, Vector2};
use scene::Raster;

/// Grey levels at which regions are cut out.
const LEVELS: usize = 12;
/// Low pass before, pixels: single noisy pixels do not tear regions apart.
const SMOOTH_PX: f32 = 0.8;
/// Fewest pixels of a region.
const MIN_PIXELS: usize = 7;
/// A region has the area of the ellipse of its moments to this share. A ring of half the radius has 0.6.
const FULLNESS: std::ops::RangeInclusive<f64> = 0.85..=1.15;
/// Regions of one kind whose centres and sizes differ by less are one target at two levels, pixels and share.
const SAME_PX: f64 = 1.0;
const SAME_SIZE: f64 = 0.25;

/// A region that could be a disc.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub ellipse: Ellipse,
    /// Brighter than what is about it.
    pub bright: bool,
    /// It reaches the border of the image.
    pub at_border: bool,
}

/// The part of an image within `half` pixels from a place, and its top-left pixel.
fn window(image: &Raster<f32>, around: &Vector2<f64>, half: f64) -> (Raster<f32>, (usize, usize)) {
    let range = |centre: f64, size: usize| {
        let low = (centre - half).floor().max(0.0) as usize;
        (low, ((centre + half).ceil().max(0.0) as usize).clamp(low, size))
    };
    let ((x0, x1), (y0, y1)) = (range(around.x, image.width()), range(around.y, image.height()));
    let values = (y0..y1).flat_map(|y| image.row(y)[x0..x1].iter().copied()).collect();
    // The number of values is right by construction.
    (Raster::from_vec(x1 - x0, y1 - y0, values).unwrap_or_else(|| Raster::filled(0, 0, 0.0)), (x0, y0))
}

/// Regions whose centre lies within `search` pixels from a place, in a window of `half` pixels to each side. Those that reach beyond the
/// window are not among them, unless it is the image that ends there.
pub(super) fn candidates(image: &Raster<f32>, around: &Vector2<f64>, search: f64, half: f64) -> Vec<Candidate> {
    let (window, (x0, y0)) = window(image, around, half);
    let smooth = gaussian_blur(&window, SMOOTH_PX);
    let mut sorted: Vec<f32> = smooth.data().iter().copied().filter(|v| v.is_finite()).collect();
    if sorted.len() < MIN_PIXELS {
        return Vec::new();
    }
    sorted.sort_unstable_by(f32::total_cmp);
    let (low, high) = (sorted[sorted.len() / 100], sorted[sorted.len() - 1 - sorted.len() / 100]);
    let image_ends = [x0 == 0, x0 + window.width() == image.width(), y0 == 0, y0 + window.height() == image.height()];
    let mut found: Vec<Candidate> = Vec::new();
    let mut labels = Labels::new(&smooth);
    for bright in [true, false] {
        for level in 1..=LEVELS {
            let threshold = low + (high - low) * level as f32 / (LEVELS + 1) as f32;
            labels.for_each_region(
                |v| (v > threshold) == bright,
                |region| {
                    // A region beyond the window is not whole, and one from side to side is what the disc lies on.
                    let beyond = region.sides.iter().zip(image_ends).any(|(touches, image_ends)| *touches && !image_ends);
                    let [left, right, top, bottom] = region.sides;
                    if beyond || (left && right) || (top && bottom) {
                        return;
                    }
                    let Some(mut ellipse) = region.ellipse() else { return };
                    ellipse.centre += Vector2::new(x0 as f64, y0 as f64);
                    if (ellipse.centre - around).norm() > search {
                        return;
                    }
                    let candidate = Candidate { ellipse, bright, at_border: region.sides.contains(&true) };
                    if !found.iter().any(|other| other.is_same(&candidate)) {
                        found.push(candidate);
                    }
                },
            );
        }
    }
    found
}

impl Candidate {
    fn is_same(&self, other: &Self) -> bool {
        let ratio = (self.ellipse.shape.determinant() / other.ellipse.shape.determinant()).sqrt();
        self.bright == other.bright
            && self.at_border == other.at_border
            && (self.ellipse.centre - other.ellipse.centre).norm() < SAME_PX
            && (ratio - 1.0).abs() < SAME_SIZE
    }
}

/// Connected pixels on one side of a level.
#[derive(Default)]
struct Region {
    pixels: usize,
    sum: Vector2<f64>,
    squares: Matrix2<f64>,
    /// Whether it touches the left, right, upper and lower side.
    sides: [bool; 4],
}

impl Region {
    /// The ellipse of its moments, where it is as full as that.
    fn ellipse(&self) -> Option<Ellipse> {
        if self.pixels < MIN_PIXELS {
            return None;
        }
        let n = self.pixels as f64;
        let mean = self.sum / n;
        // Each pixel is a square with a variance of 1/12.
        let covariance = self.squares / n - mean * mean.transpose() + Matrix2::identity() / 12.0;
        let fullness = n / (std::f64::consts::PI * 4.0 * covariance.determinant().max(0.0).sqrt());
        if FULLNESS.contains(&fullness) { Ellipse::from_moments(mean, &covariance) } else { None }
    }
}

/// Work space of the search for connected pixels.
struct Labels<'a> {
    grey: &'a Raster<f32>,
    seen: Vec<bool>,
    stack: Vec<usize>,
}

impl<'a> Labels<'a> {
    fn new(grey: &'a Raster<f32>) -> Self {
        Self { grey, seen: vec![false; grey.data().len()], stack: Vec::new() }
    }

    /// Visits the regions of the pixels that are `inside`, each connected over sides, in the order of their first pixels.
    fn for_each_region(&mut self, inside: impl Fn(f32) -> bool, mut visit: impl FnMut(&Region)) {
        let (w, h) = (self.grey.width(), self.grey.height());
        let values = self.grey.data();
        self.seen.fill(false);
        for start in 0..values.len() {
            if self.seen[start] || !inside(values[start]) {
                continue;
            }
            let mut region = Region::default();
            self.seen[start] = true;
            self.stack.push(start);
            while let Some(i) = self.stack.pop() {
                let (x, y) = (i % w, i / w);
                let at = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
                region.pixels += 1;
                region.sum += at;
                region.squares += at * at.transpose();
                for (touches, here) in region.sides.iter_mut().zip([x == 0, x + 1 == w, y == 0, y + 1 == h]) {
                    *touches |= here;
                }
                let beside = [(x > 0).then(|| i - 1), (x + 1 < w).then(|| i + 1), (y > 0).then(|| i - w), (y + 1 < h).then(|| i + w)];
                for j in beside.into_iter().flatten() {
                    if !self.seen[j] && inside(values[j]) {
                        self.seen[j] = true;
                        self.stack.push(j);
                    }
                }
            }
            visit(&region);
        }
    }
}
