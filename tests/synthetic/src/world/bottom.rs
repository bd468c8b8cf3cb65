//! The sandy bottom and the stones on it.

use super::part::{Label, Material, Part};
use crate::appearance::gradient_noise;
use crate::random::{Random, mix};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use scene::Mesh;
use std::collections::HashMap;

/// Wavelength of the ripples, metres.
const RIPPLE_M: f64 = 0.24;

/// Height of the sand: swell, ripples that wander and fade, hummocks.
pub(super) fn height(x: f64, y: f64, seed: u32) -> f64 {
    let noise = |wavelength: f64, k: u32| {
        f64::from(gradient_noise(&Vector3::new((x / wavelength) as f32, (y / wavelength) as f32, 0.37 * k as f32), seed ^ (0x5A00 + k)))
    };
    let phase = std::f64::consts::TAU * (0.94 * x + 0.34 * y) / RIPPLE_M + 2.6 * noise(1.1, 1) + 1.1 * noise(0.4, 2);
    // Steeper on one side, as the swell leaves them.
    let ripple = phase.sin() + 0.28 * (2.0 * phase + 0.7).sin();
    let strength = 0.010 * (1.0 + 1.2 * noise(1.9, 3)).clamp(0.1, 1.8);
    0.07 * noise(3.4, 4) + 0.02 * noise(0.7, 5) + strength * ripple + 0.004 * noise(0.09, 6)
}

/// The bottom as a grid; what lies within `covered` (x from, to, y from, to) is left out.
pub(super) fn bottom(half_m: f64, spacing_m: f64, seed: u32, covered: Option<[f64; 4]>) -> Part {
    let steps = (2.0 * half_m / spacing_m).ceil() as usize;
    let at = |i: usize| -half_m + 2.0 * half_m * i as f64 / steps as f64;
    let vertices: Vec<Point3<f64>> = (0..=steps)
        .into_par_iter()
        .flat_map_iter(|j| (0..=steps).map(move |i| Point3::new(at(i), at(j), height(at(i), at(j), seed))))
        .collect();
    let hidden = |p: &Point3<f64>| covered.is_some_and(|[x0, x1, y0, y1]| p.x > x0 && p.x < x1 && p.y > y0 && p.y < y1);
    let mut mesh = Mesh { vertices, ..Mesh::default() };
    for j in 0..steps {
        for i in 0..steps {
            let a = j * (steps + 1) + i;
            let corners = [a, a + 1, a + steps + 2, a + steps + 1];
            if corners.iter().all(|&c| hidden(&mesh.vertices[c])) {
                continue;
            }
            let [a, b, c, d] = corners.map(|c| c as u32);
            mesh.faces.push([a, b, c]);
            mesh.faces.push([a, c, d]);
        }
    }
    Part::new("bottom", Label::Sand, Material::Sand, mesh)
}

/// Stones strewn outside a radius about the origin, half buried.
pub(super) fn stones(count: u32, clear_m: f64, half_m: f64, seed: u32) -> Option<Part> {
    let mut random = Random::new(mix(u64::from(seed) ^ 0x570));
    let ball = ball(3);
    let mut mesh = Mesh::default();
    for k in 0..count {
        let (angle, along) = (random.range(0.0, std::f64::consts::TAU), random.unit());
        let distance = clear_m + (half_m - clear_m - 0.3).max(0.1) * along;
        let (x, y) = (distance * angle.cos(), distance * angle.sin());
        // Many small ones, few large ones.
        let size = 0.05 * (1.0 - 0.97 * random.unit()).powf(-0.45);
        let stretch = Vector3::new(random.range(0.8, 1.4), random.range(0.8, 1.4), random.range(0.5, 0.9)) * size;
        let turn = UnitQuaternion::from_euler_angles(random.range(-0.4, 0.4), random.range(-0.4, 0.4), random.range(0.0, 6.0));
        let centre = Vector3::new(x, y, height(x, y, seed) + 0.15 * size);
        let first = mesh.vertices.len() as u32;
        for v in &ball.vertices {
            let bump = f64::from(gradient_noise(&(v.coords.cast() * 1.4), seed ^ (0x570_0000 + k)));
            mesh.vertices.push((centre + turn * v.coords.component_mul(&stretch) * (1.0 + 0.45 * bump)).into());
        }
        let faces = ball.faces.iter().map(|f| f.map(|v| v + first));
        // What lies under the sand is not seen.
        let above = |f: &[u32; 3]| {
            f.iter().any(|&v| {
                let p = mesh.vertices[v as usize];
                p.z > height(p.x, p.y, seed) - 0.03
            })
        };
        mesh.faces.extend(faces.filter(above).collect::<Vec<_>>());
    }
    (count > 0).then(|| Part::new("stones", Label::Stone, Material::Stone, mesh))
}

/// A ball of radius 1: an icosahedron whose faces are quartered some times.
pub(crate) fn ball(times: usize) -> Mesh {
    let g = f64::midpoint(1.0, 5f64.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let mut vertices: Vec<Vector3<f64>> = corners.iter().map(|&c| Vector3::from(c).normalize()).collect();
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..times {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32, vertices: &mut Vec<Vector3<f64>>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                vertices.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b, &mut vertices), middle(b, c, &mut vertices), middle(c, a, &mut vertices));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    Mesh { vertices: vertices.into_iter().map(Point3::from).collect(), faces, ..Mesh::default() }
}
