//! Two-view and multi-view triangulation.

use super::view::View;
use nalgebra::{Matrix3, Vector3};

/// Rays that differ by less than this, in radians, are parallel: the distance would have no correct digit.
const MIN_ANGLE_RAD: f64 = 1e-5;
/// Gauss-Newton steps: two or three are usual.
const MAX_STEPS: usize = 10;
/// A step below this share of the distance to the nearest camera ends the iteration.
const STEP_TOLERANCE: f64 = 1e-8;

/// Angle in radians at `x` between the directions to two projection centres; 0 where `x` is one of them.
#[must_use]
pub fn triangulation_angle(c1: &Vector3<f64>, c2: &Vector3<f64>, x: &Vector3<f64>) -> f64 {
    angle(&(c1 - x), &(c2 - x))
}

/// Angle between two directions, exact for small ones too.
pub(super) fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}

/// The point between two rays, weighted by inverse distance.
///
/// Lee & Civera, *Triangulation: why optimize?*, BMVC 2019: with baseline t, rays f0, f1 and r_i the distances along them, the mean of
/// both foot points in proportion to their inverse distances; close to the least reprojection error at 1 % of
/// its cost. Accurate for low parallax, where the plain midpoint is not. `None` for rays that are parallel (closer than 1e-5 rad, in either direction),
/// equal centres, and points behind a camera.
#[must_use]
pub fn triangulate_two(a: &View, b: &View) -> Option<Vector3<f64>> {
    let (f0, f1) = (a.ray_in_world(), b.ray_in_world());
    let baseline = b.centre() - a.centre();
    let normal = f0.cross(f1);
    let sine = normal.norm();
    // Distances up to the common factor 1 / sine: |f1 x t| and |f0 x t|.
    let (d0, d1) = (f1.cross(&baseline).norm(), f0.cross(&baseline).norm());
    if !(sine > MIN_ANGLE_RAD && d0 + d1 > 0.0) {
        return None;
    }
    // On the side of the rays, by the signed distances to the feet of the common perpendicular.
    let square = sine * sine;
    let (s0, s1) = (baseline.cross(f1).dot(&normal) / square, baseline.cross(f0).dot(&normal) / square);
    if !(s0 > 0.0 && s1 > 0.0) {
        return None;
    }
    let (p0, p1) = (a.centre() + f0 * (d0 / sine), b.centre() + f1 * (d1 / sine));
    let x = (p0 * d1 + p1 * d0) / (d0 + d1);
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// The point of least reprojection error in two or more views.
///
/// Starts at the point of least squared distance to the rays and minimises the sum of the squared pixel errors (Hartley & Sturm,
/// *Triangulation*, CVIU 1997) by Gauss-Newton, with steps that raise it halved. `None` for fewer than two views,
/// when all rays are parallel to about 1e-5 rad, and when the start or the result lies behind a camera. Every view counts in full:
/// with outliers use [`super::triangulate_robust`].
#[must_use]
pub fn triangulate(views: &[View]) -> Option<Vector3<f64>> {
    refine_point(views.iter(), &nearest_to_rays(views.iter())?)
}

/// Minimises the sum of `|(I - f f^T)(x - c)|^2`.
pub(super) fn nearest_to_rays<'a>(views: impl Iterator<Item = &'a View> + Clone) -> Option<Vector3<f64>> {
    let mut a = Matrix3::zeros();
    let mut b = Vector3::zeros();
    // Relative to the first centre: world coordinates may be large.
    let origin = *views.clone().next()?.centre();
    for view in views {
        let f = view.ray_in_world();
        let projector = Matrix3::identity() - f * f.transpose();
        a += projector;
        b += projector * (view.centre() - origin);
    }
    // For rays close to one direction the smallest eigenvalue is near det / (sum of the principal minors); two rays at an
    // angle w have 1 - cos w. This also refuses a single view.
    let minors = 0.5 * (a.trace() * a.trace() - a.norm_squared());
    let determinant = a.determinant();
    if determinant.is_nan() || determinant <= 0.5 * MIN_ANGLE_RAD * MIN_ANGLE_RAD * minors {
        return None;
    }
    a.cholesky().map(|factor| origin + factor.solve(&b))
}

/// Gauss-Newton on the pixel errors; `None` when the start does not project into every view.
///
/// Each trial costs one projection with derivatives a view, whether it is accepted or not.
pub(super) fn refine_point<'a>(views: impl Iterator<Item = &'a View> + Clone, start: &Vector3<f64>) -> Option<Vector3<f64>> {
    let mut x = *start;
    let mut normal = normal_equations(views.clone(), &x)?;
    let nearest = views.clone().map(|v| (x - v.centre()).norm_squared()).fold(f64::INFINITY, f64::min);
    let mut step = normal.step();
    for _ in 0..MAX_STEPS {
        if step.norm_squared() <= STEP_TOLERANCE * STEP_TOLERANCE * nearest {
            break;
        }
        let candidate = x + step;
        match normal_equations(views.clone(), &candidate).filter(|n| n.cost < normal.cost) {
            Some(next) => {
                x = candidate;
                normal = next;
                step = normal.step();
            }
            None => step *= 0.5,
        }
    }
    Some(x)
}

struct PointNormal {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    cost: f64,
}

impl PointNormal {
    /// The step of Gauss and Newton; zero where the point is not determined.
    fn step(&self) -> Vector3<f64> {
        self.hessian.cholesky().map_or_else(Vector3::zeros, |factor| -factor.solve(&self.gradient))
    }
}

/// `None` when the point does not project into every view.
fn normal_equations<'a>(views: impl Iterator<Item = &'a View>, x: &Vector3<f64>) -> Option<PointNormal> {
    let mut out = PointNormal { hessian: Matrix3::zeros(), gradient: Vector3::zeros(), cost: 0.0 };
    for view in views {
        let projected = view.project_with_jacobians(x)?;
        let j = projected.d_point * view.rotation();
        let r = projected.pixel - view.pixel();
        out.hessian += j.transpose() * j;
        out.gradient += j.tr_mul(&r);
        out.cost += r.norm_squared();
    }
    out.cost.is_finite().then_some(out)
}
