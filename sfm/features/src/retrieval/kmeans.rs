//! K-means on descriptors, in integers.

use crate::matching::nearest;
use crate::random::SplitMix64;
use rayon::prelude::*;
use scene::Descriptor;

/// Descriptors of one task; sums are integers, so it is for speed alone.
const TASK: usize = 4096;

/// The nearest centre of each descriptor, the lowest on ties.
pub(super) fn assign(descriptors: &[Descriptor], centres: &[Descriptor]) -> Vec<u32> {
    descriptors.par_chunks(TASK).flat_map_iter(|chunk| nearest(chunk, centres)).collect()
}

/// At most `k` centres by Lloyd's algorithm, from distinct descriptors drawn at random, rounded to bytes. None of nothing.
pub(super) fn kmeans(descriptors: &[Descriptor], k: usize, rounds: usize, random: &mut SplitMix64) -> Vec<Descriptor> {
    let mut centres = draw(descriptors, k, random);
    for _ in 0..rounds {
        let nearest = assign(descriptors, &centres);
        let mut sums = vec![[0u64; 128]; centres.len()];
        let mut counts = vec![0u64; centres.len()];
        for (descriptor, &centre) in descriptors.iter().zip(&nearest) {
            counts[centre as usize] += 1;
            for (sum, &value) in sums[centre as usize].iter_mut().zip(descriptor) {
                *sum += u64::from(value);
            }
        }
        let old = centres.clone();
        for ((centre, sums), &count) in centres.iter_mut().zip(&sums).zip(&counts).filter(|(_, count)| **count > 0) {
            for (value, &sum) in centre.iter_mut().zip(sums) {
                *value = ((sum + count / 2) / count) as u8;
            }
        }
        if centres == old {
            break;
        }
    }
    centres
}

/// At most `k` distinct descriptors.
fn draw(descriptors: &[Descriptor], k: usize, random: &mut SplitMix64) -> Vec<Descriptor> {
    let mut order: Vec<usize> = (0..descriptors.len()).collect();
    let mut drawn: Vec<Descriptor> = Vec::with_capacity(k);
    for i in 0..order.len() {
        if drawn.len() == k {
            break;
        }
        let other = i + random.below(order.len() - i);
        order.swap(i, other);
        let candidate = descriptors[order[i]];
        if !drawn.contains(&candidate) {
            drawn.push(candidate);
        }
    }
    drawn
}
