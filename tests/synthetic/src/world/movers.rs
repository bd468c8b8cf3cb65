//! What moves: a second vehicle with a scale bar, its tether, fish.

use super::bottom::ball;
use super::nets;
use super::panel::{Art, Panel};
use super::part::{Label, Material, Part};
use super::solid::{Shape, Solid};
use crate::random::{Random, mix};
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use scene::{Mesh, Rigid3};
use std::f64::consts::TAU;

/// Length of the bar that the second vehicle carries, metres: that of Rofallski et al. 2020.
pub const CARRIED_BAR_M: f64 = 0.825_222;
/// Points along the tether.
const TETHER_POINTS: usize = 40;

/// Something that moves.
#[derive(Clone, Debug)]
pub enum Mover {
    /// A rigid body.
    Body {
        /// In its own frame.
        parts: Vec<Part>,
        /// Its way.
        way: Way,
    },
    /// A cable that hangs from the surface to a body.
    Tether {
        /// The way of the body it ends at.
        way: Way,
        /// Radius, metres.
        radius_m: f64,
    },
}

/// A smooth closed path: a point of x forward, z up, that turns as it goes.
#[derive(Clone, Debug)]
pub struct Way {
    centre: Vector3<f64>,
    radius: [f64; 2],
    rise: f64,
    period_s: f64,
    phase: f64,
    /// Radians by which the body looks aside from where it goes.
    aside: f64,
}

impl Way {
    fn place(&self, time_s: f64) -> Vector3<f64> {
        let a = self.phase + TAU * time_s / self.period_s;
        let wander = 0.25 * (2.0 * a + 1.0).sin();
        self.centre + Vector3::new(self.radius[0] * (a + wander).cos(), self.radius[1] * a.sin(), self.rise * (1.7 * a).sin())
    }

    /// Where the body is at a time.
    #[must_use]
    pub fn world_from_body(&self, time_s: f64) -> Rigid3 {
        let place = self.place(time_s);
        let step = 1e-3 * self.period_s;
        let ahead = self.place(time_s + step) - place;
        let x = UnitQuaternion::from_scaled_axis(Vector3::z() * self.aside) * Vector3::new(ahead.x, ahead.y, 0.3 * ahead.z).normalize();
        let y = Vector3::z().cross(&x).normalize();
        let z = x.cross(&y);
        Rigid3::from_matrix(&Matrix3::from_columns(&[x, y, z]), place)
    }
}

impl Mover {
    /// Its parts in the world at a time, and where its body is.
    #[must_use]
    pub fn at(&self, time_s: f64) -> (Vec<Part>, Rigid3) {
        match self {
            Self::Body { parts, way } => {
                let world_from_body = way.world_from_body(time_s);
                (parts.iter().map(|part| part.moved(&world_from_body)).collect(), world_from_body)
            }
            Self::Tether { way, radius_m } => {
                let end = way.world_from_body(time_s).apply(&Vector3::new(-0.15, 0.0, 0.2));
                (vec![tether(&end, *radius_m, time_s)], Rigid3::identity())
            }
        }
    }
}

/// A school of fish about a place.
pub(super) fn fish(count: u32, centre: Vector3<f64>, half_m: f64, seed: u32) -> Vec<Mover> {
    let mut random = Random::new(mix(u64::from(seed) ^ 0xF15));
    (0..count)
        .map(|_| {
            let length = random.range(0.15, 0.35);
            let (angle, away) = (random.range(0.0, TAU), random.range(0.3, half_m));
            let place = centre + Vector3::new(away * angle.cos(), away * angle.sin(), random.range(-0.6, 1.6));
            let way = Way {
                centre: place,
                radius: [random.range(0.5, 1.6), random.range(0.3, 1.2)],
                rise: random.range(0.05, 0.25),
                period_s: random.range(9.0, 25.0),
                phase: random.range(0.0, TAU),
                aside: 0.0,
            };
            Mover::Body { parts: vec![fish_body(length)], way }
        })
        .collect()
}

/// A body that is high and thin, with a tail.
fn fish_body(length: f64) -> Part {
    let mut mesh = ball(2);
    for v in &mut mesh.vertices {
        // x forward: blunt in front, drawn out to the tail.
        let taper = 1.0 - 0.55 * (0.5 - 0.5 * v.x).powi(2);
        *v = Point3::new(0.42 * length * v.x, 0.075 * length * taper * v.y, 0.17 * length * taper * v.z);
    }
    let first = mesh.vertices.len() as u32;
    for (x, z) in [(-0.36, 0.03), (-0.36, -0.03), (-0.56, 0.13), (-0.56, -0.13), (-0.50, 0.0)] {
        mesh.vertices.push(Point3::new(x * length, 0.0, z * length));
    }
    mesh.faces.extend([[0, 2, 4], [0, 4, 1], [1, 4, 3]].map(|f| f.map(|v: u32| v + first)));
    Part::new("fish", Label::Fish, Material::Fish, mesh)
}

/// The second vehicle: frame, hull, thrusters, and in front of it a bar with a coded target at each end. Its panel gets the number
/// `panel`.
pub(super) fn vehicle(centre: Vector3<f64>, panel: usize, seed: u32) -> (Way, Vec<Part>, Panel) {
    let block = |low: [f64; 3], high: [f64; 3]| Shape::block(low, high, 0.015);
    let tube = |from: [f64; 3], axis: Vector3<f64>, length: f64, radius: f64| Shape::Cylinder { from: from.into(), axis, length, radius };
    let frame = Solid {
        add: vec![
            block([-0.23, -0.17, -0.13], [0.23, -0.15, 0.09]),
            block([-0.23, 0.15, -0.13], [0.23, 0.17, 0.09]),
            block([-0.20, -0.16, -0.12], [0.20, 0.16, -0.10]),
            tube([-0.2, 0.0, -0.01], Vector3::x(), 0.4, 0.058),
            tube([-0.12, -0.13, 0.03], Vector3::z(), 0.09, 0.05),
            tube([-0.12, 0.13, 0.03], Vector3::z(), 0.09, 0.05),
            tube([0.12, -0.13, 0.03], Vector3::z(), 0.09, 0.05),
            tube([0.12, 0.13, 0.03], Vector3::z(), 0.09, 0.05),
        ],
        ..Solid::default()
    };
    let foam = Solid { add: vec![block([-0.21, -0.14, 0.08], [0.21, 0.14, 0.17])], ..Solid::default() };
    let part = |name, solid: &Solid, albedo| {
        let (mesh, normals) = nets::mesh(solid, Vector3::repeat(-0.3), Vector3::repeat(0.3), 0.012);
        Part { name, label: Label::Vehicle, material: Material::Plain { albedo }, mesh, normals }
    };
    let half = CARRIED_BAR_M / 2.0 + 0.05;
    // The bar is a plate, printed on its front.
    let board = plate([0.30, half, 0.05], [0.29, -half, -0.05]);
    let front = Panel {
        origin: Vector3::new(0.30, -half, 0.05),
        u: Vector3::y(),
        v: -Vector3::z(),
        size_m: [2.0 * half, 0.1],
        art: Art::Rings {
            radius_m: 0.014,
            centres: vec![[half - CARRIED_BAR_M / 2.0, 0.05], [half + CARRIED_BAR_M / 2.0, 0.05]],
            first_code: 17 + seed % 100,
        },
    };
    let parts = vec![
        part("vehicle frame", &frame, [0.05, 0.05, 0.06]),
        part("vehicle foam", &foam, [0.55, 0.30, 0.03]),
        Part::new("carried bar", Label::Vehicle, Material::Panel(panel), board),
    ];
    // It faces the middle of the scene's front, and hovers.
    let way = Way { centre, radius: [0.35, 0.12], rise: 0.08, period_s: 55.0, phase: 1.0, aside: 0.4 };
    (way, parts, front)
}

/// A box as twelve triangles.
pub(super) fn plate(a: [f64; 3], b: [f64; 3]) -> Mesh {
    let corner =
        |i: usize| Point3::from(std::array::from_fn::<f64, 3, _>(|k| if i >> k & 1 == 1 { a[k].max(b[k]) } else { a[k].min(b[k]) }));
    // Each side has its own corners, so that its normal is flat; counter-clockwise from outside.
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut mesh = Mesh::default();
    for side in sides {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(side.map(corner));
        mesh.faces.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// A thin tube from the surface to its end, swaying.
fn tether(end: &Vector3<f64>, radius_m: f64, time_s: f64) -> Part {
    let top = end + Vector3::new(1.8, 2.4, 12.0);
    let along = |t: f64| {
        let sway = t * (1.0 - t) * 4.0;
        let swing = Vector3::new((0.31 * time_s + 5.0 * t).sin(), (0.23 * time_s + 4.0 * t + 1.0).cos(), 0.0) * (0.22 * sway);
        end + (top - end) * t + swing - Vector3::z() * (0.9 * sway)
    };
    let mut mesh = Mesh::default();
    for i in 0..TETHER_POINTS {
        let t = (i as f64 / (TETHER_POINTS - 1) as f64).powi(2);
        for k in 0..6 {
            let a = TAU * f64::from(k) / 6.0;
            mesh.vertices.push((along(t) + Vector3::new(a.cos(), a.sin(), 0.0) * radius_m).into());
        }
    }
    for i in 0..TETHER_POINTS as u32 - 1 {
        for k in 0..6 {
            let (a, b, c, d) = (6 * i + k, 6 * i + (k + 1) % 6, 6 * i + 6 + (k + 1) % 6, 6 * i + 6 + k);
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    Part::new("tether", Label::Tether, Material::Plain { albedo: [0.62, 0.52, 0.06] }, mesh)
}
