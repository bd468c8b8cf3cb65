//! Nearest of many triangles or points.

use super::tree::Tree;
use super::triangle::Triangle;
use crate::hilbert;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Consecutive points of the Hilbert curve that one task takes; within it each search starts from what was found last.
const CHUNK: usize = 4096;

/// Something that has a distance.
pub(crate) trait Primitive: Copy + Send + Sync {
    /// Smallest and largest coordinates.
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>);
    /// Squared distance of `p`.
    fn squared(&self, p: &Vector3<f64>) -> f64;
}

impl Primitive for Triangle {
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        Triangle::bounds(self)
    }

    #[inline]
    fn squared(&self, p: &Vector3<f64>) -> f64 {
        self.nearest(p).0.norm_squared()
    }
}

impl Primitive for Vector3<f64> {
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        (*self, *self)
    }

    #[inline]
    fn squared(&self, p: &Vector3<f64>) -> f64 {
        (p - self).norm_squared()
    }
}

/// Where a primitive was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Its place in the index: what the next search may start from.
    pub slot: u32,
    /// Its squared distance.
    pub squared: f64,
}

/// Primitives in a tree of boxes.
///
/// What is found is the smallest of all squared distances as f64 computes them, and of equal ones the primitive that came
/// first: it depends neither on the order of the questions nor on where a search starts.
pub(crate) struct Index<P> {
    /// What coordinates are relative to.
    pub origin: Point3<f64>,
    primitives: Vec<P>,
    ids: Vec<u32>,
    tree: Tree,
}

impl<P: Primitive> Index<P> {
    /// An index over one primitive or more, given relative to `origin`.
    pub fn new(origin: Point3<f64>, primitives: Vec<P>) -> Self {
        let centre = |p: &P| {
            let (low, high) = p.bounds();
            Point3::from((low + high) / 2.0)
        };
        let ids = hilbert::order(&primitives.par_iter().map(centre).collect::<Vec<_>>());
        let primitives: Vec<P> = ids.par_iter().map(|&i| primitives[i as usize]).collect();
        let tree = Tree::new(&primitives.par_iter().map(P::bounds).collect::<Vec<_>>());
        Self { origin, primitives, ids, tree }
    }

    /// Number of primitives.
    pub fn len(&self) -> usize {
        self.primitives.len()
    }

    /// The primitive in a slot and its index in the list that the index was made of.
    pub fn primitive(&self, slot: u32) -> (&P, usize) {
        (&self.primitives[slot as usize], self.ids[slot as usize] as usize)
    }

    /// The nearest primitive to `p`, which is relative to the origin, given any of them to start from.
    #[inline]
    pub fn nearest(&self, p: &Vector3<f64>, start: u32) -> Found {
        let first = Found { slot: start, squared: self.primitives[start as usize].squared(p) };
        self.search(p, first)
    }

    /// The nearest primitive whose squared distance is below `limit`.
    pub fn nearest_below(&self, p: &Vector3<f64>, limit: f64) -> Option<Found> {
        let found = self.search(p, Found { slot: u32::MAX, squared: limit });
        (found.slot != u32::MAX).then_some(found)
    }

    #[inline]
    fn search(&self, p: &Vector3<f64>, first: Found) -> Found {
        let mut best = first;
        self.tree.visit(p, best.squared, |slot| {
            let squared = self.primitives[slot as usize].squared(p);
            let id = |slot: u32| self.ids.get(slot as usize);
            if squared < best.squared || (squared == best.squared && id(slot) < id(best.slot)) {
                best = Found { slot, squared };
            }
            best.squared
        });
        best
    }

    /// Calls `each` with slot and squared distance of every primitive within `radius` of `p`, in a fixed order.
    pub fn within(&self, p: &Vector3<f64>, radius: f64, mut each: impl FnMut(u32, f64)) {
        let limit = radius * radius;
        self.tree.visit(p, limit, |slot| {
            let squared = self.primitives[slot as usize].squared(p);
            if squared <= limit {
                each(slot, squared);
            }
            limit
        });
    }

    /// For each point what `measure` makes of the slot of its nearest primitive and of the point relative to the origin.
    pub fn map_nearest<T: Copy + Default + Send>(
        &self,
        points: &[Point3<f64>],
        measure: impl Fn(Found, &Vector3<f64>) -> T + Sync,
    ) -> Vec<T> {
        let order = hilbert::order(points);
        let found: Vec<Vec<T>> = order
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut slot = 0;
                let mut one = |&i: &u32| {
                    let p = points[i as usize] - self.origin;
                    let found = self.nearest(&p, slot);
                    slot = found.slot;
                    measure(found, &p)
                };
                chunk.iter().map(&mut one).collect()
            })
            .collect();
        let mut values = vec![T::default(); points.len()];
        for (&i, value) in order.iter().zip(found.into_iter().flatten()) {
            values[i as usize] = value;
        }
        values
    }
}
