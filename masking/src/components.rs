//! Connected components, by runs: 8-connected for structure, so that holes are 4-connected.

use crate::BitMask;
use crate::bits::for_runs;

/// A horizontal run of set pixels: columns `from..to` of row `y`.
#[derive(Clone, Copy)]
struct Run {
    y: usize,
    from: usize,
    to: usize,
}

/// What is known of a component.
pub(crate) struct Component {
    /// Number of pixels.
    pub area: usize,
    /// Number of its pixels that are set in the second image as well.
    pub common: usize,
    /// Whether it touches the border of the image.
    pub at_border: bool,
}

/// The pixels of the components for which `keep` holds. `common` counts the pixels of a component that are set in `second`.
fn filter(image: &BitMask, second: Option<&BitMask>, diagonal: bool, keep: impl Fn(&Component) -> bool) -> BitMask {
    let (runs, row_starts) = runs(image);
    let mut parent: Vec<u32> = (0..runs.len() as u32).collect();
    for y in 1..image.height() {
        join_rows(&runs, row_starts[y - 1]..row_starts[y], row_starts[y]..row_starts[y + 1], diagonal, &mut parent);
    }
    let mut components: Vec<Component> = Vec::new();
    let mut index = vec![u32::MAX; runs.len()];
    for (i, run) in runs.iter().enumerate() {
        // Roots are the first runs of their components: an index exists when a later run asks for it.
        let root = find(&mut parent, i as u32) as usize;
        if index[root] == u32::MAX {
            index[root] = components.len() as u32;
            components.push(Component { area: 0, common: 0, at_border: false });
        }
        index[i] = index[root];
        let component = &mut components[index[i] as usize];
        component.area += run.to - run.from;
        component.common += second.map_or(0, |s| count_in_run(s.row(run.y), run));
        component.at_border |= run.y == 0 || run.y + 1 == image.height() || run.from == 0 || run.to == image.width();
    }
    let kept: Vec<bool> = components.iter().map(keep).collect();
    let mut out = BitMask::new(image.width(), image.height());
    for (run, &index) in runs.iter().zip(&index) {
        if kept[index as usize] {
            let row = out.row_mut(run.y);
            for_words(run, |word, bits| row[word] |= bits);
        }
    }
    out
}

/// Keeps the 8-connected components for which `keep(area, pixels in common with second)` holds.
///
/// # Panics
/// When the images differ in size.
#[must_use]
pub fn keep_components(image: &BitMask, second: &BitMask, keep: impl Fn(usize, usize) -> bool) -> BitMask {
    assert_eq!((image.width(), image.height()), (second.width(), second.height()), "same size");
    filter(image, Some(second), true, |c| keep(c.area, c.common))
}

/// Removes the 8-connected components of fewer than `min_area` pixels.
#[must_use]
pub fn remove_specks(image: &BitMask, min_area: usize) -> BitMask {
    filter(image, None, true, |c| c.area >= min_area)
}

/// Fills the holes (4-connected components of the background) of fewer than `min_area` pixels. What touches the border of the image is no hole: it may go
/// on outside.
#[must_use]
pub fn fill_holes(image: &BitMask, min_area: usize) -> BitMask {
    filter(&image.not(), None, false, |c| c.area >= min_area || c.at_border).not()
}

/// Fills the holes of which at least `min_share` lies in `second`; otherwise as [`fill_holes`].
///
/// # Panics
/// When the images differ in size.
#[must_use]
pub fn fill_holes_in(image: &BitMask, second: &BitMask, min_share: f64) -> BitMask {
    assert_eq!((image.width(), image.height()), (second.width(), second.height()), "same size");
    filter(&image.not(), Some(second), false, |c| c.at_border || (c.common as f64) < min_share * c.area as f64).not()
}

/// All runs in row order, and where each row starts in the list (with its end).
fn runs(image: &BitMask) -> (Vec<Run>, Vec<usize>) {
    let mut runs = Vec::new();
    let mut starts = Vec::with_capacity(image.height() + 1);
    for y in 0..image.height() {
        starts.push(runs.len());
        for_runs(image.row(y), image.width(), |from, to| runs.push(Run { y, from, to }));
    }
    starts.push(runs.len());
    (runs, starts)
}

fn join_rows(runs: &[Run], mut above: std::ops::Range<usize>, mut below: std::ops::Range<usize>, diagonal: bool, parent: &mut [u32]) {
    let reach = usize::from(diagonal);
    while !above.is_empty() && !below.is_empty() {
        let (a, b) = (&runs[above.start], &runs[below.start]);
        if a.from < b.to + reach && b.from < a.to + reach {
            let (ra, rb) = (find(parent, above.start as u32), find(parent, below.start as u32));
            // The smaller index becomes the root.
            parent[ra.max(rb) as usize] = ra.min(rb);
        }
        if a.to < b.to { above.start += 1 } else { below.start += 1 }
    }
}

fn find(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

fn count_in_run(row: &[u64], run: &Run) -> usize {
    let mut count = 0;
    for_words(run, |word, bits| count += (row[word] & bits).count_ones() as usize);
    count
}

/// Calls with every word of a run and its bits there.
fn for_words(run: &Run, mut f: impl FnMut(usize, u64)) {
    for word in run.from / 64..=(run.to - 1) / 64 {
        let from = run.from.saturating_sub(64 * word);
        let to = (run.to - 64 * word).min(64);
        f(word, (u64::MAX >> (64 - (to - from))) << from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Flood fill, pixel by pixel.
    fn naive(image: &BitMask, diagonal: bool, keep: impl Fn(usize, bool) -> bool) -> BitMask {
        let (w, h) = (image.width(), image.height());
        let mut seen = vec![false; w * h];
        let mut out = BitMask::new(w, h);
        for start in 0..w * h {
            if seen[start] || !image.get(start % w, start / w) {
                continue;
            }
            let mut pixels = vec![start];
            seen[start] = true;
            let mut next = 0;
            while next < pixels.len() {
                let (x, y) = (pixels[next] % w, pixels[next] / w);
                next += 1;
                for v in y.saturating_sub(1)..(y + 2).min(h) {
                    for u in x.saturating_sub(1)..(x + 2).min(w) {
                        if (diagonal || u == x || v == y) && image.get(u, v) && !seen[v * w + u] {
                            seen[v * w + u] = true;
                            pixels.push(v * w + u);
                        }
                    }
                }
            }
            let border = pixels.iter().any(|p| p % w == 0 || p % w == w - 1 || p / w == 0 || p / w == h - 1);
            if keep(pixels.len(), border) {
                pixels.iter().for_each(|p| out.set(p % w, p / w));
            }
        }
        out
    }

    proptest! {
        #[test]
        fn agrees_with_flood_fill(w in 1usize..150, h in 1usize..12, density in 5u32..95, seed: u32, min_area in 0usize..30) {
            let values: Vec<u32> = (0..w * h).map(|i| (i as u32 ^ seed).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(0x9E37_79B9) >> 16).collect();
            let image = BitMask::from_test(w, h, &values, |v| v % 100 < density);
            prop_assert_eq!(remove_specks(&image, min_area), naive(&image, true, |area, _| area >= min_area));
            let holes_filled = naive(&image.not(), false, |area, border| area >= min_area || border).not();
            prop_assert_eq!(fill_holes(&image, min_area), holes_filled);
        }
    }

    #[test]
    fn components_by_what_they_share() {
        let mut image = BitMask::new(100, 3);
        let mut second = BitMask::new(100, 3);
        (0..70).for_each(|x| image.set(x, 0));
        (80..90).for_each(|x| image.set(x, 2));
        second.set(65, 0);
        second.set(99, 2);
        let kept = keep_components(&image, &second, |area, common| area == 70 && common == 1);
        assert_eq!((kept.count(), kept.get(69, 0), kept.get(80, 2)), (70, true, false));
    }

    #[test]
    fn holes_are_filled_by_what_they_lie_in() {
        // Two frames with a hole of 5 x 3 pixels each; the second image covers the left one.
        let image =
            BitMask::from_test(20, 5, &std::array::from_fn::<u8, 100, _>(|i| u8::from(i / 20 % 4 == 0 || i % 20 % 6 == 0)), |v| v == 1);
        let left = BitMask::from_test(20, 5, &std::array::from_fn::<usize, 100, _>(|i| i % 20), |x| x < 6);
        let filled = fill_holes_in(&image, &left, 0.9);
        assert_eq!((filled.get(3, 2), filled.get(9, 2)), (true, false));
        assert_eq!(filled.count(), image.count() + 15);
    }
}
