//! Decoding and resizing of a 6-megapixel image.

use criterion::{Criterion, criterion_group, criterion_main};
use scene::Raster;
use std::hint::black_box;

/// Smooth shapes with some noise: compresses like a photograph.
fn picture(width: usize, height: usize) -> Raster<[u8; 3]> {
    let pixels = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            let noise = ((i as u32).wrapping_mul(2_654_435_761) >> 28) as f32;
            let v = 110.0 + 60.0 * (x / 37.0).sin() * (y / 53.0).cos() + noise;
            [v as u8, (v * 0.9) as u8, (v * 0.8 + 20.0) as u8]
        })
        .collect();
    Raster::from_vec(width, height, pixels).expect("one value a pixel")
}

fn decode(c: &mut Criterion) {
    let rgb = picture(3072, 2048);
    let jpeg = imaging::encode_jpeg_rgb(&rgb, 90).expect("valid");
    let grey = imaging::grey_from_rgb(&rgb);
    c.bench_function("decode_grey jpeg 6 Mpx", |b| b.iter(|| imaging::decode_grey(black_box(&jpeg))));
    c.bench_function("decode_rgb jpeg 6 Mpx", |b| b.iter(|| imaging::decode_rgb(black_box(&jpeg))));
    c.bench_function("resize_area_rgb 6 Mpx to a third", |b| b.iter(|| imaging::resize_area_rgb(black_box(&rgb), 1024, 683)));
    c.bench_function("gaussian_blur sigma 1.6, 6 Mpx", |b| b.iter(|| imaging::gaussian_blur(black_box(&grey), 1.6)));
}

criterion_group!(benches, decode);
criterion_main!(benches);
