//! Where a model lies in the world: robust alignment with directions, headings and places.

use nalgebra::{UnitQuaternion, Vector3};
use scene::Similarity3;

/// A rotation that is known worse than this is not known.
pub(crate) const MAX_ROTATION_SIGMA_RAD: f64 = 0.1;
/// Rounds of reweighting.
const ROUNDS: usize = 20;
/// Residuals of this many standard deviations weigh half: acoustic positions jump.
const HALF_WEIGHT: f64 = 3.0;

/// Directions in the axes of the model that are known in the world.
#[derive(Clone, Debug, Default)]
pub(crate) struct Attitude {
    /// Up, and its standard deviation.
    pub ups: Vec<(Vector3<f64>, f64)>,
    /// An axis, its heading and the standard deviation of that.
    pub headings: Vec<(Vector3<f64>, f64, f64)>,
}

impl Attitude {
    pub(crate) fn is_empty(&self) -> bool {
        self.ups.is_empty() && self.headings.is_empty()
    }
}

/// A place known in both; the deviation along an axis of the world is infinite where it is not known there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub in_model: Vector3<f64>,
    pub in_world: Vector3<f64>,
    pub sigma: Vector3<f64>,
}

impl Place {
    /// One over the variance along an axis; 0 where nothing is known.
    fn weight(&self, axis: usize) -> f64 {
        1.0 / (self.sigma[axis] * self.sigma[axis])
    }
}

/// Where a model lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    pub world_from_model: Similarity3,
    /// Standard deviation of its scale over the scale; infinite where the places do not tell it.
    pub scale_sigma: f64,
    /// Standard deviation of the rotation about the vertical that the places give.
    pub yaw_sigma_rad: f64,
}

/// Where a model lies, by least squares, reweighted so that single wrong readings do not matter. What nothing tells stays as it is;
/// `None` where it is not known which way is up.
pub(crate) fn place(attitude: &Attitude, places: &[Place], with_scale: bool) -> Option<Placement> {
    let level = up(&attitude.ups).map(|up| between(&up, &Vector3::z()));
    let level_and_north = level.map(|level| north(level, &attitude.headings));
    let mut robust = vec![1.0; places.len()];
    let mut world_from_model = Similarity3::from_scale(1.0);
    let (mut scale_sigma, mut yaw_sigma_rad) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..ROUNDS {
        world_from_model.rotation = match level_and_north {
            Some((rotation, true)) => rotation,
            Some((level, false)) => {
                let (yaw, sigma) = yaw(places, &robust, level, world_from_model.scale);
                yaw_sigma_rad = sigma;
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * level
            }
            None => {
                yaw_sigma_rad = 0.0;
                free(places, &robust, with_scale)?
            }
        };
        (world_from_model.scale, scale_sigma) = if with_scale { scale(places, &robust, &world_from_model) } else { (1.0, 0.0) };
        world_from_model.translation = translation(places, &robust, &world_from_model);
        for (w, p) in robust.iter_mut().zip(places) {
            let v = world_from_model.apply(&p.in_model) - p.in_world;
            let square: f64 = (0..3).map(|k| v[k] * v[k] * p.weight(k)).sum();
            *w = half_weight(square);
        }
    }
    Some(Placement { world_from_model, scale_sigma, yaw_sigma_rad })
}

fn half_weight(square: f64) -> f64 {
    1.0 / (1.0 + square / (HALF_WEIGHT * HALF_WEIGHT))
}

/// The robust mean of the directions.
fn up(ups: &[(Vector3<f64>, f64)]) -> Option<Vector3<f64>> {
    let mut mean = Vector3::zeros();
    for round in 0..ROUNDS {
        let mut sum = Vector3::zeros();
        for (u, sigma) in ups {
            let u = u.normalize();
            let robust = if round == 0 { 1.0 } else { half_weight((u.cross(&mean).norm().atan2(u.dot(&mean)) / sigma).powi(2)) };
            sum += robust / (sigma * sigma) * u;
        }
        mean = sum.try_normalize(0.0)?;
    }
    Some(mean)
}

/// The shortest rotation that takes one unit vector to another.
fn between(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    // Half a turn has no shortest way: any axis across will do.
    UnitQuaternion::rotation_between(from, to).unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}

/// Turns a levelled model to the north, and says whether any heading told where that is.
fn north(level: UnitQuaternion<f64>, headings: &[(Vector3<f64>, f64, f64)]) -> (UnitQuaternion<f64>, bool) {
    let mut turn: Option<f64> = None;
    for _ in 0..ROUNDS {
        let (mut sin, mut cos) = (0.0, 0.0);
        for (axis, heading, sigma) in headings {
            let axis = level * axis;
            // Headings run clockwise, rotations about the vertical the other way.
            let needed = axis.x.atan2(axis.y) - heading;
            let off = turn.map_or(0.0, |t| (needed - t).sin().atan2((needed - t).cos()));
            // The heading of a steep axis is that much less certain.
            let weight = axis.xy().norm_squared() * half_weight((off / sigma).powi(2)) / (sigma * sigma);
            sin += weight * needed.sin();
            cos += weight * needed.cos();
        }
        if sin == 0.0 && cos == 0.0 {
            return (level, false);
        }
        turn = Some(sin.atan2(cos));
    }
    (UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn.unwrap_or(0.0)) * level, true)
}

/// Weighted means of a place along an axis of the world, of the turned model and of the world.
fn means(places: &[Place], robust: &[f64], axis: usize, turned: impl Fn(&Place) -> f64) -> Option<(f64, f64)> {
    let (mut total, mut model, mut world) = (0.0, 0.0, 0.0);
    for (p, r) in places.iter().zip(robust) {
        let w = r * p.weight(axis);
        if w > 0.0 {
            (total, model, world) = (total + w, model + w * turned(p), world + w * p.in_world[axis]);
        }
    }
    (total > 0.0).then(|| (model / total, world / total))
}

/// The rotation about the vertical of a levelled model of a known scale, and its standard deviation.
fn yaw(places: &[Place], robust: &[f64], level: UnitQuaternion<f64>, model_scale: f64) -> (f64, f64) {
    let of = |axis: usize| means(places, robust, axis, |p| (level * p.in_model)[axis]);
    let (Some((mx, wx)), Some((my, wy))) = (of(0), of(1)) else { return (0.0, f64::INFINITY) };
    let (mut sin, mut cos, mut information) = (0.0, 0.0, 0.0);
    for (p, r) in places.iter().zip(robust) {
        let w = r * p.weight(0).min(p.weight(1));
        let m = level * p.in_model;
        let (a, b, c, d) = (m.x - mx, m.y - my, p.in_world.x - wx, p.in_world.y - wy);
        if w > 0.0 {
            sin += w * (a * d - b * c);
            cos += w * (a * c + b * d);
            information += w * (c * c + d * d).min(model_scale * model_scale * (a * a + b * b));
        }
    }
    (sin.atan2(cos), 1.0 / information.sqrt())
}

/// The rotation that places known along all axes give; `None` where they do not fix it.
fn free(places: &[Place], robust: &[f64], with_scale: bool) -> Option<UnitQuaternion<f64>> {
    let known: Vec<(&Place, f64)> = places
        .iter()
        .zip(robust)
        .map(|(p, r)| (p, r * (0..3).map(|k| p.weight(k)).fold(f64::INFINITY, f64::min)))
        .filter(|(_, w)| *w > 0.0)
        .collect();
    let (from, to): (Vec<_>, Vec<_>) = known.iter().map(|(p, _)| (p.in_model, p.in_world)).unzip();
    let weights: Vec<f64> = known.iter().map(|(_, w)| *w).collect();
    let found = Similarity3::align_weighted(&from, &to, &weights, with_scale)?;
    // The worst known rotation is that about the longest extent.
    let total: f64 = weights.iter().sum();
    let mean = to.iter().zip(&weights).map(|(x, w)| x * *w).sum::<Vector3<f64>>() / total;
    let spread = to.iter().zip(&weights).map(|(x, w)| *w * (x - mean) * (x - mean).transpose()).sum::<nalgebra::Matrix3<f64>>();
    let mut extents = spread.symmetric_eigenvalues();
    extents.as_mut_slice().sort_by(f64::total_cmp);
    (1.0 / (extents[0] + extents[1]).max(0.0).sqrt() <= MAX_ROTATION_SIGMA_RAD).then_some(found.rotation)
}

/// The scale of a turned model and its relative standard deviation.
fn scale(places: &[Place], robust: &[f64], world_from_model: &Similarity3) -> (f64, f64) {
    let (mut up, mut down) = (0.0, 0.0);
    for axis in 0..3 {
        let turned = |p: &Place| (world_from_model.rotation * p.in_model)[axis];
        let Some((m, w)) = means(places, robust, axis, turned) else { continue };
        for (p, r) in places.iter().zip(robust) {
            let weight = r * p.weight(axis);
            if weight > 0.0 {
                up += weight * (turned(p) - m) * (p.in_world[axis] - w);
                down += weight * (turned(p) - m).powi(2);
            }
        }
    }
    let found = up / down;
    if found.is_finite() && found > 0.0 { (found, 1.0 / (found * down.sqrt())) } else { (world_from_model.scale, f64::INFINITY) }
}

/// The shift along each axis; none where nothing tells it.
fn translation(places: &[Place], robust: &[f64], world_from_model: &Similarity3) -> Vector3<f64> {
    let turned = Similarity3 { translation: Vector3::zeros(), ..*world_from_model };
    Vector3::from_fn(|axis, _| means(places, robust, axis, |p| turned.apply(&p.in_model)[axis]).map_or(0.0, |(m, w)| w - m))
}
