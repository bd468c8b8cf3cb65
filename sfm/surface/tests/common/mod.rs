//! Sampled shapes with known truth.
#![allow(dead_code)] // each test file uses some of it

use nalgebra::{Point3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::Cloud;

/// A number from 0 to 1.
pub fn uniform(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// A number of mean 0 and standard deviation 1.
pub fn gauss(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(random)).ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform(random)).cos()
}

pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Points and normals, disturbed: positions by `noise`, normals by ten degrees where there is noise.
pub fn cloud(points: impl Iterator<Item = (Point3<f64>, Vector3<f64>)>, noise: f64, seed: u64) -> Cloud {
    let mut random = random(seed);
    let mut out = Cloud::default();
    for (p, n) in points {
        let mut step = || Vector3::new(gauss(&mut random), gauss(&mut random), gauss(&mut random));
        out.positions.push(p + step() * noise);
        let tilt = if noise > 0.0 { 0.1 } else { 0.0 };
        out.normals.push((n + step() * tilt).normalize().cast());
    }
    out
}

/// Points of a sphere around the origin, evenly spread.
pub fn sphere(count: usize, radius: f64) -> impl Iterator<Item = (Point3<f64>, Vector3<f64>)> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (s, a) = ((1.0 - z * z).sqrt(), golden * i as f64);
        let n = Vector3::new(s * a.cos(), s * a.sin(), z);
        (Point3::from(n * radius), n)
    })
}

/// Random points of the faces of a cube of edge 1 around the origin, `count` on each.
pub fn cube(count: usize, seed: u64) -> impl Iterator<Item = (Point3<f64>, Vector3<f64>)> {
    let mut random = random(seed);
    (0..6 * count).map(move |i| {
        let (axis, side): (usize, f64) = (i / count % 3, if i / count < 3 { 0.5 } else { -0.5 });
        let (u, v) = (uniform(&mut random) - 0.5, uniform(&mut random) - 0.5);
        let (mut p, mut n) = (Point3::origin(), Vector3::zeros());
        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3], n[axis]) = (side, u, v, side.signum());
        (p, n)
    })
}

/// Random points of a plane of `half` half edge at z = 0 with hemispheres of `radius` on it, seen from above, `density` a unit of area.
pub fn hemispheres(half: f64, radius: f64, centres: &[[f64; 2]], density: f64, seed: u64) -> Vec<(Point3<f64>, Vector3<f64>)> {
    let mut random = random(seed);
    let mut out = Vec::new();
    let under = |x: f64, y: f64| centres.iter().any(|c| (x - c[0]).powi(2) + (y - c[1]).powi(2) < radius * radius);
    for _ in 0..(density * 4.0 * half * half) as usize {
        let (x, y) = ((2.0 * uniform(&mut random) - 1.0) * half, (2.0 * uniform(&mut random) - 1.0) * half);
        if !under(x, y) {
            out.push((Point3::new(x, y, 0.0), Vector3::z()));
        }
    }
    for c in centres {
        for _ in 0..(density * std::f64::consts::TAU * radius * radius) as usize {
            let (z, a) = (uniform(&mut random), std::f64::consts::TAU * uniform(&mut random));
            let s = (1.0 - z * z).sqrt();
            let n = Vector3::new(s * a.cos(), s * a.sin(), z);
            out.push((Point3::new(c[0], c[1], 0.0) + n * radius, n));
        }
    }
    out
}
