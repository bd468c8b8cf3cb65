//! Vocabularies and votes against their definitions.

use super::hamming::{Popcount, Signature};
use super::kmeans::kmeans;
use super::*;
use crate::random::SplitMix64;
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::Descriptor;

fn random(rng: &mut ChaCha8Rng, n: usize) -> Vec<Descriptor> {
    (0..n)
        .map(|_| {
            let mut d = [0; 128];
            rng.fill_bytes(&mut d);
            d
        })
        .collect()
}

/// Descriptors scattered by at most 10 about centres that are far apart.
fn clusters(rng: &mut ChaCha8Rng, centres: &[Descriptor], each: usize) -> Vec<Descriptor> {
    let near = |centre: &Descriptor, rng: &mut ChaCha8Rng| {
        let mut noise = [0; 128];
        rng.fill_bytes(&mut noise);
        std::array::from_fn(|i| (centre[i] / 2 + 60).saturating_add_signed((noise[i] % 21) as i8 - 10))
    };
    (0..each).flat_map(|_| centres.iter().map(|c| near(c, rng)).collect::<Vec<_>>()).collect()
}

#[test]
fn kmeans_reaches_a_fixed_point_of_lloyd() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let truth = random(&mut rng, 6);
    let sample = clusters(&mut rng, &truth, 200);
    let centres = kmeans(&sample, 12, 100, &mut SplitMix64(7));
    assert_eq!(centres.len(), 12);
    for (c, centre) in centres.iter().enumerate() {
        let squared = |a: &Descriptor, b: &Descriptor| a.iter().zip(b).map(|(x, y)| u32::from(x.abs_diff(*y)).pow(2)).sum::<u32>();
        let nearest = |d: &Descriptor| (0..12).min_by_key(|&k| (squared(d, &centres[k]), k));
        let members: Vec<&Descriptor> = sample.iter().filter(|d| nearest(d) == Some(c)).collect();
        for i in (0..128).filter(|_| !members.is_empty()) {
            let mean = members.iter().map(|d| f64::from(d[i])).sum::<f64>() / members.len() as f64;
            assert!((mean - f64::from(centre[i])).abs() <= 0.5, "centre {c}, entry {i}");
        }
    }
}

#[test]
fn a_vocabulary_depends_on_sample_and_seed_alone() {
    let sample = random(&mut ChaCha8Rng::seed_from_u64(2), 9000);
    let options = RetrievalOptions { branches: 16, ..RetrievalOptions::default() };
    let learn = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| Codebook::learn(&sample, &options, seed).expect("valid options"))
    };
    let one = learn(1, 5);
    assert_eq!(one, learn(2, 5));
    assert_ne!(one, learn(1, 6));
    assert!(one.len() > 200 && one.len() <= 256, "{}", one.len());
    let described = one.describe(&sample[..300]);
    assert_eq!(described.len(), 300);
    assert!(described.words.is_sorted() && described.words.iter().all(|&w| usize::from(w) < one.len()));
}

#[test]
fn small_samples_and_wrong_options() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let some = random(&mut rng, 40);
    let options = RetrievalOptions::default();
    let empty = Codebook::learn(&[], &options, 0).expect("valid options");
    assert!(empty.is_empty() && empty.describe(&some).is_empty());
    let one = Codebook::learn(&some[..1], &options, 0).expect("valid options");
    assert_eq!((one.len(), one.describe(&some).len()), (1, 40));
    let same = Codebook::learn(&[some[0]; 500], &options, 0).expect("valid options");
    assert_eq!(same.len(), 1, "equal descriptors are one word");
    for branches in [0, 1, 257] {
        assert!(Codebook::learn(&some, &RetrievalOptions { branches, ..options }, 0).is_err());
    }
}

#[test]
fn the_share_of_an_image_is_even_and_bounded() {
    let some = random(&mut ChaCha8Rng::seed_from_u64(4), 100);
    let options = RetrievalOptions { sample: 40, max_features: 50, ..RetrievalOptions::default() };
    let share: Vec<_> = Codebook::share(&some, 4, &options).copied().collect();
    assert_eq!(share, (0..10).map(|i| some[5 * i]).collect::<Vec<_>>());
    assert_eq!(Codebook::share(&some[..3], 4, &options).count(), 3);
    assert_eq!(Codebook::share(&[], 0, &options).count(), 0);
}

/// The transform's definition: entry (i, j) of a Hadamard matrix in Sylvester's order is -1 to the number of bits that i and j share.
#[test]
fn signatures_are_signs_of_rows_of_a_hadamard_matrix() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut pairs: Vec<_> = random(&mut rng, 20).into_iter().zip(random(&mut rng, 20)).collect();
    pairs.push(([255; 128], [0; 128]));
    let element = |i: usize, j: usize| if (i & j).count_ones().is_multiple_of(2) { 1 } else { -1 };
    let unit = |j: usize| {
        let mut d = [0; 128];
        d[j] = 1;
        Signature::new(&d, &[0; 128]).0
    };
    // Row 0 has no negative element: the first bit of a unit vector's signature is its column's sign.
    let coins: Vec<i32> = (0..128).map(|j| if unit(j) & 1 == 1 { 1 } else { -1 }).collect();
    assert!((40..=88).contains(&coins.iter().filter(|c| **c > 0).count()));
    for (descriptor, word) in pairs {
        let signature = Signature::new(&descriptor, &word).0;
        for i in 0..64 {
            let sum: i32 = (0..128).map(|j| element(i, j) * coins[j] * (i32::from(descriptor[j]) - i32::from(word[j]))).sum();
            assert_eq!(signature >> i & 1 == 1, sum > 0, "row {i}");
        }
    }
}

/// Votes by brute force.
#[test]
fn scores_are_their_definition_with_every_instruction_set() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let points = random(&mut rng, 900);
    let options = RetrievalOptions { branches: 4, ..RetrievalOptions::default() };
    let codebook = Codebook::learn(&points, &options, 1).expect("valid options");
    // Each sees some points of the others, changed a little, so that votes of all sizes occur.
    let images: Vec<Option<GlobalDescriptor>> = (0..8usize)
        .map(|i| {
            let seen: Vec<Descriptor> =
                points[i * 90..i * 90 + 200 - 20 * i].iter().map(|d| d.map(|v| v ^ (rng.next_u32() as u8 & 63))).collect();
            (i != 4).then(|| codebook.describe(&seen))
        })
        .collect();
    let vote = |q: &GlobalDescriptor, f: usize, other: &GlobalDescriptor| {
        let same = (0..other.len()).filter(|&g| other.words[g] == q.words[f]);
        let distance = same.map(|g| (other.signatures[g].0 ^ q.signatures[f].0).count_ones()).min().unwrap_or(64);
        u64::from(25u32.saturating_sub(distance)).pow(2)
    };
    for set in Popcount::available() {
        let index = Index::with(set, &images);
        for query in images.iter().flatten() {
            let mut scores = vec![1; images.len()];
            index.scores(query, &mut scores);
            for (image, score) in images.iter().zip(scores) {
                let votes: u64 = image.iter().map(|other| (0..query.len()).map(|f| vote(query, f, other)).sum::<u64>()).sum();
                let features = image.as_ref().map_or(0, GlobalDescriptor::len).max(64);
                let expected = votes as f64 * 4096.0 / (features as f64).sqrt();
                assert!((score as f64 - expected).abs() <= 0.004 * expected + 1.0, "{set:?}: {score}, {expected}");
                assert_eq!(score == 0, votes == 0);
            }
        }
    }
}

proptest! {
    #[test]
    fn distances_of_every_instruction_set_are_their_definition(seed: u64, n in 0usize..300) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut one = || Signature(rng.next_u64());
        let (from, to) = (one(), (0..n).map(|_| one()).collect::<Vec<_>>());
        let bits = |a: &Signature, b: &Signature| (0..64).filter(|i| (a.0 >> i) & 1 != (b.0 >> i) & 1).count() as u8;
        let expected: Vec<u8> = to.iter().map(|to| bits(&from, to)).collect();
        for set in Popcount::available() {
            let mut found = vec![0; n];
            set.distances(from, &to, &mut found);
            prop_assert_eq!(&found, &expected, "{:?}", set);
        }
    }
}
