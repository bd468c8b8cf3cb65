//! Which blocks of the reduced system are stored, and where.

use super::clusters::Clusters;
use super::layout::{Layout, Owner};
use super::lengths::KeptNormal;
use super::meetings::{Fill, Meetings, products};
use crate::numeric::packed_inverse;

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
/// Unknowns of a group of columns of a packed matrix: products of blocks of this size run at full speed, and there are enough of them for
/// all threads.
pub(super) const PACKED_UNKNOWNS: usize = 384;
/// A sparse factorisation and its solutions take so many times longer an operation than products of large blocks: they wait for memory.
const SPARSE_SLOWNESS: f64 = 3.0;

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
    /// Each panel has all rows of the matrix from the first unknown of its group on. One group holds the whole matrix.
    Dense(Groups),
    /// The blocks that meet.
    Sparse(SparsePattern),
    /// What conjugate gradients keep.
    Clusters(Clusters),
}

/// Groups of consecutive blocks.
#[derive(Debug)]
pub(super) struct Groups {
    /// First unknown of each group, and the end.
    pub starts: Vec<usize>,
    /// First unknown of the group of each block.
    first: Vec<usize>,
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
        let operations = if is_sparse { met.fill(layout, &order).operations } else { (n as f64).powi(3) / 3.0 };
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
        let (mut panel_start, mut strides) = (vec![0], Vec::new());
        for a in 0..layout.block_count() {
            let shared = offsets[layout.block_count()] - offsets[a.max(clusters.shared())];
            let rows = clusters.own_rows(a, offsets) + shared;
            strides.push(rows);
            panel_start.push(panel_start[a] + rows * layout.dim(a));
        }
        Self { panel_start, stride: strides, kind: Kind::Clusters(clusters), offsets: offsets.clone() }
    }

    /// A pattern whose inverse can be had: never that of conjugate gradients. `Err` with the number of values where that takes more than
    /// `most_values`.
    pub fn invertible(layout: &Layout, kept: &KeptNormal, most_values: f64) -> Result<Self, f64> {
        let n = layout.unknowns();
        let packed = Self::packed(layout, PACKED_UNKNOWNS);
        let mut least = packed.len() as f64;
        if n > DENSE_UNKNOWNS {
            let met = Meetings::new(layout, kept);
            let order = met.order();
            let Fill { operations, values } = met.fill(layout, &order);
            // The system, its factor, and the inverse where the system is.
            let total = values + 2.0 * met.values(layout) as f64;
            // All columns are solved for, against n^3 operations of a packed inverse.
            let is_quick = SPARSE_SLOWNESS * (operations + 4.0 * n as f64 * values) < (n as f64).powi(3);
            if total <= most_values && (is_quick || least > most_values) {
                return Ok(Self::from_meetings(layout, &met, order));
            }
            least = least.min(total);
        }
        if packed.len() as f64 <= most_values { Ok(packed) } else { Err(least) }
    }

    /// The whole matrix.
    pub fn dense(layout: &Layout) -> Self {
        Self::packed(layout, usize::MAX)
    }

    /// The lower half of the matrix, in groups of at most that many unknowns, or of one block: see [`packed_inverse`].
    pub fn packed(layout: &Layout, group_unknowns: usize) -> Self {
        let offsets = &layout.offsets;
        let mut groups = Groups { starts: vec![0], first: Vec::with_capacity(layout.block_count()) };
        let mut first = 0;
        for a in 0..layout.block_count() {
            if offsets[a] > first && offsets[a + 1] - first > group_unknowns {
                first = offsets[a];
                groups.starts.push(first);
            }
            groups.first.push(first);
        }
        let n = layout.unknowns();
        groups.starts.push(n);
        let stride: Vec<usize> = groups.first.iter().map(|first| n - first).collect();
        let mut panel_start = vec![0];
        for (a, stride) in stride.iter().enumerate() {
            panel_start.push(panel_start[a] + stride * layout.dim(a));
        }
        debug_assert_eq!(panel_start.last().copied(), Some(packed_inverse::stored(&groups.starts)));
        Self { panel_start, stride, kind: Kind::Dense(groups), offsets: offsets.clone() }
    }

    #[cfg(test)]
    pub fn sparse(layout: &Layout, kept: &KeptNormal) -> Self {
        let met = Meetings::new(layout, kept);
        let order = met.order();
        Self::from_meetings(layout, &met, order)
    }

    fn from_meetings(layout: &Layout, met: &Meetings, order: Vec<usize>) -> Self {
        let (mut panel_start, mut stride) = (vec![0], Vec::new());
        let mut sparse = SparsePattern { rows: Vec::new(), rows_start: vec![0], product_rows: Vec::new(), order };
        for a in 0..layout.block_count() {
            let mut row = 0;
            for b in met.of(a) {
                sparse.rows.push((b as u32, row));
                row += layout.dim(b) as u32;
            }
            sparse.rows_start.push(sparse.rows.len());
            stride.push(row as usize);
            panel_start.push(panel_start[a] + row as usize * layout.dim(a));
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
        Self { panel_start, stride, kind: Kind::Sparse(sparse), offsets: layout.offsets.clone() }
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

    /// First row of block `b`, which is not before `a`, in the panel of block `a`, which meets it; `None` where it is not stored.
    pub fn row(&self, a: usize, b: u32) -> Option<usize> {
        match &self.kind {
            Kind::Dense(groups) => Some(self.offsets[b as usize] - groups.first[a]),
            Kind::Sparse(sparse) => {
                let rows = &sparse.rows[sparse.rows_start[a]..sparse.rows_start[a + 1]];
                Some(rows[rows.partition_point(|r| r.0 < b)].1 as usize)
            }
            Kind::Clusters(clusters) => clusters.row(a, b, &self.offsets),
        }
    }

    /// First row of the diagonal block in the panel of block `a`.
    pub fn diagonal_row(&self, a: usize) -> usize {
        if let Kind::Dense(groups) = &self.kind { self.offsets[a] - groups.first[a] } else { 0 }
    }

    /// First row of a product of the elimination, which is of blocks `a` and `b`.
    #[inline(always)]
    pub fn product_row(&self, product: usize, a: usize, b: u32) -> Option<usize> {
        match &self.kind {
            Kind::Dense(groups) => Some(self.offsets[b as usize] - groups.first[a]),
            Kind::Sparse(sparse) => Some(sparse.product_rows[product] as usize),
            Kind::Clusters(clusters) => clusters.row(a, b, &self.offsets),
        }
    }
}
