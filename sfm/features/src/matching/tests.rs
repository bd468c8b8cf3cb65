//! Every instruction set against a naive reference.

use super::instructions::Instructions;
use super::matcher::{MatchOptions, match_descriptors, match_with};
use super::scan::Nearest;
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::{Descriptor, KeypointIndex};

/// Entries up to `most`, so that small limits give many equal distances.
fn random(rng: &mut ChaCha8Rng, n: usize, most: u8) -> Vec<Descriptor> {
    (0..n)
        .map(|_| {
            let mut d = [0; 128];
            rng.fill_bytes(&mut d);
            d.map(|v| if most == u8::MAX { v } else { v % (most + 1) })
        })
        .collect()
}

fn squared_distance(a: &Descriptor, b: &Descriptor) -> u32 {
    a.iter().zip(b).map(|(&x, &y)| u32::from(x.abs_diff(y)).pow(2)).sum()
}

/// All distances, sorted: the definition itself.
fn naive(of: &Descriptor, among: &[Descriptor]) -> Nearest {
    let mut all: Vec<(u32, u32)> = among.iter().enumerate().map(|(j, d)| (squared_distance(of, d), j as u32)).collect();
    all.sort_unstable();
    Nearest { distance: all[0].0, index: all[0].1, second: all.get(1).map_or(u32::MAX, |s| s.0) }
}

fn check(a: &[Descriptor], b: &[Descriptor]) {
    let rows: Vec<Nearest> = a.iter().map(|d| naive(d, b)).collect();
    let columns: Vec<Nearest> = b.iter().map(|d| naive(d, a)).collect();
    for set in Instructions::available() {
        let found = set.scan(a, b);
        assert!(found.of_rows == rows, "{set:?}, rows, {} x {}", a.len(), b.len());
        assert!(found.of_columns == columns, "{set:?}, columns, {} x {}", a.len(), b.len());
    }
}

#[test]
fn sizes_around_the_blocks() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for (n, m) in [(1, 1), (1, 70), (70, 1), (255, 65), (257, 63), (512, 64), (3, 4097), (700, 130)] {
        for most in [1, 255] {
            check(&random(&mut rng, n, most), &random(&mut rng, m, most));
        }
    }
}

#[test]
fn more_columns_than_a_stretch_of_the_widest() {
    // 16 lanes x 256 vectors = 4096 columns: the second stretch starts there. Ties across both.
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut b = random(&mut rng, 4200, 255);
    let copy = b[17];
    b[4150] = copy;
    let mut a = random(&mut rng, 300, 255);
    a[299] = copy;
    a[5] = copy;
    check(&a, &b);
}

#[test]
fn extremes_do_not_overflow() {
    let (low, high) = ([0; 128], [255; 128]);
    check(&[low, high, low], &[high, low]);
    check(&[low], &[high, high]);
    check(&[high; 5], &[high; 17]);
    let mixed: Descriptor = std::array::from_fn(|i| if i % 2 == 0 { 255 } else { 0 });
    check(&[mixed, high, low], &[high, mixed, low]);
}

#[test]
fn nothing_matches_nothing() {
    let one = [[7; 128]];
    for (a, b) in [(&[][..], &[][..]), (&one, &[]), (&[], &one)] {
        assert!(match_descriptors(a, b, &MatchOptions::default()).is_empty());
    }
}

#[test]
fn a_single_candidate_has_no_rival() {
    let (one, far) = ([[40; 128]], [[200; 128]]);
    let options = MatchOptions::default();
    assert_eq!(match_descriptors(&one, &one, &options), [(KeypointIndex(0), KeypointIndex(0))]);
    assert!(match_descriptors(&one, &far, &options).is_empty());
}

#[test]
fn equal_descriptors_are_ambiguous() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let a = random(&mut rng, 3, 255);
    let options = MatchOptions { max_distance: 2.0, ..MatchOptions::default() };
    assert_eq!(match_descriptors(&a, &a, &options).len(), 3);
    assert_eq!(
        match_descriptors(&a, &[a[0], a[0], a[1], a[2]], &options),
        [(KeypointIndex(1), KeypointIndex(2)), (KeypointIndex(2), KeypointIndex(3))]
    );
    assert_eq!(
        match_descriptors(&[a[0], a[0], a[1], a[2]], &a, &options),
        [(KeypointIndex(2), KeypointIndex(1)), (KeypointIndex(3), KeypointIndex(2))]
    );
}

#[test]
fn distance_is_in_units_of_the_norm() {
    // Entries 512 / sqrt(128) have norm 512; moving one by 0.5 x 512 is a distance of 0.5.
    let a = [45; 128];
    let mut b = [45; 128];
    b[3] = 255;
    let distance = f32::from(255u8 - 45) / 512.0;
    let options = |max_distance| MatchOptions { max_distance, ..MatchOptions::default() };
    assert_eq!(match_descriptors(&[a], &[b], &options(distance + 1e-4)).len(), 1);
    assert!(match_descriptors(&[a], &[b], &options(distance - 1e-4)).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn all_sets_agree_with_the_definition(seed: u64, n in 1usize..150, m in 1usize..150, most in prop_oneof![Just(1u8), Just(3), Just(255)]) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        check(&random(&mut rng, n, most), &random(&mut rng, m, most));
    }

    #[test]
    fn matches_are_sorted_one_to_one_and_symmetric(seed: u64, n in 0usize..80, m in 0usize..80, ratio in 0.7f32..2.0, mutual: bool) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (a, b) = (random(&mut rng, n, 1), random(&mut rng, m, 1));
        let options = MatchOptions { max_ratio: ratio, max_distance: 2.0, mutual };
        let found = match_descriptors(&a, &b, &options);
        for set in Instructions::available() {
            prop_assert_eq!(&match_with(set, &a, &b, &options), &found);
        }
        prop_assert!(found.windows(2).all(|w| w[0].0 < w[1].0));
        let mut seconds: Vec<_> = found.iter().map(|m| m.1).collect();
        seconds.sort_unstable();
        prop_assert!(seconds.windows(2).all(|w| w[0] < w[1]));
        for (i, j) in &found {
            prop_assert_eq!(naive(&a[i.index()], &b).index, j.0);
        }
        if mutual {
            let mut back: Vec<_> = match_descriptors(&b, &a, &options).into_iter().map(|(j, i)| (i, j)).collect();
            back.sort_unstable();
            prop_assert_eq!(back, found);
        }
    }
}
