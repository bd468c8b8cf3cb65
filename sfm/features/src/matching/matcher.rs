//! From neighbours to matches.

use super::instructions::Instructions;
use super::scan::Nearest;
use scene::{Descriptor, KeypointIndex};

/// Length of a descriptor of unit norm: RootSIFT is stored in 512ths.
const UNIT: f64 = 512.0;

/// Options of [`match_descriptors`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchOptions {
    /// The nearest neighbour must be nearer than this times the distance of the second nearest (Lowe, IJCV 2004). Distances are Euclidean.
    /// A descriptor with a single candidate passes.
    pub max_ratio: f32,
    /// Largest Euclidean distance between matched descriptors of unit length, 0..=1.41. COLMAP's 0.7 is an angle: that is 0.686 here.
    pub max_distance: f32,
    /// Whether matches must be each other's nearest neighbours and pass the ratio test both ways. Without, each descriptor of the second
    /// list goes to the nearest of those of the first list that chose it.
    pub mutual: bool,
}

impl Default for MatchOptions {
    fn default() -> Self {
        Self { max_ratio: 0.8, max_distance: 0.7, mutual: true }
    }
}

impl MatchOptions {
    /// Whether a neighbour is near enough and clearly nearer than any other.
    pub(crate) fn accepts(&self, nearest: &Nearest) -> bool {
        let (ratio, limit) = (f64::from(self.max_ratio), f64::from(self.max_distance) * UNIT);
        let distance = f64::from(nearest.distance);
        let clear = nearest.second == u32::MAX || distance < ratio * ratio * f64::from(nearest.second);
        clear && distance <= limit * limit
    }
}

/// Matches between two lists of descriptors: pairs of positions in them, sorted, one to one.
///
/// Exhaustive and exact: squared distances are integers, ties go to the lower index, so the result is the same on every machine. Of equal
/// descriptors in one list none matches while `max_ratio` is at most 1, for none is clearly nearer than the other. With
/// `mutual`, exchanging the lists exchanges the pairs. Runs on one thread.
#[must_use]
pub fn match_descriptors(a: &[Descriptor], b: &[Descriptor], options: &MatchOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
    match_with(Instructions::best(), a, b, options)
}

/// The position of the nearest of `among` for each of `of`, the lowest on ties. Exact. Empty where nothing is among.
pub(crate) fn nearest(of: &[Descriptor], among: &[Descriptor]) -> Vec<u32> {
    if of.is_empty() || among.is_empty() {
        return Vec::new();
    }
    Instructions::best().scan(of, among).of_rows.iter().map(|nearest| nearest.index).collect()
}

/// [`match_descriptors`] with a given instruction set.
pub(super) fn match_with(
    instructions: Instructions,
    a: &[Descriptor],
    b: &[Descriptor],
    options: &MatchOptions,
) -> Vec<(KeypointIndex, KeypointIndex)> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let found = instructions.scan(a, b);
    let mut chosen: Vec<(u32, u32)> = Vec::new();
    for (i, nearest) in found.of_rows.iter().enumerate().filter(|(_, nearest)| options.accepts(nearest)) {
        let back = &found.of_columns[nearest.index as usize];
        if !options.mutual || (back.index as usize == i && options.accepts(back)) {
            chosen.push((i as u32, nearest.index));
        }
    }
    if !options.mutual {
        let distance = |&(i, j): &(u32, u32)| (j, found.of_rows[i as usize].distance, i);
        chosen.sort_unstable_by_key(distance);
        chosen.dedup_by_key(|&mut (_, j)| j);
        chosen.sort_unstable();
    }
    chosen.into_iter().map(|(i, j)| (KeypointIndex(i), KeypointIndex(j))).collect()
}
