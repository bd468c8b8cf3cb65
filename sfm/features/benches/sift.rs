//! Extraction of 8,192 features from 6 megapixels of noise of all wavelengths.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use features::{SiftOptions, extract};
use scene::Raster;

const WIDTH: usize = 3072;
const HEIGHT: usize = 2048;

/// Smooth noise of wavelengths from 4 to 1024 pixels, each half as long as the next and weaker.
fn picture() -> Raster<f32> {
    let hash = |x: usize, y: usize, seed: usize| {
        let mut h = (x as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ (y as u64 + 1).wrapping_mul(0xc2b2_ae3d_27d4_eb4f)
            ^ (seed as u64 + 1).wrapping_mul(0x1656_67b1_9e37_79f9);
        h = (h ^ (h >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        (h >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut image = Raster::filled(WIDTH, HEIGHT, 0.0);
    for octave in 2..=10 {
        let wavelength = 1usize << octave;
        let strength = 0.08;
        for y in 0..HEIGHT {
            let (iy, b) = (y / wavelength, (y % wavelength) as f32 / wavelength as f32);
            for x in 0..WIDTH {
                let (ix, a) = (x / wavelength, (x % wavelength) as f32 / wavelength as f32);
                let (a, b) = (a * a * (3.0 - 2.0 * a), b * b * (3.0 - 2.0 * b));
                let above = hash(ix, iy, octave) * (1.0 - a) + hash(ix + 1, iy, octave) * a;
                let below = hash(ix, iy + 1, octave) * (1.0 - a) + hash(ix + 1, iy + 1, octave) * a;
                image[(x, y)] += strength * (above * (1.0 - b) + below * b);
            }
        }
    }
    image
}

fn extraction(c: &mut Criterion) {
    let image = picture();
    let options = SiftOptions::default();
    let features = extract(&image, None, &options).expect("valid options");
    assert_eq!(features.len(), options.max_features, "the picture has enough structure");
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread starts");
    let mut group = c.benchmark_group("sift");
    group.sample_size(10);
    group.bench_function("6 megapixels, one thread", |b| b.iter(|| one_thread.install(|| extract(&image, None, &options))));
    group.bench_function("6 megapixels, all threads", |b| b.iter(|| extract(&image, None, &options)));
    group.finish();
}

criterion_group!(benches, extraction);
criterion_main!(benches);
