//! Descriptors laid out in the order in which the scan reads them.

use super::lanes::Lanes;
use scene::Descriptor;

/// A cache line, so that vectors never straddle two.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Line([u32; 16]);

/// Words that start on a cache line.
pub(super) struct Words {
    lines: Vec<Line>,
    len: usize,
}

impl Words {
    pub(super) fn new(len: usize, value: u32) -> Self {
        Self { lines: vec![Line([value; 16]); len.div_ceil(16)], len }
    }

    pub(super) fn as_slice(&self) -> &[u32] {
        &bytemuck::cast_slice(&self.lines)[..self.len]
    }

    pub(super) fn as_mut_slice(&mut self) -> &mut [u32] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.len]
    }
}

/// What pads a list to full groups: its key (see the scan) is above all others.
const PADDING_KEY: u32 = 1 << 31;

/// One list in groups of descriptors; within a group, word k of all descriptors before word k + 1 of any.
pub(super) struct Packed {
    /// Words of the groups.
    pub words: Words,
    /// A descriptor's part of the distance that does not depend on the other, times 256. Wraps.
    pub keys: Words,
}

impl Packed {
    /// Rows, in groups of `group`.
    pub(super) fn rows<L: Lanes>(descriptors: &[Descriptor], group: usize) -> Self {
        Self::new(descriptors, group, L::WORDS, L::row_word, |d| squared_norm(d) << 8)
    }

    /// Columns, in groups of `group`.
    ///
    /// For a row less its offset o, `a . b = (a - o) . b + o sum(b)`, so `-2 a . b` brings `-2 o sum(b)` to the column's part.
    pub(super) fn columns<L: Lanes>(descriptors: &[Descriptor], group: usize) -> Self {
        Self::new(descriptors, group, L::WORDS, L::column_word, |d| {
            let sum: u32 = d.iter().map(|&v| u32::from(v)).sum();
            squared_norm(d).wrapping_sub(2 * L::ROW_OFFSET * sum) << 8
        })
    }

    fn new(
        descriptors: &[Descriptor],
        group: usize,
        words_each: usize,
        word: impl Fn(&Descriptor, usize) -> u32,
        key: impl Fn(&Descriptor) -> u32,
    ) -> Self {
        let padded = descriptors.len().next_multiple_of(group);
        let mut keys = Words::new(padded, PADDING_KEY);
        for (to, d) in keys.as_mut_slice().iter_mut().zip(descriptors) {
            *to = key(d);
        }
        let mut words = Words::new(padded * words_each, 0);
        const NOTHING: &Descriptor = &[0; 128];
        for (g, to) in words.as_mut_slice().chunks_exact_mut(group * words_each).enumerate() {
            for i in 0..group {
                let d = descriptors.get(g * group + i).unwrap_or(NOTHING);
                for k in 0..words_each {
                    to[k * group + i] = word(d, k);
                }
            }
        }
        Self { words, keys }
    }
}

fn squared_norm(d: &Descriptor) -> u32 {
    d.iter().map(|&v| u32::from(v) * u32::from(v)).sum()
}
