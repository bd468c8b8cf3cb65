//! The image-processing mask of a 1920 x 1200 image, and its stations at the working size.

use criterion::{Criterion, criterion_group, criterion_main};
use masking::{CannyThresholds, IpOptions, canny, close, fill_holes, ip_mask, reduced_channel, smooth};
use scene::Raster;
use std::hint::black_box;

/// Textured sea floor under smooth water.
fn picture(width: usize, height: usize) -> Raster<[u8; 3]> {
    let pixels = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            let floor = y > 0.45 * height as f32 + 60.0 * (x / 170.0).sin();
            let texture = 35.0 * (x / 5.0).sin() * (y / 7.0).cos() + 20.0 * ((x + 2.0 * y) / 11.0).sin();
            let blue = if floor { 80.0 + texture } else { 170.0 - 0.02 * y };
            [40, (0.8 * blue) as u8, blue as u8]
        })
        .collect();
    Raster::from_vec(width, height, pixels).expect("one value a pixel")
}

fn stations(c: &mut Criterion) {
    let rgb = picture(1920, 1200);
    let thresholds = CannyThresholds { low: 0.55, high: 1.1 };
    let reduced = reduced_channel(&rgb, 2, 2);
    let plane = smooth(&reduced, 2);
    let edges = canny(&plane, &thresholds);
    c.bench_function("ip_mask 1920x1200", |b| b.iter(|| ip_mask(black_box(&rgb), &IpOptions::default())));
    c.bench_function("reduce", |b| b.iter(|| reduced_channel(black_box(&rgb), 2, 2)));
    c.bench_function("smooth, 2 passes", |b| b.iter(|| smooth(black_box(&reduced), 2)));
    c.bench_function("canny", |b| b.iter(|| canny(black_box(&plane), &thresholds)));
    c.bench_function("close, radius 12", |b| b.iter(|| close(black_box(&edges), 12)));
    c.bench_function("fill_holes", |b| b.iter(|| fill_holes(black_box(&edges), 1000)));
}

criterion_group!(benches, stations);
criterion_main!(benches);
