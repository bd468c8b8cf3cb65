//! Least-squares fit of a blurred ellipse to grey values.

use super::ellipse::Ellipse;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use scene::Raster;

/// Number of unknowns: centre 2, shape 3, blur, background, contrast, gradient of the light 2.
const UNKNOWNS: usize = 10;
/// Times that the pixels that take part are chosen anew, at most; it ends when the semi-axes change by less than this, pixels.
const MAX_ROUNDS: usize = 10;
const SETTLED_PX: f64 = 0.02;
/// Steps in each.
const MAX_STEPS: usize = 25;
/// A step of the centre below this ends a round, pixels.
const CENTRE_TOLERANCE_PX: f64 = 1e-4;
/// Least blur of an edge, pixels: a pixel averages over its square, which has a deviation of 0.29.
const MIN_BLUR_PX: f64 = 0.3;
/// Background that takes part: a share of the shorter semi-axis, so many pixels, or as far as the blur of the edge reaches, but not so far that
/// a ring about a dark ring as wide as the disc comes in.
const MARGIN: f64 = 0.5;
const MIN_MARGIN_PX: f64 = 2.0;
const MARGIN_OVER_BLUR: f64 = 2.5;
const MAX_MARGIN: f64 = 0.9;
/// Standard deviation of the change of the light over the radius, as a share of the light: without, noise tilts it and moves the centre.
const LIGHT_SIGMA: f64 = 0.05;

type Unknowns = SVector<f64, UNKNOWNS>;

/// A fitted ellipse.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub ellipse: Ellipse,
    /// Inside minus outside, grey values.
    pub contrast: f64,
    /// Standard deviation of the edge's blur, pixels.
    pub blur_px: f64,
    /// Covariance of the centre, from the residuals.
    pub covariance: Matrix2<f64>,
    /// Root mean square of the residuals within 2 pixels from the edge, and of the others, grey values.
    pub residual: [f64; 2],
}

/// Why there is no fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Failure {
    /// It wandered off or is not determined.
    Diverged,
    /// The ellipse or the background about it leaves the image.
    Border,
}

/// The model: `(background + contrast S(d / blur)) (1 + gradient . (x - origin))`, where d is the distance from the edge and S falls from 1
/// to 0 as the integral of a Gaussian does.
#[derive(Clone, Copy)]
struct Model {
    ellipse: Ellipse,
    log_blur: f64,
    background: f64,
    contrast: f64,
    gradient: Vector2<f64>,
    origin: Vector2<f64>,
}

impl Model {
    fn value_and_slopes(&self, at: &Vector2<f64>) -> (f64, Unknowns) {
        let distance = self.ellipse.distance(at);
        let blur = self.log_blur.exp();
        let z = distance.value / blur;
        let inside = 0.5 * libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2);
        // Derivative of S by the distance.
        let slope = -(-0.5 * z * z).exp() / (blur * std::f64::consts::TAU.sqrt());
        let from_origin = at - self.origin;
        let light = 1.0 + self.gradient.dot(&from_origin);
        let grey = self.background + self.contrast * inside;
        let edge = light * self.contrast * slope;
        let [xx, xy, yy] = distance.d_shape;
        let slopes = [
            edge * distance.d_centre.x,
            edge * distance.d_centre.y,
            edge * xx,
            edge * xy,
            edge * yy,
            -edge * distance.value,
            light,
            light * inside,
            grey * from_origin.x,
            grey * from_origin.y,
        ];
        (grey * light, Unknowns::from(slopes))
    }

    fn plus(&self, step: &Unknowns) -> Self {
        let s = |k: usize| step[k];
        Self {
            ellipse: Ellipse {
                centre: self.ellipse.centre + Vector2::new(s(0), s(1)),
                shape: self.ellipse.shape + Matrix2::new(s(2), s(3), s(3), s(4)),
            },
            log_blur: (self.log_blur + s(5).clamp(-1.0, 1.0)).max(MIN_BLUR_PX.ln()),
            background: self.background + s(6),
            contrast: self.contrast + s(7),
            gradient: self.gradient + Vector2::new(s(8), s(9)),
            origin: self.origin,
        }
    }
}

/// What takes part in a round.
struct Sample {
    /// Centres of the pixels, their values, and weights that fall from 1 to 0 over the last pixel of the margin: what a pixel more or less
    /// would change, moves no centre.
    pixels: Vec<(Vector2<f64>, f64, f64)>,
    /// Weight of the light's gradient being zero.
    even_light: f64,
}

/// Fits an ellipse that starts at `start`, whose inside is brighter or darker than what is about it.
pub(super) fn fit(image: &Raster<f32>, start: Ellipse, bright: bool) -> Result<Fit, Failure> {
    let mut sample = around(image, &start, 1.0)?;
    let (low, high) = sample.pixels.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.1), high.max(p.1)));
    let (background, contrast) = if bright { (low, high - low) } else { (high, low - high) };
    let mut model = Model { ellipse: start, log_blur: 0.0, background, contrast, gradient: Vector2::zeros(), origin: start.centre };
    let limit = start.half_box().ok_or(Failure::Diverged)?.max();
    let mut size = start.half_box().ok_or(Failure::Diverged)?;
    for _ in 0..MAX_ROUNDS {
        model = minimise(model, &sample).ok_or(Failure::Diverged)?;
        let size_now = model.ellipse.half_box().ok_or(Failure::Diverged)?;
        let grown = size_now.max();
        // It starts from moments, which are right to a pixel or two.
        if (model.ellipse.centre - start.centre).norm() > limit || grown > 1.5 * limit + 3.0 {
            return Err(Failure::Diverged);
        }
        let noise = cost(&model, &sample) / sample.redundancy();
        sample = around(image, &model.ellipse, model.log_blur.exp())?;
        sample.even_light = noise * grown * grown / (LIGHT_SIGMA * LIGHT_SIGMA);
        let change = (size_now - size).amax();
        size = size_now;
        if change < SETTLED_PX {
            break;
        }
    }
    model = minimise(model, &sample).ok_or(Failure::Diverged)?;
    result(&model, &sample).ok_or(Failure::Diverged)
}

impl Sample {
    fn redundancy(&self) -> f64 {
        self.pixels.iter().map(|p| p.2).sum::<f64>() - UNKNOWNS as f64
    }
}

/// The pixels within an ellipse and its margin.
fn around(image: &Raster<f32>, ellipse: &Ellipse, blur_px: f64) -> Result<Sample, Failure> {
    let ([_, short], half) = ellipse.axes().zip(ellipse.half_box()).ok_or(Failure::Diverged)?;
    let blurred = (MARGIN_OVER_BLUR * blur_px).min(MAX_MARGIN * short.norm());
    let margin = (MARGIN * short.norm()).max(MIN_MARGIN_PX).max(blurred);
    let (low, high) = (ellipse.centre - half - Vector2::repeat(margin), ellipse.centre + half + Vector2::repeat(margin));
    if low.x < 0.0 || low.y < 0.0 || high.x > image.width() as f64 || high.y > image.height() as f64 {
        return Err(Failure::Border);
    }
    let mut pixels = Vec::new();
    for y in low.y as usize..(high.y.ceil() as usize).min(image.height()) {
        for x in low.x as usize..(high.x.ceil() as usize).min(image.width()) {
            let at = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
            let weight = (margin + 0.5 - ellipse.distance(&at).value).clamp(0.0, 1.0);
            if weight > 0.0 {
                pixels.push((at, f64::from(image[(x, y)]), weight));
            }
        }
    }
    let sample = Sample { pixels, even_light: 0.0 };
    if sample.redundancy() > UNKNOWNS as f64 { Ok(sample) } else { Err(Failure::Diverged) }
}

fn cost(model: &Model, sample: &Sample) -> f64 {
    let of_pixels: f64 = sample.pixels.iter().map(|(at, grey, weight)| weight * (model.value_and_slopes(at).0 - grey).powi(2)).sum();
    of_pixels + sample.even_light * model.gradient.norm_squared()
}

fn normal_equations(model: &Model, sample: &Sample) -> (SMatrix<f64, UNKNOWNS, UNKNOWNS>, Unknowns) {
    let (mut normal, mut right) = (SMatrix::zeros(), Unknowns::zeros());
    for (at, grey, weight) in &sample.pixels {
        let (value, slopes) = model.value_and_slopes(at);
        normal += slopes * slopes.transpose() * *weight;
        right += slopes * (weight * (value - grey));
    }
    for k in 0..2 {
        normal[(8 + k, 8 + k)] += sample.even_light;
        right[8 + k] += sample.even_light * model.gradient[k];
    }
    (normal, right)
}

/// Levenberg and Marquardt.
fn minimise(mut model: Model, sample: &Sample) -> Option<Model> {
    let mut damping = 1e-3;
    let mut least = cost(&model, sample);
    for _ in 0..MAX_STEPS {
        let (normal, right) = normal_equations(&model, sample);
        let mut damped = normal;
        for k in 0..UNKNOWNS {
            damped[(k, k)] += damping * normal[(k, k)].max(1e-12);
        }
        let step = -damped.cholesky()?.solve(&right);
        let candidate = model.plus(&step);
        let next = cost(&candidate, sample);
        if next.is_finite() && next <= least {
            let moved = step[0].hypot(step[1]);
            (model, damping) = (candidate, damping * 0.2);
            let gained = least - next;
            least = next;
            if moved < CENTRE_TOLERANCE_PX && gained <= 1e-6 * least {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e8 {
                break;
            }
        }
    }
    Some(model)
}

fn result(model: &Model, sample: &Sample) -> Option<Fit> {
    let (normal, _) = normal_equations(model, sample);
    let inverse = normal.cholesky()?.inverse();
    let covariance = inverse.fixed_view::<2, 2>(0, 0) * (cost(model, sample) / sample.redundancy());
    let mean_square = |near: bool| {
        let (mut sum, mut count) = (0.0, 0.0);
        for (at, grey, _) in &sample.pixels {
            let is_near = model.ellipse.distance(at).value.abs() < 2.0;
            if is_near == near {
                sum += (model.value_and_slopes(at).0 - grey).powi(2);
                count += 1.0;
            }
        }
        if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
    };
    // Light falls on the disc before its image is blurred: (L f) * G = L (f * G) + s^2 grad L . grad (f * G) for linear light L, which moves
    // the blurred edges by -s^2 grad L / L.
    let blur = model.log_blur.exp();
    let light = 1.0 + model.gradient.dot(&(model.ellipse.centre - model.origin));
    let centre = model.ellipse.centre + model.gradient * (blur * blur / light);
    Some(Fit {
        ellipse: Ellipse { centre, ..model.ellipse },
        contrast: model.contrast,
        blur_px: blur,
        covariance,
        residual: [mean_square(true), mean_square(false)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_the_model_are_those_of_differences() {
        let ellipse = Ellipse { centre: Vector2::new(10.2, 7.9), shape: Matrix2::new(0.21, 0.04, 0.04, 0.13) };
        let model = Model {
            ellipse,
            log_blur: 0.1,
            background: 0.2,
            contrast: 0.5,
            gradient: Vector2::new(0.01, -0.02),
            origin: Vector2::new(10.0, 8.0),
        };
        for at in [Vector2::new(14.5, 8.5), Vector2::new(10.5, 15.5), Vector2::new(9.5, 8.5)] {
            let (_, slopes) = model.value_and_slopes(&at);
            for k in 0..UNKNOWNS {
                let mut step = Unknowns::zeros();
                step[k] = 1e-6;
                let (plus, minus) = (model.plus(&step).value_and_slopes(&at).0, model.plus(&-step).value_and_slopes(&at).0);
                assert!(((plus - minus) / 2e-6 - slopes[k]).abs() < 1e-6, "unknown {k}: {} {}", (plus - minus) / 2e-6, slopes[k]);
            }
        }
    }
}
