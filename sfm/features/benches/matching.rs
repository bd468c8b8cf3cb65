//! Time of matching two images, on one thread.
//!
//! `cargo bench -p features --bench matching`

use criterion::{Criterion, criterion_group, criterion_main};
use features::{MatchOptions, match_descriptors};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::Descriptor;
use std::hint::black_box;

fn random(rng: &mut ChaCha8Rng, n: usize) -> Vec<Descriptor> {
    (0..n)
        .map(|_| {
            let mut d = [0; 128];
            rng.fill_bytes(&mut d);
            d
        })
        .collect()
}

fn exhaustive(c: &mut Criterion) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for n in [1024, 8192] {
        let (a, b) = (random(&mut rng, n), random(&mut rng, n));
        c.bench_function(&format!("match_{n}"), |bench| {
            bench.iter(|| black_box(match_descriptors(black_box(&a), black_box(&b), &MatchOptions::default())));
        });
    }
}

fn settings() -> Criterion {
    Criterion::default()
        .warm_up_time(std::time::Duration::from_millis(300))
        .measurement_time(std::time::Duration::from_secs(2))
        .sample_size(10)
}

criterion_group! { name = benches; config = settings(); targets = exhaustive }
criterion_main!(benches);
