//! Random problems with known answers, for tests.

use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::Rigid3;

/// A seeded source of numbers.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// In [low, high).
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal (Box & Muller).
    pub(crate) fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(0.0, 1.0), self.uniform(0.0, std::f64::consts::TAU));
        (-2.0 * u.ln()).sqrt() * v.cos()
    }

    pub(crate) fn vector(&mut self, half_side: f64) -> Vector3<f64> {
        Vector3::new(self.uniform(-half_side, half_side), self.uniform(-half_side, half_side), self.uniform(-half_side, half_side))
    }

    pub(crate) fn rotation(&mut self, max_angle: f64) -> UnitQuaternion<f64> {
        let axis = Vector3::new(self.normal(), self.normal(), self.normal()).normalize();
        UnitQuaternion::from_scaled_axis(axis * self.uniform(0.0, max_angle))
    }

    /// A pose with a unit translation.
    pub(crate) fn relative_pose(&mut self, max_angle: f64) -> Rigid3 {
        let t = Vector3::new(self.normal(), self.normal(), self.normal()).normalize();
        Rigid3::new(self.rotation(max_angle), t)
    }
}

/// What the two images of a relative problem look at.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Scene {
    /// Points at depths 2 to 8.
    Volume,
    /// Points of a slanted plane.
    Plane,
}

/// Two views of points, in normalised coordinates.
pub(crate) struct TwoViews {
    pub pose: Rigid3,
    pub x1: Vec<Vector2<f64>>,
    pub x2: Vec<Vector2<f64>>,
    /// The points in the first camera.
    pub points: Vec<Vector3<f64>>,
}

/// `n` points in front of both cameras with noise of the given standard deviation; the first `outliers` pairs are random.
pub(crate) fn two_views(random: &mut Random, scene: Scene, n: usize, noise: f64, outliers: usize) -> TwoViews {
    let pose = random.relative_pose(0.5);
    two_views_of(random, pose, scene, n, noise, outliers)
}

pub(crate) fn two_views_of(random: &mut Random, pose: Rigid3, scene: Scene, n: usize, noise: f64, outliers: usize) -> TwoViews {
    let mut out = TwoViews { pose, x1: Vec::new(), x2: Vec::new(), points: Vec::new() };
    let normal = Vector3::new(random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), 1.0);
    while out.x1.len() < n {
        let ray = Vector3::new(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7), 1.0);
        let depth = if scene == Scene::Volume { random.uniform(2.0, 8.0) } else { 4.0 / normal.dot(&ray) };
        let x = ray * depth;
        let y = out.pose.apply(&x);
        if y.z < 0.5 {
            continue;
        }
        let mut a = x.xy() / x.z;
        let mut b = y.xy() / y.z;
        if out.x1.len() < outliers {
            a = Vector2::new(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7));
            b = Vector2::new(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7));
        }
        out.x1.push(a + Vector2::new(random.normal(), random.normal()) * noise);
        out.x2.push(b + Vector2::new(random.normal(), random.normal()) * noise);
        out.points.push(x);
    }
    out
}

/// Smallest distance of two matrices up to sign, both scaled to norm 1.
pub(crate) fn distance_up_to_scale(a: &nalgebra::Matrix3<f64>, b: &nalgebra::Matrix3<f64>) -> f64 {
    let (a, b) = (a / a.norm(), b / b.norm());
    (a - b).norm().min((a + b).norm())
}
