//! Which blocks of the reduced system are stored, and where.

use super::layout::{Incidence, Layout, NONE, Slot};
use super::lengths::KeptNormal;

/// Reduced systems up to this size are dense whatever their pattern.
const DENSE_UNKNOWNS: usize = 300;
/// Larger ones are dense when at least this share of their lower triangle is. Measured on chains of frames: with 100 frames
/// the solutions take the same time at a share of 0.4, with 200 frames the sparse one takes half the time at 0.5.
const DENSE_SHARE: f64 = 0.5;

/// Layout of the panels of [`super::schur`].
#[derive(Debug)]
pub(super) struct Pattern {
    /// Where the panel of each block begins; one more entry, the length.
    pub panel_start: Vec<usize>,
    /// Rows of each panel.
    pub stride: Vec<usize>,
    /// `None` when each panel has all rows of the matrix.
    pub sparse: Option<SparsePattern>,
    offsets: Vec<usize>,
}

/// Rows of the panels of a sparse system.
#[derive(Debug)]
pub(super) struct SparsePattern {
    /// (block, first row) of each panel, ascending.
    pub rows: Vec<(u32, u32)>,
    pub rows_start: Vec<usize>,
    /// First row of each product of the elimination, by point: see [`super::layout::Slot::first_product`].
    product_rows: Vec<u32>,
}

impl Pattern {
    pub fn new(layout: &Layout, kept: &KeptNormal) -> Self {
        let n = layout.unknowns();
        if n > DENSE_UNKNOWNS {
            let met = Meetings::new(layout, kept);
            if (met.values(layout) as f64) < DENSE_SHARE * (n * n) as f64 / 2.0 {
                return Self::from_meetings(layout, &met);
            }
        }
        Self::dense(layout)
    }

    pub fn dense(layout: &Layout) -> Self {
        let n = layout.unknowns();
        Self {
            panel_start: layout.offsets.iter().map(|o| o * n).collect(),
            stride: vec![n; layout.block_count()],
            sparse: None,
            offsets: layout.offsets.clone(),
        }
    }

    #[cfg(test)]
    pub fn sparse(layout: &Layout, kept: &KeptNormal) -> Self {
        Self::from_meetings(layout, &Meetings::new(layout, kept))
    }

    fn from_meetings(layout: &Layout, met: &Meetings) -> Self {
        let mut pattern = Self { panel_start: vec![0], stride: Vec::new(), sparse: None, offsets: layout.offsets.clone() };
        let mut sparse = SparsePattern { rows: Vec::new(), rows_start: vec![0], product_rows: Vec::new() };
        for a in 0..layout.block_count() {
            let mut row = 0;
            for b in met.of(a) {
                sparse.rows.push((b as u32, row));
                row += layout.dim(b) as u32;
            }
            sparse.rows_start.push(sparse.rows.len());
            pattern.stride.push(row as usize);
            pattern.panel_start.push(pattern.panel_start[a] + row as usize * layout.dim(a));
        }
        sparse.product_rows.reserve(layout.block_products.iter().sum());
        for (a, others) in products(layout) {
            let rows = &sparse.rows[sparse.rows_start[a as usize]..sparse.rows_start[a as usize + 1]];
            let mut from = 0;
            for b in others {
                from += rows[from..].partition_point(|r| r.0 < b.block);
                sparse.product_rows.push(rows[from].1);
            }
        }
        pattern.sparse = Some(sparse);
        pattern
    }

    /// Number of stored values.
    pub fn len(&self) -> usize {
        self.panel_start[self.panel_start.len() - 1]
    }

    /// First row of block `b` in the panel of block `a`, which meets it.
    pub fn row(&self, a: usize, b: u32) -> usize {
        match &self.sparse {
            None => self.offsets[b as usize],
            Some(sparse) => {
                let rows = &sparse.rows[sparse.rows_start[a]..sparse.rows_start[a + 1]];
                rows[rows.partition_point(|r| r.0 < b)].1 as usize
            }
        }
    }

    /// First row of a product of the elimination, which is with `block`.
    #[inline(always)]
    pub fn product_row(&self, product: usize, block: u32) -> usize {
        match &self.sparse {
            None => self.offsets[block as usize],
            Some(sparse) => sparse.product_rows[product] as usize,
        }
    }
}

/// For each block, the blocks from it on that some residual or point couples with it: a bit for each.
struct Meetings {
    words: usize,
    bits: Vec<u64>,
}

impl Meetings {
    fn new(layout: &Layout, kept: &KeptNormal) -> Self {
        let blocks = layout.block_count();
        let words = blocks.div_ceil(64).max(1);
        let mut bits = vec![0u64; blocks * words];
        let mut meet = |a: u32, b: u32| bits[a as usize * words + b as usize / 64] |= 1 << (b % 64);
        (0..blocks as u32).for_each(|a| meet(a, a));
        kept.pairs.iter().for_each(|&(a, b, _)| meet(a, b));
        for view in &layout.views {
            for (i, &a) in view.block.iter().enumerate().filter(|(_, a)| **a != NONE) {
                view.block[i..].iter().filter(|&&b| b != NONE).for_each(|&b| meet(a, b));
            }
        }
        for (a, others) in products(layout) {
            others.iter().for_each(|b| meet(a, b.block));
        }
        Self { words, bits }
    }

    /// The blocks that `a` meets, ascending.
    fn of(&self, a: usize) -> impl Iterator<Item = usize> + '_ {
        self.bits[a * self.words..(a + 1) * self.words].iter().enumerate().flat_map(|(word, &bits)| {
            let next = |bits: &u64| Some(bits & (bits - 1)).filter(|&rest| rest != 0);
            let sets = std::iter::successors(Some(bits).filter(|&b| b != 0), next);
            sets.map(move |bits| 64 * word + bits.trailing_zeros() as usize)
        })
    }

    /// Number of values of all panels.
    fn values(&self, layout: &Layout) -> usize {
        (0..layout.block_count()).map(|a| layout.dim(a) * self.of(a).map(|b| layout.dim(b)).sum::<usize>()).sum()
    }
}

/// Each block that a point meets, with it and those after it, point by point: the products of the elimination.
fn products(layout: &Layout) -> impl Iterator<Item = (u32, &[Incidence])> {
    let of_point = |s: &[Slot]| &layout.incidences[s[0].first_incidence as usize..s[1].first_incidence as usize];
    layout.slots.windows(2).map(of_point).flat_map(|met| met.iter().enumerate().map(move |(i, a)| (a.block, &met[i..])))
}
