//! Primary rays against the demo's scene, whole frames of it, and the survey of the paper without rendering.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::hint::black_box;
use synthetic::dive::{DiveOptions, DiveScene, Preset};
use synthetic::geometry::{GeometryOptions, geometry};
use synthetic::trace::{HitPacket, RayPacket, Tracer};

const SIZE: [usize; 2] = [640, 400];

/// Packets of the rays of a pinhole camera 4.8 m from the reef.
fn packets(dive: &DiveScene) -> Vec<RayPacket> {
    let world_from_cam = dive.cam_from_world(0, 30).inverse();
    let tiles = (0..SIZE[1] / 8).flat_map(|j| (0..SIZE[0] / 8).map(move |i| [8 * i, 8 * j]));
    tiles
        .map(|[left, top]| {
            let mut rays = RayPacket { origin: [[0.0; 64]; 3], direction: [[0.0; 64]; 3] };
            for i in 0..64 {
                let at = |v: usize, size: usize| (v as f64 + 0.5 - size as f64 / 2.0) / 446.0;
                let direction = Vector3::new(at(left + i % 8, SIZE[0]), at(top + i / 8, SIZE[1]), 1.0).normalize();
                let direction = world_from_cam.rotation * direction;
                for k in 0..3 {
                    rays.origin[k][i] = world_from_cam.translation[k] as f32;
                    rays.direction[k][i] = direction[k] as f32;
                }
            }
            rays
        })
        .collect()
}

fn render(c: &mut Criterion) {
    let dive = DiveScene::new(&DiveOptions::preset(Preset::Demo)).expect("the demo is possible");
    let (tracer, packets) = (Tracer::new(&dive.world.parts), packets(&dive));
    let mut group = c.benchmark_group("synthetic");
    group.sample_size(10);
    group.throughput(Throughput::Elements((SIZE[0] * SIZE[1]) as u64));
    group.bench_function("primary rays of 640 x 400", |b| {
        b.iter(|| {
            let met = packets.par_iter().map(|rays| {
                let mut hits = HitPacket::default();
                tracer.packet(rays, &mut hits);
                hits.triangle.iter().filter(|&&t| t != HitPacket::NONE).count()
            });
            black_box(met.sum::<usize>())
        })
    });
    group.bench_function("frame of 640 x 400 with all effects", |b| b.iter(|| dive.render(black_box(0), 30)));
    group.throughput(Throughput::Elements(100_000));
    let options = GeometryOptions { points: 100_000, ..GeometryOptions::paper() };
    group.bench_function("points of a survey of 4,746 images", |b| b.iter(|| geometry(black_box(&options))));
    group.finish();
}

criterion_group!(benches, render);
criterion_main!(benches);
