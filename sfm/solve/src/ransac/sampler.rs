//! How minimal samples are drawn.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use std::ops::Range;

/// Draws samples of different correspondences.
pub trait Sampler {
    /// Fills `sample` with different indices; `false` when that is impossible.
    fn draw(&self, rng: &mut ChaCha8Rng, sample: &mut [usize]) -> bool;

    /// Probability that a sample of `size` holds nothing but inliers; `inliers` is sorted.
    fn success_probability(&self, inliers: &[usize], size: usize) -> f64;
}

/// Every set of correspondences is as probable as any other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UniformSampler {
    /// Number of correspondences.
    pub len: usize,
}

impl Sampler for UniformSampler {
    fn draw(&self, rng: &mut ChaCha8Rng, sample: &mut [usize]) -> bool {
        draw_from(rng, &(0..self.len), sample)
    }

    fn success_probability(&self, inliers: &[usize], size: usize) -> f64 {
        all_inliers(inliers.len(), self.len, size)
    }
}

/// All correspondences of a sample come from one group: the points that one camera of a rig sees. Groups are chosen in
/// proportion to their size; those smaller than a sample never are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroupedSampler {
    /// Disjoint ranges of indices.
    pub groups: Vec<Range<usize>>,
}

impl GroupedSampler {
    fn usable(&self, size: usize) -> impl Iterator<Item = &Range<usize>> {
        self.groups.iter().filter(move |g| g.len() >= size)
    }
}

impl Sampler for GroupedSampler {
    fn draw(&self, rng: &mut ChaCha8Rng, sample: &mut [usize]) -> bool {
        let total: usize = self.usable(sample.len()).map(Range::len).sum();
        if total == 0 {
            return false;
        }
        let mut position = below(rng, total);
        for group in self.usable(sample.len()) {
            if position < group.len() {
                return draw_from(rng, group, sample);
            }
            position -= group.len();
        }
        false
    }

    fn success_probability(&self, inliers: &[usize], size: usize) -> f64 {
        let total: usize = self.usable(size).map(Range::len).sum();
        self.usable(size)
            .map(|g| {
                let inside = inliers.partition_point(|&i| i < g.end) - inliers.partition_point(|&i| i < g.start);
                g.len() as f64 / total as f64 * all_inliers(inside, g.len(), size)
            })
            .sum()
    }
}

/// Probability that `size` different out of `total` are all among `good`.
fn all_inliers(good: usize, total: usize, size: usize) -> f64 {
    if good < size || total < size {
        return 0.0;
    }
    (0..size).map(|i| (good - i) as f64 / (total - i) as f64).product()
}

/// A number below `bound`, which must fit 32 bits. The bias of multiply-and-shift, bound / 2^32, does not matter here.
fn below(rng: &mut ChaCha8Rng, bound: usize) -> usize {
    ((u64::from(rng.next_u32()) * bound as u64) >> 32) as usize
}

/// Floyd's algorithm (Bentley & Floyd, CACM 1987): one random number an element, no rejection.
fn draw_from(rng: &mut ChaCha8Rng, range: &Range<usize>, sample: &mut [usize]) -> bool {
    let (len, size) = (range.len(), sample.len());
    if size > len {
        return false;
    }
    for k in 0..size {
        let last = len - size + k;
        let candidate = range.start + below(rng, last + 1);
        sample[k] = if sample[..k].contains(&candidate) { range.start + last } else { candidate };
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn samples_hold_different_indices_of_one_group() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let sampler = GroupedSampler { groups: vec![0..5, 5..7, 7..27] };
        let mut first = 0;
        for _ in 0..5000 {
            let mut sample = [0; 3];
            assert!(sampler.draw(&mut rng, &mut sample));
            assert!(sample[0] != sample[1] && sample[0] != sample[2] && sample[1] != sample[2]);
            assert!(sampler.groups.iter().any(|g| g.len() >= 3 && sample.iter().all(|i| g.contains(i))));
            first += usize::from(sample[0] < 5);
        }
        // 5 of 25 usable: expectation 1000, standard deviation 28.
        assert!((850..1150).contains(&first), "{first}");
        assert!(!GroupedSampler { groups: vec![0..2, 2..3] }.draw(&mut rng, &mut [0; 3]));
    }

    #[test]
    fn probability_matches_the_frequency() {
        let inliers: Vec<usize> = vec![0, 1, 2, 3, 10, 11, 12, 13, 14, 15, 16, 17, 18];
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let samplers: [Box<dyn Sampler>; 2] =
            [Box::new(UniformSampler { len: 20 }), Box::new(GroupedSampler { groups: vec![0..6, 6..20] })];
        for sampler in samplers {
            let hits = (0..20_000)
                .filter(|_| {
                    let mut sample = [0; 3];
                    sampler.draw(&mut rng, &mut sample) && sample.iter().all(|i| inliers.contains(i))
                })
                .count();
            let expected = sampler.success_probability(&inliers, 3);
            // Five standard deviations of a frequency near 0.25.
            assert!((hits as f64 / 20_000.0 - expected).abs() < 0.016, "{hits} {expected}");
        }
    }
}
