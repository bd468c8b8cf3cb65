//! Which blocks of the reduced system are stored, and where.

use super::layout::{Layout, NONE};
use super::lengths::KeptNormal;

/// Reduced systems up to this size are dense whatever their pattern.
const DENSE_UNKNOWNS: usize = 300;
/// Larger ones are dense when at least this share of their lower triangle is.
const DENSE_SHARE: f64 = 0.35;

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
    /// First row of each product of the elimination, in the order in which they are made.
    pair_rows: Vec<u32>,
    pair_start: Vec<usize>,
}

impl Pattern {
    pub fn new(layout: &Layout, kept: &KeptNormal) -> Self {
        let n = layout.unknowns();
        if n > DENSE_UNKNOWNS {
            let sparse = Self::sparse(layout, kept);
            if (sparse.len() as f64) < DENSE_SHARE * (n * n) as f64 / 2.0 {
                return sparse;
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

    pub fn sparse(layout: &Layout, kept: &KeptNormal) -> Self {
        let blocks = layout.block_count();
        let mut pattern = Self { panel_start: vec![0], stride: Vec::new(), sparse: None, offsets: layout.offsets.clone() };
        let mut sparse = SparsePattern { rows: Vec::new(), rows_start: vec![0], pair_rows: Vec::new(), pair_start: vec![0] };
        // First row in the panel of the blocks met so far; NONE for the others.
        let mut row_of = vec![NONE; blocks];
        let mut met: Vec<u32> = Vec::new();
        for a in 0..blocks {
            met.clear();
            let mut meet = |b: u32| {
                if row_of[b as usize] == NONE {
                    row_of[b as usize] = 0;
                    met.push(b);
                }
            };
            meet(a as u32);
            let points = &layout.block_points[layout.block_points_start[a]..layout.block_points_start[a + 1]];
            let from = |&(slot, incidence): &(u32, u32)| {
                &layout.incidences[incidence as usize..layout.slots[slot as usize + 1].first_incidence as usize]
            };
            points.iter().flat_map(from).for_each(|i| meet(i.block));
            for &(v, segment) in &layout.block_views[layout.block_views_start[a]..layout.block_views_start[a + 1]] {
                layout.views[v as usize].block[segment as usize..].iter().filter(|&&b| b != NONE).for_each(|&b| meet(b));
            }
            let first_pair = kept.pairs.partition_point(|&(c, _, _)| (c as usize) < a);
            kept.pairs[first_pair..].iter().take_while(|&&(c, _, _)| c as usize == a).for_each(|&(_, b, _)| meet(b));
            met.sort_unstable();
            let mut row = 0;
            for &b in &met {
                row_of[b as usize] = row;
                sparse.rows.push((b, row));
                row += layout.dim(b as usize) as u32;
            }
            sparse.pair_rows.extend(points.iter().flat_map(from).map(|i| row_of[i.block as usize]));
            sparse.rows_start.push(sparse.rows.len());
            sparse.pair_start.push(sparse.pair_rows.len());
            pattern.stride.push(row as usize);
            pattern.panel_start.push(pattern.panel_start[a] + row as usize * layout.dim(a));
            for &b in &met {
                row_of[b as usize] = NONE;
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

    /// First rows of the products of panel `a`, in order.
    pub fn pair_rows(&self, a: usize) -> PairRows<'_> {
        PairRows(self.sparse.as_ref().map(|s| s.pair_rows[s.pair_start[a]..s.pair_start[a + 1]].iter()))
    }
}

/// See [`Pattern::pair_rows`].
pub(super) struct PairRows<'a>(Option<std::slice::Iter<'a, u32>>);

impl PairRows<'_> {
    /// The row of the next product, which is with `block`.
    #[inline]
    pub fn next(&mut self, offsets: &[usize], block: u32) -> usize {
        match &mut self.0 {
            None => offsets[block as usize],
            Some(rows) => rows.next().map_or(0, |&r| r as usize),
        }
    }
}
