//! Which kept blocks meet, in which order to eliminate them, and what that costs.

use super::layout::{Incidence, Layout, NONE, Slot};
use super::lengths::KeptNormal;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// What a sparse factorisation takes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    pub operations: f64,
    /// Of the factor.
    pub values: f64,
}

/// For each block, the blocks from it on that some residual or point couples with it: a bit for each.
pub(super) struct Meetings {
    words: usize,
    bits: Vec<u64>,
}

impl Meetings {
    pub fn new(layout: &Layout, kept: &KeptNormal) -> Self {
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
    pub fn of(&self, a: usize) -> impl Iterator<Item = usize> + '_ {
        self.bits[a * self.words..(a + 1) * self.words].iter().enumerate().flat_map(|(word, &bits)| {
            let next = |bits: &u64| Some(bits & (bits - 1)).filter(|&rest| rest != 0);
            let sets = std::iter::successors(Some(bits).filter(|&b| b != 0), next);
            sets.map(move |bits| 64 * word + bits.trailing_zeros() as usize)
        })
    }

    /// An order of elimination with little fill: approximate minimum degree (Amestoy, Davis & Duff, 1996) of the blocks, which takes a
    /// small part of the time that it takes of the unknowns.
    pub fn order(&self) -> Vec<usize> {
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

    /// What a Cholesky factorisation in the given order takes, about.
    pub fn fill(&self, layout: &Layout, order: &[usize]) -> Fill {
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
        let mut fill = Fill { operations: 0.0, values: 0.0 };
        for k in 0..blocks {
            let mut rows = std::mem::take(&mut below[k]);
            rows.sort_unstable();
            rows.dedup();
            let dim = layout.dim(order[k]) as f64;
            let length = rows.iter().map(|&r| layout.dim(order[r])).sum::<usize>() as f64 + dim;
            fill.operations += dim * length.powi(2);
            fill.values += dim * length;
            if let Some((&parent, rest)) = rows.split_first() {
                below[parent].extend_from_slice(rest);
            }
        }
        fill
    }

    /// Number of values of all panels.
    pub fn values(&self, layout: &Layout) -> usize {
        (0..layout.block_count()).map(|a| layout.dim(a) * self.of(a).map(|b| layout.dim(b)).sum::<usize>()).sum()
    }
}

/// Each block that a point meets, with it and those after it, point by point: the products of the elimination.
pub(super) fn products(layout: &Layout) -> impl Iterator<Item = (u32, &[Incidence])> {
    let of_point = |s: &[Slot]| &layout.incidences[s[0].first_incidence as usize..s[1].first_incidence as usize];
    layout.slots.windows(2).map(of_point).flat_map(|met| met.iter().enumerate().map(move |(i, a)| (a.block, &met[i..])))
}
