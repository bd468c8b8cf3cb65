//! Cloud-to-mesh distances: 100,000 noisy points around a sphere of 200,000 triangles.

use criterion::{Criterion, criterion_group, criterion_main};
use eval::{Reference, distances};
use nalgebra::Point3;
use scene::{Cloud, Mesh};
use std::f64::consts::PI;
use std::hint::black_box;

fn sphere(rings: u32) -> Mesh {
    let around = 2 * rings;
    let mut mesh = Mesh::default();
    for i in 0..=rings {
        for j in 0..around {
            let (theta, phi) = (PI * f64::from(i) / f64::from(rings), 2.0 * PI * f64::from(j) / f64::from(around));
            mesh.vertices.push(Point3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()) * 5.0);
        }
    }
    for i in 0..rings {
        for j in 0..around {
            let (a, b) = (i * around + j, i * around + (j + 1) % around);
            mesh.faces.extend([[a, a + around, b], [b, a + around, b + around]]);
        }
    }
    mesh
}

fn spiral(count: u32) -> Cloud {
    let point = |i: u32| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
        let (phi, r) = (f64::from(i) * 2.399_963, 5.0 + 0.02 * (f64::from(i) * 0.7).sin());
        Point3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z) * r
    };
    Cloud { positions: (0..count).map(point).collect(), ..Cloud::default() }
}

fn bench(criterion: &mut Criterion) {
    let (mesh, cloud) = (Reference::Mesh(sphere(224)), spiral(100_000));
    criterion.benchmark_group("eval").sample_size(10).bench_function("distances_100k_to_200k", |b| {
        b.iter(|| distances(black_box(&cloud), black_box(&mesh)));
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
