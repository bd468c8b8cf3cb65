//! Localisation of extrema to a fraction of a pixel and of a level.

use super::band::Ring;
use nalgebra::{Matrix3, Vector3};
use scene::Mask;
use std::sync::LazyLock;

/// Rows around an extremum that its localisation may look at: [`WANDER`] and then the reach of the interpolation.
pub(super) const MARGIN: usize = WANDER + 5;
/// Rows that the localisation may move away from the sample it starts at.
const WANDER: usize = 3;
/// Rounds of localisation on samples.
const ROUNDS: usize = 5;
/// Beyond this distance from the sample, in samples, the parabola is put around the neighbour.
const MOVE: f64 = 0.6;
/// Beyond this distance from the last sample the parabola says nothing.
const FARTHEST: f64 = 1.0;
/// Rounds of localisation between samples.
const FINE_ROUNDS: usize = 2;

/// A localised extremum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// Number of the octave, in order of size.
    pub(super) octave: usize,
    /// Level of the sample that the extremum lies at.
    pub(super) level: usize,
    /// Column and row of that sample.
    pub(super) sample: [u32; 2],
    /// Position in the octave, the centre of the top-left pixel at (0, 0).
    pub(super) position: [f32; 2],
    /// Standard deviation in pixels of the octave.
    pub(super) sigma: f32,
    /// Magnitude of the difference of Gaussians at the extremum.
    pub(super) response: f32,
}

/// Localises the extrema of an octave.
#[derive(Clone, Copy)]
pub(super) struct Refiner<'a> {
    pub(super) octave: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Pixels of the image in a pixel of the octave.
    pub(super) pixel: f64,
    /// Number of levels with extrema.
    pub(super) layers: usize,
    /// Standard deviation of level 0.
    pub(super) first_sigma: f64,
    /// Smallest response.
    pub(super) contrast: f32,
    /// Largest ratio of curvatures.
    pub(super) edge: f32,
    pub(super) mask: Option<&'a Mask>,
}

impl Refiner<'_> {
    /// Magnitude of a sample below which the extremum near it cannot pass, but for rare exceptions (VLFeat's 0.8).
    pub(super) fn scan_threshold(&self) -> f32 {
        0.8 * self.contrast
    }

    /// The extremum near a sample. `None` where the search runs away, where the extremum is weak, lies on an edge or on a masked pixel, and
    /// for all but the first of several equal samples.
    ///
    /// Newton's method on the quadratic through the 3 x 3 x 3 block around the sample (Brown & Lowe, *Invariant features from interest point
    /// groups*, BMVC 2002), moving to the next sample where it leads there. Between samples that quadratic is biased by up to 0.02 px (the
    /// difference of Gaussians is no parabola), so the last rounds take the derivatives at the estimate itself, from polynomials of fifth degree.
    pub(super) fn refine(&self, differences: &[Ring], level: usize, y: usize, x: usize) -> Option<Candidate> {
        if !is_first_of_equals(differences, level, y, x) {
            return None;
        }
        let (start, mut x, mut y) = (y, x, y);
        let mut fit = Fit::at_sample(differences, level, y, x)?;
        for _ in 1..ROUNDS {
            let step = |along: f64, at: usize, size: usize| match along {
                a if a > MOVE && at + 2 < size => 1,
                a if a < -MOVE && at > 1 => -1,
                _ => 0,
            };
            let (dx, dy) = (step(fit.offset.x, x, self.width), step(fit.offset.y, y, self.height));
            if (dx, dy) == (0, 0) {
                break;
            }
            (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if y.abs_diff(start) > WANDER {
                return None;
            }
            fit = Fit::at_sample(differences, level, y, x)?;
        }
        // NaN fails every one of these.
        let near = fit.offset.amax() <= FARTHEST;
        let strong = fit.response >= f64::from(self.contrast);
        if !near || !strong || !fit.is_round(f64::from(self.edge)) {
            return None;
        }
        let (mut place, mut response, mut rise) = ([x as f64 + fit.offset.x, y as f64 + fit.offset.y], fit.response, fit.offset.z);
        for _ in 0..FINE_ROUNDS {
            let Some(fine) = self.interpolated(differences, level, place, [x, y]) else { break };
            let moved = [place[0] + fine.offset.x, place[1] + fine.offset.y];
            if !((moved[0] - x as f64).abs() <= FARTHEST && (moved[1] - y as f64).abs() <= FARTHEST && fine.offset.z.abs() <= FARTHEST) {
                break;
            }
            (place, response, rise) = (moved, fine.response, fine.offset.z);
        }
        let inside = (0.0..=(self.width - 1) as f64).contains(&place[0]) && (0.0..=(self.height - 1) as f64).contains(&place[1]);
        let [image_x, image_y] = place.map(|v| v * self.pixel + 0.5);
        let masked = self.mask.is_some_and(|m| m.at_point(image_x, image_y).is_none_or(|&v| v == 0));
        (inside && !masked).then(|| Candidate {
            octave: self.octave,
            level,
            sample: [x as u32, y as u32],
            position: place.map(|v| v as f32),
            sigma: (self.first_sigma * 2f64.powf((level as f64 + rise) / self.layers as f64)) as f32,
            response: response as f32,
        })
    }

    /// The quadratic at a place between samples, or `None` too near to the border or too far from `sample`.
    fn interpolated(&self, differences: &[Ring], level: usize, place: [f64; 2], sample: [usize; 2]) -> Option<Fit> {
        let base = place.map(|v| v.floor() as usize);
        let reachable = |i: usize, size: usize| base[i].abs_diff(sample[i]) <= 1 && base[i] >= 2 && base[i] + 3 < size;
        if !(reachable(0, self.width) && reachable(1, self.height)) {
            return None;
        }
        let (wx, wy) = (lagrange(place[0] - base[0] as f64), lagrange(place[1] - base[1] as f64));
        // For each level: value and derivatives [along rows][along columns].
        let mut derivatives = [[[0.0; 3]; 3]; 3];
        for (k, plane) in derivatives.iter_mut().enumerate() {
            for i in 0..TAPS {
                let row = &differences[level + k - 1].row(base[1] + i - 2)[base[0] - 2..][..TAPS];
                for (j, weights) in wx.iter().enumerate() {
                    let sum: f64 = (0..TAPS).map(|t| weights[t] * f64::from(row[t])).sum();
                    for (along_rows, weights) in plane.iter_mut().zip(&wy) {
                        along_rows[j] += weights[i] * sum;
                    }
                }
            }
        }
        let [below, here, above] = derivatives;
        let half = |i: usize, j: usize| 0.5 * (above[i][j] - below[i][j]);
        Fit::new(
            here[0][0],
            Vector3::new(here[0][1], here[1][0], half(0, 0)),
            [here[0][2], here[2][0], above[0][0] + below[0][0] - 2.0 * here[0][0], here[1][1], half(0, 1), half(1, 0)],
        )
    }
}

/// Samples that the interpolation takes along each axis.
const TAPS: usize = 6;

/// Weights of the samples at -2, -1, ... 3 for value, first and second derivative at `t` in 0..=1 of the polynomial through them.
fn lagrange(t: f64) -> [[f64; TAPS]; 3] {
    /// `BASIS[i]`: coefficients, from the constant up, of the polynomial that is 1 at sample i and 0 at the others.
    static BASIS: LazyLock<[[f64; TAPS]; TAPS]> = LazyLock::new(|| {
        std::array::from_fn(|i| {
            let mut polynomial = [0.0; TAPS];
            polynomial[0] = 1.0;
            for j in (0..TAPS).filter(|&j| j != i) {
                // Times (t - (j - 2)) / (i - j).
                let scale = i as f64 - j as f64;
                for k in (0..TAPS).rev() {
                    let lower = if k > 0 { polynomial[k - 1] } else { 0.0 };
                    polynomial[k] = (lower - (j as f64 - 2.0) * polynomial[k]) / scale;
                }
            }
            polynomial
        })
    });
    let mut weights = [[0.0; TAPS]; 3];
    for (i, p) in BASIS.iter().enumerate() {
        for k in (0..TAPS).rev() {
            // Horner's scheme; the last is half the second derivative.
            weights[2][i] = weights[2][i] * t + weights[1][i];
            weights[1][i] = weights[1][i] * t + weights[0][i];
            weights[0][i] = weights[0][i] * t + p[k];
        }
        weights[2][i] *= 2.0;
    }
    weights
}

/// The extremum of a quadratic in column, row and level.
struct Fit {
    /// Columns, rows and levels from the centre.
    offset: Vector3<f64>,
    /// Magnitude.
    response: f64,
    /// Second derivatives in the plane: along columns, along rows, mixed.
    curvature: [f64; 3],
}

impl Fit {
    /// From the value, its gradient and its second derivatives xx, yy, ss, xy, xs, ys; `None` where they are singular.
    fn new(value: f64, gradient: Vector3<f64>, [xx, yy, ss, xy, xs, ys]: [f64; 6]) -> Option<Self> {
        let offset = -(Matrix3::new(xx, xy, xs, xy, yy, ys, xs, ys, ss).try_inverse()? * gradient);
        Some(Self { offset, response: (value + 0.5 * gradient.dot(&offset)).abs(), curvature: [xx, yy, xy] })
    }

    /// The quadratic with the central differences at a sample.
    fn at_sample(differences: &[Ring], level: usize, y: usize, x: usize) -> Option<Self> {
        let planes: [[&[f32]; 3]; 3] =
            std::array::from_fn(|k| std::array::from_fn(|i| &differences[level + k - 1].row(y + i - 1)[x - 1..x + 2]));
        let d = |k: usize, i: usize, j: usize| f64::from(planes[k][i][j]);
        let centre = d(1, 1, 1);
        let cross = |a: f64, b: f64, c: f64, d: f64| 0.25 * ((a + b) - (c + d));
        Self::new(
            centre,
            0.5 * Vector3::new(d(1, 1, 2) - d(1, 1, 0), d(1, 2, 1) - d(1, 0, 1), d(2, 1, 1) - d(0, 1, 1)),
            [
                d(1, 1, 2) + d(1, 1, 0) - 2.0 * centre,
                d(1, 2, 1) + d(1, 0, 1) - 2.0 * centre,
                d(2, 1, 1) + d(0, 1, 1) - 2.0 * centre,
                cross(d(1, 2, 2), d(1, 0, 0), d(1, 0, 2), d(1, 2, 0)),
                cross(d(2, 1, 2), d(0, 1, 0), d(2, 1, 0), d(0, 1, 2)),
                cross(d(2, 2, 1), d(0, 0, 1), d(2, 0, 1), d(0, 2, 1)),
            ],
        )
    }

    /// Whether the ratio of the principal curvatures is below `edge`.
    fn is_round(&self, edge: f64) -> bool {
        let [xx, yy, xy] = self.curvature;
        let (trace, determinant) = (xx + yy, xx * yy - xy * xy);
        determinant > 0.0 && trace * trace * edge < (edge + 1.0) * (edge + 1.0) * determinant
    }
}

/// Whether no neighbour that comes earlier in the order of level, row and column has the same value.
fn is_first_of_equals(differences: &[Ring], level: usize, y: usize, x: usize) -> bool {
    let value = differences[level].row(y)[x];
    let same = |k: usize, y: usize, columns: std::ops::RangeInclusive<usize>| differences[k].row(y)[columns].contains(&value);
    let below = (y - 1..=y + 1).any(|y| same(level - 1, y, x - 1..=x + 1));
    !(below || same(level, y - 1, x - 1..=x + 1) || same(level, y, x - 1..=x - 1))
}
