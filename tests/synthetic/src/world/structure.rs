//! What stands on the bottom: reef, wreck, pipeline.

use super::nets;
use super::part::{Label, Material, Part};
use super::solid::{Shape, Solid};
use crate::random::{Random, mix};
use nalgebra::{UnitQuaternion, Vector3};

/// The sides of concrete are rounded by this, metres.
const ROUND_M: f64 = 0.025;
/// Half the side of the reef, metres.
pub(super) const REEF_HALF_M: f64 = 1.5;

/// The reef: slabs, posts and beams, 3 m wide and high, with openings that one sees the water through.
pub(super) fn reef(growth_m: f64, seed: u32) -> Solid {
    let h = REEF_HALF_M;
    let block = |low: [f64; 3], high: [f64; 3]| Shape::block(low, high, ROUND_M);
    let mut add = vec![
        block([-h, -h, -0.25], [h, h, 0.22]),
        block([-h, -h, 2.78], [h, h, 3.0]),
        // A shelf at half height, two walls that close parts of two sides, a block inside.
        block([-h + 0.3, -0.2, 1.45], [h - 0.3, h - 0.25, 1.6]),
        block([-h, h - 0.18, 0.2], [-0.35, h, 1.55]),
        block([h - 0.18, -0.9, 1.5], [h, 0.5, 2.85]),
        block([-0.45, -0.55, 0.2], [0.45, 0.25, 0.85]),
    ];
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let (x, y): (f64, f64) = (sx * (h - 0.19), sy * (h - 0.19));
        add.push(block([x - 0.19, y - 0.19, 0.1], [x + 0.19, y + 0.19, 2.9]));
    }
    for side in [-1.0, 1.0] {
        let a: f64 = side * (h - 0.14);
        add.push(block([-h + 0.2, a - 0.11, 1.35], [h - 0.2, a + 0.11, 1.65]));
        add.push(block([a - 0.11, -h + 0.2, 1.35], [a + 0.11, h - 0.2, 1.65]));
        // Braces that lean.
        let turn = UnitQuaternion::from_scaled_axis(Vector3::y() * (0.72 * side));
        let centre = Vector3::new(0.62 * side, -h + 0.14, 0.78);
        add.push(Shape::Block { centre, half: Vector3::new(0.08, 0.08, 0.85), round: ROUND_M, turn });
    }
    let cut = vec![
        // Openings in the top, the base, the walls.
        block([-0.55, -0.55, 2.5], [0.55, 0.55, 3.4]),
        block([0.85, 0.75, 2.5], [1.15, 1.05, 3.4]),
        block([-1.15, -1.1, 2.5], [-0.8, -0.75, 3.4]),
        block([-1.1, h - 0.5, 0.6], [-0.7, h + 0.3, 1.05]),
        block([h - 0.5, -0.5, 1.85], [h + 0.3, -0.05, 2.35]),
        block([-0.16, -1.0, 0.42], [0.16, 0.6, 0.68]),
    ];
    Solid { add, cut, growth_m, seed }
}

/// A wreck: the skin of a hull with plates missing, its frames, a deck house; it lies on its side a little.
pub(super) fn wreck(growth_m: f64, seed: u32) -> (Solid, UnitQuaternion<f64>, Vector3<f64>) {
    let (length, beam, depth) = (12.0, 3.2, 2.0);
    let mut random = Random::new(mix(u64::from(seed) ^ 0xB0A7));
    let add = vec![
        Shape::Hull { length, beam, depth, skin: 0.09 },
        Shape::Frames { length, beam, depth, height: 0.22, spacing: 0.75 },
        Shape::block([-0.2, -0.06, -2.05], [5.6, 0.06, -1.75], 0.02),
        Shape::block([1.2, -1.35, -0.12], [3.6, 1.35, 0.0], 0.03),
        Shape::block([1.5, -0.9, -0.1], [3.0, 0.9, 0.95], 0.04),
    ];
    // Plates that fell off: one sees the water between the frames.
    let mut cut: Vec<Shape> = (0..7)
        .map(|k| {
            let (x, side) = (-4.2 + 1.35 * f64::from(k), if k % 2 == 1 { 1.0 } else { -1.0 });
            let (z, size) = (random.range(-1.2, -0.5), random.range(0.22, 0.4));
            let centre = Vector3::new(x, side * 1.6, z);
            Shape::Block { centre, half: Vector3::new(0.31, 1.0, size), round: 0.05, turn: UnitQuaternion::identity() }
        })
        .collect();
    cut.push(Shape::block([1.7, -0.7, 0.05], [2.8, 0.7, 0.85], 0.02));
    cut.push(Shape::block([1.3, -0.3, 0.25], [1.9, 0.3, 0.7], 0.02));
    let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.42) * UnitQuaternion::from_scaled_axis(Vector3::y() * 0.05);
    (Solid { add, cut, growth_m: 0.6 * growth_m, seed }, turn, Vector3::new(0.0, 0.0, 1.25))
}

/// A pipeline along x: half buried, then over a free span, with joints and two mattresses of blocks.
pub(super) fn pipeline(half_m: f64, growth_m: f64, seed: u32) -> (Solid, Solid) {
    let cylinder =
        |from: f64, length: f64, radius: f64| Shape::Cylinder { from: Vector3::new(from, 0.0, 0.22), axis: Vector3::x(), length, radius };
    let mut pipe = Solid { add: vec![cylinder(-half_m, 2.0 * half_m, 0.25)], growth_m: 0.4 * growth_m, seed, ..Solid::default() };
    let joints = (half_m / 3.0) as i32;
    pipe.add.extend((-joints..=joints).map(|k| cylinder(3.0 * f64::from(k) - 0.14, 0.28, 0.275)));
    let mut mats = Solid { growth_m: 0.3 * growth_m, seed: seed ^ 0x3, ..Solid::default() };
    for middle in [-0.55 * half_m, 0.5 * half_m] {
        for row in -2..=2 {
            for column in -3i32..=3 {
                // Blocks lie over the pipe and hang down beside it.
                let angle = f64::from(column) * 0.42;
                let (y, z) = (0.36 * angle.sin() * (1.0 + 0.25 * angle.abs()), 0.22 + 0.36 * angle.cos() - 0.04 * angle * angle);
                mats.add.push(Shape::Block {
                    centre: Vector3::new(middle + 0.36 * f64::from(row), y, z),
                    half: Vector3::new(0.15, 0.065, 0.06),
                    round: 0.03,
                    turn: UnitQuaternion::from_scaled_axis(Vector3::x() * -angle),
                });
            }
        }
    }
    (pipe, mats)
}

/// The part of a solid between two corners; what lies more than 5 cm under the sand is left out.
pub(super) fn part(name: &'static str, material: Material, solid: &Solid, corners: [[f64; 3]; 2], cell_m: f64) -> Part {
    let (mesh, normals) = nets::mesh(solid, corners[0].into(), corners[1].into(), cell_m);
    Part { name, label: Label::Structure, material, mesh, normals }
}

/// Leaves out the faces that lie under the sand.
pub(super) fn unbury(part: &mut Part, sand: impl Fn(f64, f64) -> f64) {
    let buried: Vec<bool> = part.mesh.vertices.iter().map(|v| v.z < sand(v.x, v.y) - 0.05).collect();
    part.mesh.faces.retain(|face| !face.iter().all(|&v| buried[v as usize]));
}
