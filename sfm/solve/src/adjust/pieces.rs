//! Deterministic parallel work: fixed pieces over split slices, no allocation.

use std::ops::Range;

/// Mutable data that can be cut where a piece begins.
pub(super) trait Cut: Sized + Send {
    /// The data of the pieces before `at`, and of those from `at` on.
    fn cut(self, at: usize) -> (Self, Self);
}

/// Calls `work` once for each piece with that piece's data. What is written does not depend on `parallel` or the number
/// of threads, since a piece sees only its own data.
pub(super) fn for_each_piece<D: Cut>(pieces: Range<usize>, data: D, parallel: bool, work: &(impl Fn(usize, D) + Sync)) {
    match pieces.len() {
        0 => {}
        1 => work(pieces.start, data),
        _ => {
            let middle = pieces.start + pieces.len() / 2;
            let (low, high) = data.cut(middle);
            let (low_pieces, high_pieces) = (pieces.start..middle, middle..pieces.end);
            if parallel {
                rayon::join(|| for_each_piece(low_pieces, low, true, work), || for_each_piece(high_pieces, high, true, work));
            } else {
                for_each_piece(low_pieces, low, false, work);
                for_each_piece(high_pieces, high, false, work);
            }
        }
    }
}

/// A slice cut into pieces: piece i is `starts[i]..starts[i + 1]`, counted as in the whole slice.
pub(super) struct Sliced<'a, T> {
    data: &'a mut [T],
    starts: &'a [usize],
    /// Where `data` begins in the whole slice.
    base: usize,
}

impl<'a, T> Sliced<'a, T> {
    pub fn new(data: &'a mut [T], starts: &'a [usize]) -> Self {
        Self { data, starts, base: 0 }
    }

    pub fn into_inner(self) -> &'a mut [T] {
        self.data
    }
}

impl<T: Send> Cut for Sliced<'_, T> {
    fn cut(self, at: usize) -> (Self, Self) {
        let middle = self.starts[at];
        let (low, high) = self.data.split_at_mut(middle - self.base);
        (Self { data: low, starts: self.starts, base: self.base }, Self { data: high, starts: self.starts, base: middle })
    }
}

impl<A: Cut, B: Cut> Cut for (A, B) {
    fn cut(self, at: usize) -> (Self, Self) {
        let ((a, c), (b, d)) = (self.0.cut(at), self.1.cut(at));
        ((a, b), (c, d))
    }
}

impl<A: Cut, B: Cut, C: Cut> Cut for (A, B, C) {
    fn cut(self, at: usize) -> (Self, Self) {
        let ((a0, a1), (b0, b1), (c0, c1)) = (self.0.cut(at), self.1.cut(at), self.2.cut(at));
        ((a0, b0, c0), (a1, b1, c1))
    }
}

impl<A: Cut, B: Cut, C: Cut, D: Cut> Cut for (A, B, C, D) {
    fn cut(self, at: usize) -> (Self, Self) {
        let ((a, b), (c, d)) = ((self.0, self.1).cut(at), (self.2, self.3).cut(at));
        ((a.0, a.1, c.0, c.1), (b.0, b.1, d.0, d.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_piece_gets_its_own_data() {
        let starts = [0, 2, 2, 7, 10];
        for parallel in [false, true] {
            let (mut items, mut sums) = ((0..10).collect::<Vec<usize>>(), [0; 4]);
            let singles = [0, 1, 2, 3, 4];
            let data = (Sliced::new(&mut items, &starts), Sliced::new(&mut sums, &singles));
            for_each_piece(0..4, data, parallel, &|piece, (items, sum)| {
                let items = items.into_inner();
                assert_eq!(items.len(), starts[piece + 1] - starts[piece]);
                sum.into_inner()[0] = items.iter().sum();
            });
            assert_eq!(sums, [1, 0, 2 + 3 + 4 + 5 + 6, 7 + 8 + 9]);
        }
    }
}
