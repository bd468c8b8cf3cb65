//! From a rough place to the centre of a circular target.

use super::ellipse::Ellipse;
use super::find::{Candidate, candidates};
use super::fit::{Failure, Fit, fit};
use nalgebra::Vector2;
use scene::Raster;

/// Least diameter, pixels: below, a disc cannot be told from a blurred spot of any shape.
const MIN_DIAMETER_PX: f64 = 4.0;
/// Largest radius, pixels.
const MAX_RADIUS_PX: f64 = 150.0;
/// Least ratio of the axes: a view by more than 72 degrees from the front.
const MIN_AXIS_RATIO: f64 = 0.3;
/// Largest root mean square of all residuals over the contrast.
const MAX_RESIDUAL: f64 = 0.25;
/// Near the edge, residuals above this share of the contrast that are so much larger than those elsewhere tell another shape.
const MAX_EDGE_RESIDUAL: f64 = 0.08;
const MAX_EDGE_OVER_FLAT: f64 = 2.5;
/// Largest standard deviation of the centre, pixels: a target that is measured no better is not worth more than the eye.
const MAX_SIGMA_PX: f64 = 0.3;
/// Contrast of another target, as a share of that of the best, from which it is taken for one.
const RIVAL: f64 = 0.5;

/// A circular target as it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircleTarget {
    /// Centre of its ellipse, pixels.
    pub centre: [f64; 2],
    /// Standard deviation of the centre along each axis of the image, pixels: what the noise makes of it.
    pub sigma_px: [f64; 2],
    /// Semi-axes of the ellipse as vectors, pixels, the longer one first.
    pub axes_px: [[f64; 2]; 2],
    /// Grey of the disc minus that of what is about it, in the unit of the image.
    pub contrast: f64,
    /// Standard deviation of the blur of its edge, pixels.
    pub blur_px: f64,
}

impl CircleTarget {
    /// Mean diameter, pixels.
    #[must_use]
    pub fn diameter_px(&self) -> f64 {
        let [a, b] = self.axes_px.map(|[x, y]| x.hypot(y));
        2.0 * (a * b).sqrt()
    }

    /// Standard deviation along any axis: the root of the mean variance, pixels.
    #[must_use]
    pub fn mean_sigma_px(&self) -> f64 {
        (0.5 * self.sigma_px.iter().map(|s| s * s).sum::<f64>()).sqrt()
    }
}

/// Why no target was measured.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoTarget {
    /// The place lies outside the image.
    #[error("the place lies outside the image")]
    Outside,
    /// Nothing round is there.
    #[error("no circular target is within {search_px} px")]
    Nothing {
        /// How far was looked, pixels.
        search_px: f64,
    },
    /// The target, or the background about it, is cut by the border of the image.
    #[error("the target touches the border of the image")]
    Border,
    /// It is small.
    #[error("the target is too small: {diameter_px:.1} px across, {MIN_DIAMETER_PX} are needed")]
    TooSmall {
        /// Its shorter axis, pixels.
        diameter_px: f64,
    },
    /// It is seen too much from the side, or is no circle.
    #[error("the target is too elongated: its axes have a ratio of {ratio:.2}, {MIN_AXIS_RATIO} is needed")]
    TooElongated {
        /// Shorter over longer axis.
        ratio: f64,
    },
    /// There is a spot, but its edge is not that of an ellipse: half hidden, or something else.
    #[error("the spot is no ellipse: hidden in part, or not a circular target")]
    NoEllipse,
    /// It hardly differs from the noise.
    #[error("the target is too faint: its centre would be known to {sigma_px:.2} px only")]
    TooFaint {
        /// Standard deviation of its centre, pixels.
        sigma_px: f64,
    },
    /// Two targets are about as near.
    #[error("two targets are about as near, {:.1} and {:.1} px away: point nearer to the one that is meant", .0[0], .0[1])]
    Ambiguous([f64; 2]),
}

/// Measures the circular target whose centre lies within `search_px` pixels from a rough place: a disc, bright on dark or dark on bright, on a
/// background that is even for half its radius at least; rings about that do not matter.
///
/// Regions that stand out at any of several grey levels and are as full as an ellipse are candidates; to the grey values in and about each,
/// an ellipse with an edge blurred by a Gaussian is fitted by least squares, with contrast, background and a linear change of the light. Of
/// several the one is taken that has most contrast for its distance. The fit is the ellipse operator of close-range photogrammetry
/// in the form of a template whose parameters are all unknown (Luhmann, Robson, Kyle & Boehm, *Close-Range Photogrammetry and 3D Imaging*,
/// section on the measurement of single point features; Gruen 1985 for least-squares matching): the model and all that is symmetric
/// about the centre (blur, the square of a pixel, saturation) leave no bias in it, and its normal equations with the
/// residuals give the standard deviation. Noise counts as independent from pixel to pixel.
///
/// The centre of the ellipse is not the image of the centre of the circle: see [`CircleTarget::eccentricity_px`].
///
/// # Errors
/// [`NoTarget`], with the reason of what comes nearest to a target.
pub fn measure_circle(image: &Raster<f32>, rough: [f64; 2], search_px: f64) -> Result<CircleTarget, NoTarget> {
    let around = Vector2::from(rough);
    let inside = |v: f64, size: usize| v >= 0.0 && v < size as f64;
    if !(inside(around.x, image.width()) && inside(around.y, image.height())) {
        return Err(NoTarget::Outside);
    }
    let mut failure = NoTarget::Nothing { search_px };
    let mut half = search_px + 12.0;
    while half < search_px + 2.0 * MAX_RADIUS_PX {
        let mut found: Vec<CircleTarget> = Vec::new();
        for candidate in candidates(image, &around, search_px, half) {
            match accepted(image, &candidate) {
                Ok(target) if distance(&target, &around) <= search_px => found.push(target),
                Ok(_) => {}
                Err(reason) => failure = if rank(&reason) > rank(&failure) { reason } else { failure },
            }
        }
        if let Some(best) = best(found, &around, search_px) {
            return best;
        }
        // A target that is larger than the window reaches beyond it.
        half *= 2.0;
    }
    Err(failure)
}

fn distance(target: &CircleTarget, from: &Vector2<f64>) -> f64 {
    (Vector2::from(target.centre) - from).norm()
}

/// The target with most contrast for its distance; `None` where there is none.
fn best(mut found: Vec<CircleTarget>, around: &Vector2<f64>, search_px: f64) -> Option<Result<CircleTarget, NoTarget>> {
    let score = |t: &CircleTarget| t.contrast.abs() / (1.0 + (2.0 * distance(t, around) / search_px).powi(2));
    found.sort_by(|a, b| score(b).total_cmp(&score(a)));
    let first = *found.first()?;
    let near = distance(&first, around);
    // The same target may have been found twice, and a ring about it has its centre too.
    let apart = |t: &CircleTarget| (Vector2::from(t.centre) - Vector2::from(first.centre)).norm() > 0.5 * first.diameter_px().max(2.0);
    let rival = found.iter().filter(|t| apart(t) && t.contrast.abs() > RIVAL * first.contrast.abs());
    let nearest_rival = rival.map(|t| distance(t, around)).min_by(f64::total_cmp);
    Some(match nearest_rival {
        Some(other) if other < 1.5 * near + 1.0 => Err(NoTarget::Ambiguous([near, other])),
        _ => Ok(first),
    })
}

/// How much a reason tells: that of what comes nearest to a target is given.
fn rank(reason: &NoTarget) -> u32 {
    match reason {
        NoTarget::Outside | NoTarget::Nothing { .. } => 0,
        NoTarget::TooSmall { .. } => 1,
        NoTarget::NoEllipse => 2,
        NoTarget::TooFaint { .. } => 3,
        NoTarget::TooElongated { .. } => 4,
        NoTarget::Border => 5,
        NoTarget::Ambiguous(_) => 6,
    }
}

fn accepted(image: &Raster<f32>, candidate: &Candidate) -> Result<CircleTarget, NoTarget> {
    let Some([long, short]) = candidate.ellipse.axes() else { return Err(NoTarget::NoEllipse) };
    if candidate.at_border {
        return Err(NoTarget::Border);
    }
    // Moments of a few pixels are rough: the fit decides about all but the hopeless.
    if short.norm() < 0.5 * MIN_AXIS_RATIO * long.norm() {
        return Err(NoTarget::TooElongated { ratio: short.norm() / long.norm() });
    }
    if long.norm() > MAX_RADIUS_PX {
        return Err(NoTarget::NoEllipse);
    }
    let fit = fit(image, candidate.ellipse, candidate.bright).map_err(|failure| match failure {
        Failure::Diverged => NoTarget::NoEllipse,
        Failure::Border => NoTarget::Border,
    })?;
    judged(&fit, candidate)
}

/// A fit that is a target.
fn judged(fit: &Fit, candidate: &Candidate) -> Result<CircleTarget, NoTarget> {
    let Some([long, short]) = fit.ellipse.axes() else { return Err(NoTarget::NoEllipse) };
    let Ellipse { centre, .. } = fit.ellipse;
    let contrast = fit.contrast.abs();
    let [edge, flat] = fit.residual;
    let is_other_kind = (fit.contrast > 0.0) != candidate.bright;
    let is_other_shape = edge > MAX_EDGE_RESIDUAL * contrast && edge > MAX_EDGE_OVER_FLAT * flat;
    if is_other_kind || is_other_shape || edge.max(flat) > MAX_RESIDUAL * contrast || fit.blur_px > short.norm() {
        return Err(NoTarget::NoEllipse);
    }
    if 2.0 * short.norm() < MIN_DIAMETER_PX {
        return Err(NoTarget::TooSmall { diameter_px: 2.0 * short.norm() });
    }
    if short.norm() < MIN_AXIS_RATIO * long.norm() {
        return Err(NoTarget::TooElongated { ratio: short.norm() / long.norm() });
    }
    let sigma_px = [fit.covariance[(0, 0)], fit.covariance[(1, 1)]].map(|v| v.max(0.0).sqrt());
    let target = CircleTarget {
        centre: [centre.x, centre.y],
        sigma_px,
        axes_px: [[long.x, long.y], [short.x, short.y]],
        contrast: fit.contrast,
        blur_px: fit.blur_px,
    };
    if target.mean_sigma_px() <= MAX_SIGMA_PX { Ok(target) } else { Err(NoTarget::TooFaint { sigma_px: target.mean_sigma_px() }) }
}
