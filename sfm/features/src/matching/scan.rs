//! The two nearest of every row and every column, from one pass over all distances.
//!
//! The squared distance of two descriptors is below 2^23 (128 x 255^2), so a distance and an 8-bit position fit one word, the *key*
//! `256 d + position`: keeping the two smallest keys keeps distances and positions, with ties going to the lower position. The
//! position is that of a vector in a *stretch* of 256 vectors of columns, or of a row in a *block* of 256 rows. Keys of padding have the
//! highest bit set.

use super::lanes::Lanes;
use super::packed::{Packed, Words};
use scene::Descriptor;

/// Rows that share a block; positions have eight bits.
const BLOCK: usize = 256;
/// Vectors of columns that share a stretch.
const STRETCH: usize = 256;
/// Bytes of columns that are kept in the first-level cache while the rows of a block pass by.
const PANEL_BYTES: usize = 16 << 10;
/// Keys from here on belong to padding.
const NO_KEY: u32 = 1 << 31;

/// The nearest neighbour of one descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Nearest {
    /// Squared distance of the nearest.
    pub distance: u32,
    /// Index of the nearest, the lowest on ties.
    pub index: u32,
    /// Squared distance of the second nearest; `u32::MAX` where there is none.
    pub second: u32,
}

impl Nearest {
    pub(crate) const NONE: Self = Self { distance: u32::MAX, index: u32::MAX, second: u32::MAX };

    /// Takes in another candidate; ties go to the lower index.
    #[inline(always)]
    fn offer(&mut self, distance: u32, index: u32) {
        if (distance, index) < (self.distance, self.index) {
            self.second = self.distance;
            (self.distance, self.index) = (distance, index);
        } else if distance < self.second {
            self.second = distance;
        }
    }
}

/// Neighbours in both directions; neither list is empty.
pub(super) struct Neighbours {
    /// Nearest column of each row.
    pub of_rows: Vec<Nearest>,
    /// Nearest row of each column.
    pub of_columns: Vec<Nearest>,
}

/// The two smallest keys so far, for each lane of a list of vectors.
struct Smallest {
    first: Words,
    second: Words,
}

impl Smallest {
    fn new(len: usize) -> Self {
        Self { first: Words::new(len, u32::MAX), second: Words::new(len, u32::MAX) }
    }

    fn clear(&mut self) {
        self.first.as_mut_slice().fill(u32::MAX);
        self.second.as_mut_slice().fill(u32::MAX);
    }
}

/// Scans all pairs in register tiles of `R` rows and `C` vectors of columns.
///
/// # Safety
/// The machine has the instructions of `L`.
#[inline(always)]
pub(super) unsafe fn scan<L: Lanes, const R: usize, const C: usize>(rows: &[Descriptor], columns: &[Descriptor]) -> Neighbours {
    let group = C * L::WIDTH;
    let (a, b) = (Packed::rows::<L>(rows, R), Packed::columns::<L>(columns, group));
    let groups = b.keys.as_slice().len() / group;
    let panel = (PANEL_BYTES / (group * L::WORDS * 4)).max(1);
    let mut found = Neighbours { of_rows: vec![Nearest::NONE; rows.len()], of_columns: vec![Nearest::NONE; columns.len()] };
    let mut row_smallest = Smallest::new(BLOCK * L::WIDTH);
    let mut column_smallest = Smallest::new(groups * group);
    for first_row in (0..rows.len()).step_by(BLOCK) {
        let block_groups = (rows.len() - first_row).min(BLOCK).div_ceil(R);
        column_smallest.clear();
        for stretch in (0..groups).step_by(STRETCH / C) {
            let stretch_end = (stretch + STRETCH / C).min(groups);
            row_smallest.clear();
            for start in (stretch..stretch_end).step_by(panel) {
                let end = (start + panel).min(stretch_end);
                for g in 0..block_groups {
                    let row = first_row + g * R;
                    let tiles = Tiles::<R> {
                        row_words: a.words.as_slice()[row * L::WORDS..][..R * L::WORDS].as_ptr(),
                        row_keys: a.keys.as_slice()[row..][..R].as_ptr(),
                        column_words: b.words.as_slice()[start * group * L::WORDS..end * group * L::WORDS].as_ptr(),
                        column_keys: b.keys.as_slice()[start * group..end * group].as_ptr(),
                        count: end - start,
                        row_position: (g * R) as u32,
                        column_position: ((start - stretch) * C) as u32,
                    };
                    let in_block = g * R * L::WIDTH..(g + 1) * R * L::WIDTH;
                    let row_state =
                        (&mut row_smallest.first.as_mut_slice()[in_block.clone()], &mut row_smallest.second.as_mut_slice()[in_block]);
                    let in_panel = start * group..end * group;
                    let column_state =
                        (&mut column_smallest.first.as_mut_slice()[in_panel.clone()], &mut column_smallest.second.as_mut_slice()[in_panel]);
                    // SAFETY: the slices above hold R rows, `count` groups of columns and the state of both.
                    unsafe { tiles.run::<L, C>(row_state, column_state) };
                }
            }
            let first_column = (stretch * group) as u32;
            for (i, nearest) in found.of_rows[first_row..].iter_mut().take(BLOCK).enumerate() {
                for lane in 0..L::WIDTH {
                    let index = |key: u32| first_column + (key & 255) * L::WIDTH as u32 + lane as u32;
                    let keys = [&row_smallest.first, &row_smallest.second].map(|s| s.as_slice()[i * L::WIDTH + lane]);
                    for key in keys.into_iter().filter(|&key| key < NO_KEY) {
                        nearest.offer(key >> 8, index(key));
                    }
                }
            }
        }
        let keys = column_smallest.first.as_slice().iter().zip(column_smallest.second.as_slice());
        for (nearest, (&first, &second)) in found.of_columns.iter_mut().zip(keys) {
            for key in [first, second].into_iter().filter(|&key| key < NO_KEY) {
                nearest.offer(key >> 8, first_row as u32 + (key & 255));
            }
        }
    }
    found
}

/// A few rows against a panel of columns.
struct Tiles<const R: usize> {
    row_words: *const u32,
    row_keys: *const u32,
    column_words: *const u32,
    column_keys: *const u32,
    /// Groups of columns.
    count: usize,
    /// Of the first row in its block.
    row_position: u32,
    /// Of the first vector in its stretch.
    column_position: u32,
}

impl<const R: usize> Tiles<R> {
    /// # Safety
    /// The pointers hold R rows and `count` groups of C vectors of columns, the states as many, and the machine has the instructions.
    #[inline(always)]
    unsafe fn run<L: Lanes, const C: usize>(&self, rows: (&mut [u32], &mut [u32]), columns: (&mut [u32], &mut [u32])) {
        let (row_first, row_second) = (rows.0.as_mut_ptr(), rows.1.as_mut_ptr());
        let (column_first, column_second) = (columns.0.as_mut_ptr(), columns.1.as_mut_ptr());
        // SAFETY: all offsets stay below what the caller promises.
        unsafe {
            for t in 0..self.count {
                let dots = self.dots::<L, C>(self.column_words.add(t * C * L::WIDTH * L::WORDS));
                for c in 0..C {
                    let at = (t * C + c) * L::WIDTH;
                    let column_key = L::load(self.column_keys.add(at));
                    let column_position = L::splat(self.column_position + (t * C + c) as u32);
                    let (mut first, mut second) = (L::load(column_first.add(at)), L::load(column_second.add(at)));
                    for r in 0..R {
                        // 256 (|a|^2 + |b|^2 - 2 a . b).
                        let key = L::sub_512(L::add(L::splat(*self.row_keys.add(r)), column_key), dots[r][c]);
                        let from_row = L::add(key, L::splat(self.row_position + r as u32));
                        second = L::min(second, L::max(first, from_row));
                        first = L::min(first, from_row);
                        let from_column = L::add(key, column_position);
                        let (row_first, row_second) = (row_first.add(r * L::WIDTH), row_second.add(r * L::WIDTH));
                        let nearest = L::load(row_first);
                        L::store(row_second, L::min(L::load(row_second), L::max(nearest, from_column)));
                        L::store(row_first, L::min(nearest, from_column));
                    }
                    L::store(column_first.add(at), first);
                    L::store(column_second.add(at), second);
                }
            }
        }
    }

    /// Dot products of R rows and C vectors of columns.
    #[inline(always)]
    unsafe fn dots<L: Lanes, const C: usize>(&self, column_words: *const u32) -> [[L::Vector; C]; R] {
        // SAFETY: as in `run`.
        unsafe {
            let mut sums = [[L::splat(0); C]; R];
            for k in 0..L::WORDS {
                let mut columns = [L::splat(0); C];
                for c in 0..C {
                    columns[c] = L::load(column_words.add((k * C + c) * L::WIDTH));
                }
                for r in 0..R {
                    let row = L::splat(*self.row_words.add(k * R + r));
                    for c in 0..C {
                        sums[r][c] = L::multiply_add(sums[r][c], row, columns[c]);
                    }
                }
            }
            sums
        }
    }
}
