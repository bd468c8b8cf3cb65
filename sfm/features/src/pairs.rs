//! Which images are compared.

use scene::ImageId;

/// Every pair of `count` images, sorted.
#[must_use]
pub fn exhaustive(count: usize) -> Vec<(ImageId, ImageId)> {
    (0..count).flat_map(|a| (a + 1..count).map(move |b| (ImageId::new(a), ImageId::new(b)))).collect()
}

/// Pairs of images whose exposures are the same, at most `window` apart, or a power of two apart; sorted.
///
/// `exposures[i]` is the exposure of image i: images of one exposure, from whatever camera, are always a pair. Powers of
/// two reach far along the path at a cost that grows with its logarithm only.
#[must_use]
pub fn sequential(exposures: &[u32], window: u32) -> Vec<(ImageId, ImageId)> {
    let near = |a: u32, b: u32| {
        let apart = a.abs_diff(b);
        apart <= window || apart.is_power_of_two()
    };
    exhaustive(exposures.len()).into_iter().filter(|(a, b)| near(exposures[a.index()], exposures[b.index()])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequential_pairs_hold_rig_partners_neighbours_and_powers_of_two() {
        // Two cameras, forty exposures.
        let exposures: Vec<u32> = (0..40).chain(0..40).collect();
        let pairs = sequential(&exposures, 3);
        let has = |a: usize, b: usize| pairs.binary_search(&(ImageId::new(a), ImageId::new(b))).is_ok();
        assert!(has(5, 45), "rig partners");
        assert!(has(5, 8) && has(5, 48), "neighbours in time, also across cameras");
        assert!(has(5, 37), "32 apart");
        assert!(!has(5, 12), "7 apart");
        assert_eq!(exhaustive(4).len(), 6);
        assert!(exhaustive(1).is_empty());
    }
}
