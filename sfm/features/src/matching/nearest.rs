//! Nearest neighbours in both directions from one pass over all pairs.

use super::kernel::{COLUMNS, Kernel, Packed, ROWS, pack};
use scene::{Descriptor, KeypointIndex};

/// Groups of the right list that are compared with all rows before the next: 32 x 2 KiB stay in the cache.
const GROUPS_AT_ONCE: usize = 32;

/// Which matches are kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchOptions {
    /// Largest ratio of the distance to the nearest and to the second nearest descriptor (Lowe 2004).
    pub max_ratio: f32,
    /// Largest Euclidean distance, for descriptors of length 1. Two that have nothing in common are sqrt(2) apart.
    pub max_distance: f32,
}

impl Default for MatchOptions {
    fn default() -> Self {
        Self { max_ratio: 0.8, max_distance: 0.7 }
    }
}

/// Length of a descriptor of length 1 after its scaling to bytes.
const UNIT: f32 = 512.0;

/// The two nearest of a list; distances are squared, of bytes.
#[derive(Clone, Copy)]
struct Nearest {
    best: i32,
    second: i32,
    index: u32,
}

impl Nearest {
    const NONE: Self = Self { best: i32::MAX, second: i32::MAX, index: u32::MAX };

    #[inline(always)]
    fn see(&mut self, squared: i32, index: u32) {
        if squared < self.best {
            self.second = self.best;
            self.best = squared;
            self.index = index;
        } else if squared < self.second {
            self.second = squared;
        }
    }
}

/// Pairs of descriptors that are each other's nearest, clearly nearer than the second nearest; sorted, one to one.
///
/// Distances are exact whole numbers; of equal ones the lower index wins. Runs on one thread: pairs of images are
/// matched in parallel.
#[must_use]
pub fn match_descriptors(a: &[Descriptor], b: &[Descriptor], options: &MatchOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
    match_with(Kernel::best(), a, b, options)
}

fn match_with(kernel: Kernel, a: &[Descriptor], b: &[Descriptor], options: &MatchOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let (rows, columns) = nearest(kernel, a, b);
    let limit = (options.max_distance * UNIT).powi(2);
    let ratio = options.max_ratio * options.max_ratio;
    let clear = |n: &Nearest| n.best as f32 <= limit && (n.second == i32::MAX || (n.best as f32) < ratio * n.second as f32);
    rows.iter()
        .enumerate()
        .filter(|(i, row)| clear(row) && columns[row.index as usize].index as usize == *i)
        .map(|(i, row)| (KeypointIndex::new(i), KeypointIndex(row.index)))
        .collect()
}

fn nearest(kernel: Kernel, a: &[Descriptor], b: &[Descriptor]) -> (Vec<Nearest>, Vec<Nearest>) {
    let norm = |d: &Descriptor| d.iter().map(|&v| i32::from(v) * i32::from(v)).sum::<i32>();
    let (norms_a, norms_b): (Vec<i32>, Vec<i32>) = (a.iter().map(norm).collect(), b.iter().map(norm).collect());
    let groups = pack(b);
    let mut rows = vec![Nearest::NONE; a.len()];
    let mut columns = vec![Nearest::NONE; b.len()];
    for (part, some) in groups.chunks(GROUPS_AT_ONCE).enumerate() {
        for first in (0..a.len()).step_by(ROWS) {
            let count = ROWS.min(a.len() - first);
            let four: [&Descriptor; ROWS] = std::array::from_fn(|i| &a[first + i.min(count - 1)]);
            block(kernel, four, first, count, some, part * GROUPS_AT_ONCE * COLUMNS, (&norms_a, &norms_b), (&mut rows, &mut columns));
        }
    }
    (rows, columns)
}

#[allow(clippy::too_many_arguments, reason = "an inner loop takes what it needs, flat")]
fn block(
    kernel: Kernel,
    four: [&Descriptor; ROWS],
    first_row: usize,
    count: usize,
    groups: &[Packed],
    first_column: usize,
    norms: (&[i32], &[i32]),
    nearest: (&mut [Nearest], &mut [Nearest]),
) {
    let mut dots = [[0; COLUMNS]; ROWS];
    for (g, group) in groups.iter().enumerate() {
        kernel.dots(four, group, &mut dots);
        let start = first_column + g * COLUMNS;
        let here = &norms.1[start..(start + COLUMNS).min(norms.1.len())];
        let columns = &mut nearest.1[start..start + here.len()];
        for i in 0..count {
            let norm = norms.0[first_row + i];
            let mut squared = [i32::MAX; COLUMNS];
            for ((s, n), d) in squared.iter_mut().zip(here).zip(&dots[i]) {
                *s = norm + n - 2 * d;
            }
            let row = &mut nearest.0[first_row + i];
            // Most blocks hold nothing new for a row: one look at the least value tells.
            let least = squared.iter().fold(i32::MAX, |a, &b| a.min(b));
            if least < row.second {
                for (j, &s) in squared[..here.len()].iter().enumerate() {
                    row.see(s, (start + j) as u32);
                }
            }
            // A column needs its nearest only. Written without branches, so that it becomes vector instructions.
            for (column, &s) in columns.iter_mut().zip(&squared) {
                let nearer = s < column.best;
                column.index = if nearer { (first_row + i) as u32 } else { column.index };
                column.best = if nearer { s } else { column.best };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The definition, word for word.
    fn plain(a: &[Descriptor], b: &[Descriptor], options: &MatchOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
        let squared = |x: &Descriptor, y: &Descriptor| x.iter().zip(y).map(|(p, q)| (i32::from(*p) - i32::from(*q)).pow(2)).sum::<i32>();
        let closest = |x: &Descriptor, list: &[Descriptor]| {
            let mut ranked: Vec<(i32, usize)> = list.iter().enumerate().map(|(i, y)| (squared(x, y), i)).collect();
            ranked.sort_unstable();
            ranked
        };
        let mut out = Vec::new();
        for (i, x) in a.iter().enumerate() {
            let near = closest(x, b);
            let Some(&(best, j)) = near.first() else { continue };
            let ratio = options.max_ratio * options.max_ratio;
            let clear = near.get(1).is_none_or(|&(second, _)| (best as f32) < ratio * second as f32);
            if clear && best as f32 <= (options.max_distance * UNIT).powi(2) && closest(&b[j], a)[0].1 == i {
                out.push((KeypointIndex::new(i), KeypointIndex::new(j)));
            }
        }
        out
    }

    /// Lists with near duplicates, so that matches, ties and refusals all occur.
    fn lists() -> impl Strategy<Value = (Vec<Descriptor>, Vec<Descriptor>)> {
        (0usize..40, 0usize..70, any::<u64>()).prop_map(|(n, m, seed)| {
            let mut state = seed;
            let mut next = move || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as u8
            };
            let a: Vec<Descriptor> = (0..n).map(|_| std::array::from_fn(|_| next() / 4)).collect();
            let b = (0..m)
                .map(|_| {
                    let pick = usize::from(next());
                    let noise = next() % 3;
                    match a.get(pick % (2 * n + 1)) {
                        Some(d) => d.map(|v| v.saturating_add(next() % (noise + 1))),
                        None => std::array::from_fn(|_| next() / 4),
                    }
                })
                .collect();
            (a, b)
        })
    }

    proptest! {
        #[test]
        fn equals_the_definition((a, b) in lists(), ratio in 0.5..1.0f32) {
            let options = MatchOptions { max_ratio: ratio, ..MatchOptions::default() };
            let expected = plain(&a, &b, &options);
            for kernel in Kernel::available() {
                prop_assert_eq!(&match_with(kernel, &a, &b, &options), &expected, "{:?}", kernel);
            }
        }
    }

    #[test]
    fn nothing_matches_nothing() {
        let one = [[7u8; 128]];
        assert!(match_descriptors(&[], &one, &MatchOptions::default()).is_empty());
        assert!(match_descriptors(&one, &[], &MatchOptions::default()).is_empty());
        assert_eq!(match_descriptors(&one, &one, &MatchOptions::default()).len(), 1);
    }
}
