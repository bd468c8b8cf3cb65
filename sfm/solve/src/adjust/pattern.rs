//! Which blocks of the reduced system are stored, and where.

use super::layout::{Incidence, Layout, NONE, Owner, Slot};
use super::lengths::KeptNormal;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// Reduced systems up to this size are dense whatever their pattern.
const DENSE_UNKNOWNS: usize = 300;
/// Larger ones are dense when at least this share of their lower triangle is. Measured on chains of frames: with 100 frames
/// the solutions take the same time at a share of 0.4, with 200 frames the sparse one takes half the time at 0.5.
const DENSE_SHARE: f64 = 0.5;
/// A factorisation of more operations than this is compared with conjugate gradients; below, it takes about a second.
const DIRECT_OPERATIONS: f64 = 2e10;
/// What a step by conjugate gradients costs, in operations of a factorisation a value of W: some 30 products with it, which wait for
/// memory.
const ITERATIVE_OPERATIONS: f64 = 600.0;
/// Conjugate gradients keep the blocks of sensors, cameras and kept points with all others: they must be few.
const MAX_SHARED_UNKNOWNS: usize = 1000;
/// Unknowns of a cluster of frames, of which the preconditioner keeps all blocks.
const CLUSTER_UNKNOWNS: usize = 600;

/// Layout of the panels of [`super::schur`].
#[derive(Debug)]
pub(super) struct Pattern {
    /// Where the panel of each block begins; one more entry, the length.
    pub panel_start: Vec<usize>,
    /// Rows of each panel.
    pub stride: Vec<usize>,
    pub kind: Kind,
    offsets: Vec<usize>,
}

/// How much of the matrix is stored.
#[derive(Debug)]
pub(super) enum Kind {
    /// Each panel has all rows of the matrix.
    Dense,
    /// The blocks that meet.
    Sparse(SparsePattern),
    /// What conjugate gradients keep.
    Clusters(Clusters),
}

/// Blocks of frames in clusters of consecutive ones, and of what frames share with each other: sensors, cameras, kept points. Stored are
/// the blocks inside a cluster and all blocks with something shared.
#[derive(Debug)]
pub(super) struct Clusters {
    /// First block of each cluster, and the end of the last, which is where the shared blocks begin.
    pub start: Vec<usize>,
    /// The end of the cluster of each block of a frame.
    end_of: Vec<u32>,
}

impl Clusters {
    fn new(layout: &Layout, cluster_unknowns: usize) -> Self {
        let frames = layout.owners.iter().take_while(|o| matches!(o, Owner::Frame(_))).count();
        let count = layout.offsets[frames].div_ceil(cluster_unknowns).max(1);
        let start: Vec<usize> = (0..=count).map(|i| i * frames / count).collect();
        let end_of = start.windows(2).flat_map(|w| std::iter::repeat_n(w[1] as u32, w[1] - w[0])).collect();
        Self { start, end_of }
    }

    /// The first shared block.
    pub fn shared(&self) -> usize {
        self.start[self.start.len() - 1]
    }

    /// Rows of the panel of block `a` before the shared ones.
    pub fn own_rows(&self, a: usize, offsets: &[usize]) -> usize {
        self.end_of.get(a).map_or(0, |&end| offsets[end as usize] - offsets[a])
    }

    fn row(&self, a: usize, b: u32, offsets: &[usize]) -> Option<usize> {
        let b = b as usize;
        let shared = self.shared();
        if a >= shared || self.end_of[a] as usize > b {
            return Some(offsets[b] - offsets[a]);
        }
        (b >= shared).then(|| self.own_rows(a, offsets) + offsets[b] - offsets[shared])
    }
}

/// Rows of the panels of a sparse system.
#[derive(Debug)]
pub(super) struct SparsePattern {
    /// (block, first row) of each panel, ascending.
    pub rows: Vec<(u32, u32)>,
    pub rows_start: Vec<usize>,
    /// First row of each product of the elimination, by point: see [`super::layout::Slot::first_product`].
    product_rows: Vec<u32>,
    /// Order of elimination with little fill, by block.
    order: Vec<usize>,
}

impl SparsePattern {
    /// The order of elimination by unknown.
    pub fn unknown_order(&self, layout: &Layout) -> Vec<usize> {
        self.order.iter().flat_map(|&b| layout.offsets[b]..layout.offsets[b + 1]).collect()
    }
}

impl Pattern {
    pub fn new(layout: &Layout, kept: &KeptNormal) -> Self {
        let n = layout.unknowns();
        if n <= DENSE_UNKNOWNS {
            return Self::dense(layout);
        }
        let met = Meetings::new(layout, kept);
        let is_sparse = (met.values(layout) as f64) < DENSE_SHARE * (n * n) as f64 / 2.0;
        let order = if is_sparse { met.order() } else { Vec::new() };
        let operations = if is_sparse { met.operations(layout, &order) } else { (n as f64).powi(3) / 3.0 };
        let frames = layout.owners.iter().take_while(|o| matches!(o, Owner::Frame(_))).count();
        let shared = n - layout.offsets[frames];
        let is_hard = operations > DIRECT_OPERATIONS.max(ITERATIVE_OPERATIONS * layout.w_len() as f64);
        if is_hard && shared <= MAX_SHARED_UNKNOWNS && frames > 0 {
            Self::clustered(layout, CLUSTER_UNKNOWNS)
        } else if is_sparse {
            Self::from_meetings(layout, &met, order)
        } else {
            Self::dense(layout)
        }
    }

    pub fn clustered(layout: &Layout, cluster_unknowns: usize) -> Self {
        let clusters = Clusters::new(layout, cluster_unknowns);
        let offsets = &layout.offsets;
        let mut pattern = Self { panel_start: vec![0], stride: Vec::new(), kind: Kind::Dense, offsets: offsets.clone() };
        for a in 0..layout.block_count() {
            let shared = offsets[layout.block_count()] - offsets[a.max(clusters.shared())];
            let rows = clusters.own_rows(a, offsets) + shared;
            pattern.stride.push(rows);
            pattern.panel_start.push(pattern.panel_start[a] + rows * layout.dim(a));
        }
        pattern.kind = Kind::Clusters(clusters);
        pattern
    }

    pub fn dense(layout: &Layout) -> Self {
        let n = layout.unknowns();
        Self {
            panel_start: layout.offsets.iter().map(|o| o * n).collect(),
            stride: vec![n; layout.block_count()],
            kind: Kind::Dense,
            offsets: layout.offsets.clone(),
        }
    }

    #[cfg(test)]
    pub fn sparse(layout: &Layout, kept: &KeptNormal) -> Self {
        let met = Meetings::new(layout, kept);
        let order = met.order();
        Self::from_meetings(layout, &met, order)
    }

    fn from_meetings(layout: &Layout, met: &Meetings, order: Vec<usize>) -> Self {
        let mut pattern = Self { panel_start: vec![0], stride: Vec::new(), kind: Kind::Dense, offsets: layout.offsets.clone() };
        let mut sparse = SparsePattern { rows: Vec::new(), rows_start: vec![0], product_rows: Vec::new(), order };
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
        pattern.kind = Kind::Sparse(sparse);
        pattern
    }

    /// The clusters, where only they are stored.
    pub fn clusters(&self) -> Option<&Clusters> {
        match &self.kind {
            Kind::Clusters(clusters) => Some(clusters),
            _ => None,
        }
    }

    /// Number of stored values.
    pub fn len(&self) -> usize {
        self.panel_start[self.panel_start.len() - 1]
    }

    /// First row of block `b` in the panel of block `a`, which meets it; `None` where it is not stored.
    pub fn row(&self, a: usize, b: u32) -> Option<usize> {
        match &self.kind {
            Kind::Dense => Some(self.offsets[b as usize]),
            Kind::Sparse(sparse) => {
                let rows = &sparse.rows[sparse.rows_start[a]..sparse.rows_start[a + 1]];
                Some(rows[rows.partition_point(|r| r.0 < b)].1 as usize)
            }
            Kind::Clusters(clusters) => clusters.row(a, b, &self.offsets),
        }
    }

    /// Calls `row` with each block of which the panel of block `a` has rows, in order.
    pub fn for_rows(&self, a: usize, mut row: impl FnMut(usize)) {
        let blocks = self.offsets.len() - 1;
        match &self.kind {
            Kind::Dense => (0..blocks).for_each(row),
            Kind::Sparse(sparse) => {
                sparse.rows[sparse.rows_start[a]..sparse.rows_start[a + 1]].iter().for_each(|&(b, _)| row(b as usize));
            }
            Kind::Clusters(clusters) => (a..blocks).filter(|&b| clusters.row(a, b as u32, &self.offsets).is_some()).for_each(row),
        }
    }

    /// First row of the diagonal block in the panel of block `a`.
    pub fn diagonal_row(&self, a: usize) -> usize {
        if matches!(self.kind, Kind::Dense) { self.offsets[a] } else { 0 }
    }

    /// First row of a product of the elimination, which is of blocks `a` and `b`.
    #[inline(always)]
    pub fn product_row(&self, product: usize, a: usize, b: u32) -> Option<usize> {
        match &self.kind {
            Kind::Dense => Some(self.offsets[b as usize]),
            Kind::Sparse(sparse) => Some(sparse.product_rows[product] as usize),
            Kind::Clusters(clusters) => clusters.row(a, b, &self.offsets),
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

    /// An order of elimination with little fill: approximate minimum degree (Amestoy, Davis & Duff, 1996) of the blocks, which takes a
    /// small part of the time that it takes of the unknowns.
    fn order(&self) -> Vec<usize> {
        let blocks = self.bits.len() / self.words;
        // Both triangles, by columns.
        let mut columns = vec![Vec::new(); blocks];
        for a in 0..blocks {
            for b in self.of(a).filter(|&b| b != a) {
                columns[a].push(b);
                columns[b].push(a);
            }
        }
        let mut start = vec![0];
        let mut rows = Vec::new();
        for column in &mut columns {
            column.sort_unstable();
            rows.extend_from_slice(column);
            start.push(rows.len());
        }
        let structure = SymbolicSparseColMatRef::new_checked(blocks, blocks, &start, None, &rows);
        let (mut order, mut inverse) = (vec![0; blocks], vec![0; blocks]);
        let mut memory = faer::dyn_stack::MemBuffer::new(amd::order_scratch::<usize>(blocks, rows.len()));
        let stack = faer::dyn_stack::MemStack::new(&mut memory);
        match amd::order(&mut order, &mut inverse, structure, amd::Control::default(), stack) {
            Ok(_) => order,
            Err(_) => (0..blocks).collect(),
        }
    }

    /// Operations of a Cholesky factorisation in the given order, about.
    fn operations(&self, layout: &Layout, order: &[usize]) -> f64 {
        let blocks = order.len();
        let mut place = vec![0; blocks];
        order.iter().enumerate().for_each(|(i, &b)| place[b] = i);
        let mut below = vec![Vec::new(); blocks];
        for a in 0..blocks {
            for b in self.of(a).filter(|&b| b != a) {
                below[place[a].min(place[b])].push(place[a].max(place[b]));
            }
        }
        // The rows of a column join those of its parent, the first of them (Liu 1990).
        let mut operations = 0.0;
        for k in 0..blocks {
            let mut rows = std::mem::take(&mut below[k]);
            rows.sort_unstable();
            rows.dedup();
            let dim = layout.dim(order[k]) as f64;
            let length: usize = rows.iter().map(|&r| layout.dim(order[r])).sum();
            operations += dim * (length as f64 + dim).powi(2);
            if let Some((&parent, rest)) = rows.split_first() {
                below[parent].extend_from_slice(rest);
            }
        }
        operations
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
