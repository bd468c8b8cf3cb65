//! Bodies as signed distances: shapes joined, cut and grown over.

use crate::appearance::gradient_noise;
use nalgebra::{UnitQuaternion, Vector3};

/// Thickness of a ship's frame, metres.
const FRAME_M: f64 = 0.09;

/// A simple body. Distances are negative inside; none exceeds the true distance to the surface.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// A box with rounded edges.
    Block { centre: Vector3<f64>, half: Vector3<f64>, round: f64, turn: UnitQuaternion<f64> },
    /// A cylinder with flat ends.
    Cylinder { from: Vector3<f64>, axis: Vector3<f64>, length: f64, radius: f64 },
    /// The skin of a ship about the x axis: `length` long, `beam` wide, `depth` deep, `skin` thick, open above.
    Hull { length: f64, beam: f64, depth: f64, skin: f64 },
    /// The frames of that ship: every `spacing` along it.
    Frames { length: f64, beam: f64, depth: f64, height: f64, spacing: f64 },
}

impl Shape {
    /// A box between two corners.
    pub fn block(low: [f64; 3], high: [f64; 3], round: f64) -> Self {
        let (low, high) = (Vector3::from(low), Vector3::from(high));
        Self::Block { centre: (low + high) / 2.0, half: (high - low) / 2.0, round, turn: UnitQuaternion::identity() }
    }

    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        match self {
            Self::Block { centre, half, round, turn } => {
                let q = (turn.inverse() * (p - centre)).abs() - half + Vector3::repeat(*round);
                q.sup(&Vector3::zeros()).norm() + q.max().min(0.0) - round
            }
            Self::Cylinder { from, axis, length, radius } => {
                let along = (p - from).dot(axis);
                let (beside, beyond) = ((p - from - along * axis).norm() - radius, (along - length / 2.0).abs() - length / 2.0);
                beside.max(0.0).hypot(beyond.max(0.0)) + beside.max(beyond).min(0.0)
            }
            Self::Hull { length, beam, depth, skin } => {
                let outside = hull(p, *length, *beam, *depth);
                (outside.abs() - skin / 2.0).max(p.z)
            }
            Self::Frames { length, beam, depth, height, spacing } => {
                let inside = (hull(p, *length, *beam, *depth) + height / 2.0).abs() - height / 2.0;
                let beside = ((p.x / spacing - (p.x / spacing).round()) * spacing).abs() - FRAME_M / 2.0;
                inside.max(beside).max(p.z)
            }
        }
    }
}

/// A distance to the surface of a ship's form, negative inside: sections are ellipses that narrow towards the ends.
fn hull(p: &Vector3<f64>, length: f64, beam: f64, depth: f64) -> f64 {
    let t = (2.0 * p.x / length).clamp(-1.0, 1.0);
    let full = (1.0 - t.powi(4)).max(0.02);
    let (a, b) = (beam / 2.0 * full, depth * full.sqrt());
    let (y, z) = (p.y / a, p.z.min(0.0) / b);
    let radius = y.hypot(z);
    // The gradient of the implicit form makes a distance of it, and the ends are closed.
    let slope = ((y / a).powi(2) + (z / b).powi(2)).sqrt() / radius.max(1e-6);
    (0.7 * (radius - 1.0) / slope.max(1e-6)).max(p.x.abs() - length / 2.0)
}

/// Shapes joined, others cut out of them, and growth over all.
#[derive(Clone, Debug, Default)]
pub(super) struct Solid {
    pub add: Vec<Shape>,
    pub cut: Vec<Shape>,
    /// Largest thickness of the growth, metres.
    pub growth_m: f64,
    pub seed: u32,
}

impl Solid {
    /// Signed distance to the surface, negative inside; the growth makes it inexact by its thickness.
    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        let joined = self.add.iter().map(|s| s.distance(p)).fold(f64::INFINITY, f64::min);
        let bare = self.cut.iter().map(|s| -s.distance(p)).fold(joined, f64::max);
        // Far from the surface the growth does not matter.
        if self.growth_m == 0.0 || bare.abs() > 2.0 * self.growth_m { bare } else { bare - self.growth(p) }
    }

    /// Turf everywhere, lumps of sponge and coral here and there.
    fn growth(&self, p: &Vector3<f64>) -> f64 {
        let x = p.cast::<f32>();
        let octave = |wavelength: f32, k: u32| gradient_noise(&(x / wavelength), self.seed ^ (0x6000 + k));
        let cover = (octave(0.55, 0) + 0.25).clamp(0.0, 1.0);
        let lumps = (octave(0.16, 1) + 0.5 * octave(0.085, 2)).max(0.0);
        let turf = 0.5 + octave(0.045, 3);
        self.growth_m * f64::from((cover * (0.35 * turf + 1.1 * lumps) + 0.08 * turf).clamp(-0.1, 1.0))
    }

    /// The unit normal of the surface near a point: differences over a step.
    pub fn normal(&self, p: &Vector3<f64>, step: f64) -> Vector3<f64> {
        let slope = |axis: Vector3<f64>| self.distance(&(p + axis * step)) - self.distance(&(p - axis * step));
        Vector3::new(slope(Vector3::x()), slope(Vector3::y()), slope(Vector3::z())).try_normalize(1e-12).unwrap_or(Vector3::z())
    }

    /// The same body near a place: shapes that do not matter within `radius` of `centre` are left out.
    pub fn near(&self, centre: &Vector3<f64>, radius: f64) -> Self {
        let nearest = self.add.iter().map(|s| s.distance(centre)).fold(f64::INFINITY, f64::min);
        let reach = radius + 2.0 * self.growth_m;
        Self {
            add: self.add.iter().filter(|s| s.distance(centre) <= nearest + 2.0 * reach).cloned().collect(),
            cut: self.cut.iter().filter(|s| s.distance(centre) <= 2.0 * reach + nearest.max(0.0)).cloned().collect(),
            ..*self
        }
    }
}
