//! Pairs along the path and loops, on made-up dives.

use super::*;
use crate::retrieval::{Codebook, GlobalDescriptor, RetrievalOptions};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::{Descriptor, ImageId};

fn has(pairs: &[(ImageId, ImageId)], a: usize, b: usize) -> bool {
    pairs.binary_search(&(ImageId::new(a), ImageId::new(b))).is_ok()
}

#[test]
fn sequential_pairs_hold_rig_partners_neighbours_and_powers_of_two() {
    // Two cameras, forty exposures.
    let exposures: Vec<u32> = (0..40).chain(0..40).collect();
    let pairs = sequential(&exposures, 3);
    assert!(has(&pairs, 5, 45), "rig partners");
    assert!(has(&pairs, 5, 8) && has(&pairs, 5, 48), "neighbours in time, also across cameras");
    assert!(has(&pairs, 5, 37), "32 apart");
    assert!(!has(&pairs, 5, 12), "7 apart");
    assert_eq!(exhaustive(4).len(), 6);
    assert!(exhaustive(1).is_empty());
}

#[test]
fn the_union_is_sorted_and_has_no_pair_twice() {
    let pair = |a, b| (ImageId::new(a), ImageId::new(b));
    assert_eq!(union(vec![pair(0, 1), pair(3, 4)], &[pair(0, 9), pair(3, 4)]), [pair(0, 1), pair(0, 9), pair(3, 4)]);
}

proptest! {
    #[test]
    fn sequential_is_its_definition(exposures in prop::collection::vec(prop_oneof![0u32..60, Just(u32::MAX)], 0..40), window in 0u32..9) {
        let near = |&(a, b): &(ImageId, ImageId)| {
            let apart = exposures[a.index()].abs_diff(exposures[b.index()]);
            apart <= window || apart.is_power_of_two()
        };
        let expected: Vec<_> = exhaustive(exposures.len()).into_iter().filter(near).collect();
        prop_assert_eq!(sequential(&exposures, window), expected);
    }
}

/// A sea floor in a row of 600 points, 40 a place; an image at place p sees those of p and its neighbours, their descriptors changed by
/// noise, and as many features that no other image sees.
struct Floor {
    points: Vec<Descriptor>,
    rng: ChaCha8Rng,
}

const PLACES: usize = 15;
const PER_PLACE: usize = 40;

impl Floor {
    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let points = (0..PLACES * PER_PLACE).map(|_| random(&mut rng)).collect();
        Self { points, rng }
    }

    fn image(&mut self, place: usize) -> Vec<Descriptor> {
        let seen = place.saturating_sub(1) * PER_PLACE..((place + 2) * PER_PLACE).min(self.points.len());
        let mut image = Vec::new();
        for point in seen {
            let noise = self.rng.next_u64();
            image.push(std::array::from_fn(|i| self.points[point][i].saturating_add((noise >> (i % 61)) as u8 % 16)));
            image.push(random(&mut self.rng));
        }
        image
    }
}

/// Entries as those of RootSIFT: most small.
fn random(rng: &mut ChaCha8Rng) -> Descriptor {
    let mut d = [0; 128];
    rng.fill_bytes(&mut d);
    d.map(|v| (u16::from(v) * u16::from(v) / 512) as u8)
}

fn describe(images: &[Vec<Descriptor>]) -> Vec<Option<GlobalDescriptor>> {
    let options = RetrievalOptions { branches: 8, sample: 4000, ..RetrievalOptions::default() };
    let sample: Vec<Descriptor> = images.iter().flat_map(|d| Codebook::share(d, images.len(), &options)).copied().collect();
    let codebook = Codebook::learn(&sample, &options, 1).expect("valid options");
    images.iter().map(|d| Some(codebook.describe(d))).collect()
}

/// There and back: exposures 0..15 along the places, 15..30 the other way.
fn there_and_back() -> (Vec<Option<GlobalDescriptor>>, Vec<u32>) {
    let mut floor = Floor::new(1);
    let images: Vec<_> = (0..PLACES).chain((0..PLACES).rev()).map(|place| floor.image(place)).collect();
    (describe(&images), (0..2 * PLACES as u32).collect())
}

#[test]
fn the_way_back_finds_the_way_there() {
    let (described, exposures) = there_and_back();
    let pairs = loop_candidates(&described, &exposures, &LoopOptions { per_image: 2, window: 3, spread: 0 });
    for there in 0..PLACES {
        let back = 2 * PLACES - 1 - there;
        // Those nearer than the window are the sequence's.
        assert_eq!(has(&pairs, there, back), back - there > 3, "{there}");
    }
    assert!(pairs.iter().all(|(a, b)| a < b && exposures[b.index()] - exposures[a.index()] > 3));
    // Places that share points are at most two apart. At the turn, the last image of the way there and the first of the way back share
    // points with images inside the window alone: their two candidates each are wrong.
    let place = |i: ImageId| i.index().min(2 * PLACES - 1 - i.index());
    let wrong = pairs.iter().filter(|(a, b)| place(*a).abs_diff(place(*b)) > 2).count();
    assert!(wrong <= 4, "{wrong} of {} join different places", pairs.len());
}

#[test]
fn a_place_passed_slowly_leaves_candidates_for_others() {
    // Place 3 once, in exposures 100..110 ten times, and in exposure 200 again.
    let mut floor = Floor::new(2);
    let mut exposures: Vec<u32> = vec![0, 200];
    exposures.extend(100..110);
    let images: Vec<_> = exposures.iter().map(|_| floor.image(3)).collect();
    let described = describe(&images);
    // The other place must be among the first half, whatever its rank.
    let options = LoopOptions { per_image: 4, window: 20, spread: 20 };
    let pairs = loop_candidates(&described[..], &exposures, &options);
    assert!(has(&pairs, 0, 1));
    let with_first = pairs.iter().filter(|(a, _)| a.index() == 0).count();
    assert!(with_first >= 4, "{with_first}: the slow place fills the rest");
}

#[test]
fn images_without_features_and_rig_partners_are_no_candidates() {
    let mut floor = Floor::new(3);
    let images = [floor.image(2), floor.image(2), Vec::new(), floor.image(2), floor.image(2)];
    let mut described = describe(&images);
    let exposures = [0, 0, 50, 50, 100];
    let options = LoopOptions { per_image: 20, window: 10, spread: 5 };
    let pair = |a, b| (ImageId::new(a), ImageId::new(b));
    assert_eq!(loop_candidates(&described, &exposures, &options), [pair(0, 3), pair(0, 4), pair(1, 3), pair(1, 4), pair(3, 4)]);
    described[3] = None;
    assert_eq!(loop_candidates(&described, &exposures, &options), [pair(0, 4), pair(1, 4)]);
    assert!(loop_candidates(&described, &exposures, &LoopOptions { per_image: 0, ..options }).is_empty());
    assert!(loop_candidates(&[], &[], &options).is_empty());
    assert!(loop_candidates(&[None, None], &[0, 99], &options).is_empty());
}

#[test]
fn threads_do_not_change_the_candidates() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (described, exposures) = there_and_back();
            let pairs = loop_candidates(&described, &exposures, &LoopOptions { per_image: 3, window: 2, spread: 1 });
            (described, pairs)
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert!(!one.1.is_empty());
}
