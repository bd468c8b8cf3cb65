//! All pairs, and pairs along the path.

use scene::ImageId;
use std::collections::BTreeMap;

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
    let mut images: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (image, &exposure) in exposures.iter().enumerate() {
        images.entry(exposure).or_default().push(image);
    }
    let mut pairs = Vec::new();
    let mut join = |some: &[usize], others: &[usize]| {
        pairs.extend(some.iter().flat_map(|&a| others.iter().map(move |&b| (ImageId::new(a.min(b)), ImageId::new(a.max(b))))));
    };
    for (&exposure, here) in &images {
        for (i, image) in here.iter().enumerate() {
            join(&[*image], &here[i + 1..]);
        }
        let near = exposure.saturating_add(window);
        let farther = (0..u32::BITS).filter_map(|power| exposure.checked_add(1 << power)).filter(|&other| other > near);
        let neighbours = images.range(exposure..=near).skip(1).map(|(_, there)| there);
        for there in neighbours.chain(farther.filter_map(|other| images.get(&other))) {
            join(here, there);
        }
    }
    pairs.sort_unstable();
    pairs
}

/// The pairs of both lists, sorted, each once.
#[must_use]
pub fn union(mut some: Vec<(ImageId, ImageId)>, others: &[(ImageId, ImageId)]) -> Vec<(ImageId, ImageId)> {
    some.extend_from_slice(others);
    some.sort_unstable();
    some.dedup();
    some
}
