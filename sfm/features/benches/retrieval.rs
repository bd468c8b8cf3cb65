//! Time of describing an image and of finding the loop candidates of a long dive, on one thread.
//!
//! `cargo bench -p features --bench retrieval`
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use features::pairs::{LoopOptions, loop_candidates};
use features::{Codebook, GlobalDescriptor, RetrievalOptions};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::Descriptor;
use std::hint::black_box;

const IMAGES: usize = 5000;

fn random(rng: &mut ChaCha8Rng, n: usize) -> Vec<Descriptor> {
    (0..n)
        .map(|_| {
            let mut d = [0; 128];
            rng.fill_bytes(&mut d);
            d.map(|v| (u16::from(v) * u16::from(v) / 512) as u8)
        })
        .collect()
}

fn retrieval(c: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let options = RetrievalOptions::default();
    let sample = random(&mut rng, options.sample);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread starts");
    let codebook = Codebook::learn(&sample, &options, 1).expect("valid options");
    let mut group = c.benchmark_group("retrieval");
    group.sample_size(10).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    group.bench_function("learn", |b| b.iter(|| one_thread.install(|| Codebook::learn(&sample, &options, 1))));
    let image = random(&mut rng, 8192);
    group.bench_function("describe an image of 8192 features", |b| b.iter(|| codebook.describe(black_box(&image))));
    // 64 images of noise, over and over: as many postings a word as in a dive of 5000.
    let few: Vec<GlobalDescriptor> = (0..64).map(|_| codebook.describe(&random(&mut rng, options.max_features))).collect();
    let dive: Vec<Option<GlobalDescriptor>> = (0..IMAGES).map(|i| Some(few[i % few.len()].clone())).collect();
    let exposures: Vec<u32> = (0..IMAGES as u32).collect();
    let loops = LoopOptions::default();
    group.bench_function("candidates of 5000 images", |b| b.iter(|| one_thread.install(|| loop_candidates(&dive, &exposures, &loops))));
    group.finish();
}

criterion_group!(benches, retrieval);
criterion_main!(benches);
