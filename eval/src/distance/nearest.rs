//! Nearest of many triangles or points.

use super::triangle::Triangle;
use crate::morton;
use nalgebra::{Point3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use rayon::prelude::*;

/// Consecutive points of the Morton curve that one task takes. Within it each search starts from what was found last, so
/// the size is part of the result in the case of ties and must not depend on the threads.
const CHUNK: usize = 4096;
/// Share by which the squared distance to a box is lowered: more than the rounding of its f32 arithmetic.
const BOX_MARGIN: f32 = 1.0 - 4e-6;

/// Something that has a distance.
pub(super) trait Primitive: Copy + Sync {
    /// Smallest and largest coordinates.
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>);
    /// Vector from its point nearest to `p`, to `p`.
    fn to_point(&self, p: &Vector3<f64>) -> Vector3<f64>;
}

impl Primitive for Triangle {
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        Triangle::bounds(self)
    }

    #[inline]
    fn to_point(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.nearest(p).0
    }
}

impl Primitive for Vector3<f64> {
    fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        (*self, *self)
    }

    #[inline]
    fn to_point(&self, p: &Vector3<f64>) -> Vector3<f64> {
        p - self
    }
}

/// Primitives in a bounding volume hierarchy.
pub(super) struct Index<P> {
    pub origin: Point3<f64>,
    pub primitives: Vec<P>,
    bvh: Bvh,
}

impl<P: Primitive> Index<P> {
    /// An index over one primitive or more, given relative to `origin`, from which none is further away than `extent` in any
    /// coordinate.
    pub fn new(origin: Point3<f64>, extent: f64, primitives: Vec<P>) -> Self {
        // Rounding a coordinate of a primitive, or of a point near one, to f32 moves it by half a unit in the last place.
        let slack = extent * f64::from(f32::EPSILON);
        let boxes: Vec<Aabb> = primitives
            .par_iter()
            .map(|p| {
                let (low, high) = p.bounds();
                Aabb::new(single(&low.add_scalar(-slack)), single(&high.add_scalar(slack)))
            })
            .collect();
        Self { origin, primitives, bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes) }
    }

    /// The nearest primitive; `guess` bounds the search.
    fn nearest(&self, p: &Vector3<f64>, guess: u32) -> u32 {
        let squared = |i: u32| self.primitives[i as usize].to_point(p).norm_squared() as f32;
        let at = single(p);
        let to_box = |node: &BvhNode, _: f32| {
            let outside = (node.mins() - at).max(at - node.maxs()).max(Vector::ZERO);
            outside.length_squared() * BOX_MARGIN
        };
        self.bvh.find_best(squared(guess), to_box, |i, _| Some(squared(i))).map_or(guess, |(i, _)| i)
    }

    /// For each point what `measure` makes of its nearest primitive (its index, the point relative to the origin).
    pub fn map_nearest(&self, points: &[Point3<f64>], measure: impl Fn(usize, &Vector3<f64>) -> f64 + Sync) -> Vec<f64> {
        let order = morton::order(points);
        let found: Vec<Vec<f64>> = order
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut nearest = 0;
                let mut one = |&i: &u32| {
                    let p = points[i as usize] - self.origin;
                    nearest = self.nearest(&p, nearest);
                    measure(nearest as usize, &p)
                };
                chunk.iter().map(&mut one).collect()
            })
            .collect();
        let mut values = vec![0.0; points.len()];
        for (&i, value) in order.iter().zip(found.into_iter().flatten()) {
            values[i as usize] = value;
        }
        values
    }
}

fn single(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x as f32, v.y as f32, v.z as f32)
}
