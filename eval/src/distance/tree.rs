//! Boxes in boxes: eight to a node, tested together.

use nalgebra::Vector3;
use rayon::prelude::*;
use wide::f32x8;

/// Children of a node.
const WIDTH: usize = 8;
/// Share by which a limit is raised before squared distances to boxes, computed in f32, are compared with it: more than
/// their rounding.
const LIMIT_MARGIN: f32 = 1.0 + 8e-6;
/// Deepest tree: 8^11 is more than an index of 32 bits can name.
const MAX_LEVELS: usize = 11;

/// The boxes of eight children, coordinate by coordinate; a missing child has a box at infinity.
#[derive(Clone, Copy)]
struct Node {
    low: [f32x8; 3],
    high: [f32x8; 3],
}

const EMPTY: Node = Node { low: [f32x8::new([f32::INFINITY; WIDTH]); 3], high: [f32x8::new([f32::NEG_INFINITY; WIDTH]); 3] };

impl Node {
    /// Squared distances of a point to the boxes. Never NaN: a box at infinity is infinitely far on every axis.
    #[inline(always)]
    fn squared(&self, at: &[f32x8; 3]) -> f32x8 {
        let outside = |axis: usize| (self.low[axis] - at[axis]).fast_max(at[axis] - self.high[axis]).fast_max(f32x8::ZERO);
        let [x, y, z] = [outside(0), outside(1), outside(2)];
        x * x + y * y + z * z
    }

    fn set(&mut self, lane: usize, low: [f32; 3], high: [f32; 3]) {
        for axis in 0..3 {
            self.low[axis].as_mut_array()[lane] = low[axis];
            self.high[axis].as_mut_array()[lane] = high[axis];
        }
    }

    /// The box around all children.
    fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        let low = self.low.map(|v| v.to_array().into_iter().fold(f32::INFINITY, f32::min));
        (low, self.high.map(|v| v.to_array().into_iter().fold(f32::NEG_INFINITY, f32::max)))
    }
}

/// A packed tree over primitives whose order is that of a space-filling curve: node j of a level holds the children 8j to
/// 8j + 7 of the level below, so that no pointer is stored (Kamel & Faloutsos, *On packing R-trees*, CIKM 1993).
pub(super) struct Tree {
    /// From the level above the primitives to the root.
    levels: Vec<Vec<Node>>,
}

impl Tree {
    /// A tree over boxes, of which there is one at least, in the order of a curve.
    pub fn new(boxes: &[(Vector3<f64>, Vector3<f64>)]) -> Self {
        let largest = boxes.iter().map(|(low, high)| low.amax().max(high.amax())).fold(0.0, f64::max);
        // A coordinate of a box and one of a point within twice the extent move when they are rounded to f32, by half a
        // unit in the last place each; points further out are covered by the relative margin.
        let slack = 2.0 * largest * f64::from(f32::EPSILON);
        let mut levels: Vec<Vec<Node>> = vec![
            boxes
                .par_chunks(WIDTH)
                .map(|group| {
                    let mut node = EMPTY;
                    for (k, (low, high)) in group.iter().enumerate() {
                        let single = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
                        node.set(k, single(low.add_scalar(-slack)), single(high.add_scalar(slack)));
                    }
                    node
                })
                .collect(),
        ];
        while levels[levels.len() - 1].len() > 1 {
            let below = &levels[levels.len() - 1];
            let level = below
                .par_chunks(WIDTH)
                .map(|group| {
                    let mut node = EMPTY;
                    for (k, child) in group.iter().enumerate() {
                        let (low, high) = child.bounds();
                        node.set(k, low, high);
                    }
                    node
                })
                .collect();
            levels.push(level);
        }
        Self { levels }
    }

    /// Calls `test` with primitives whose boxes come within the square root of `limit` of `p`. `test` returns the limit
    /// for what follows. Children are not sorted: with a good limit to begin with, sorting costs more than it saves.
    #[inline(always)]
    pub fn visit(&self, p: &Vector3<f64>, limit: f64, mut test: impl FnMut(u32) -> f64) {
        let at = [p.x, p.y, p.z].map(|c| f32x8::splat(c as f32));
        // The rounding of the limit is within the margin.
        let raised = |limit: f64| limit as f32 * LIMIT_MARGIN;
        let mut limit = raised(limit);
        // (squared distance, level, node); a node takes one entry and leaves eight.
        let mut stack = [(0.0f32, 0u32, 0u32); (WIDTH - 1) * MAX_LEVELS + 1];
        let mut height = 1;
        stack[0] = (0.0, self.levels.len() as u32 - 1, 0);
        while height > 0 {
            height -= 1;
            let (squared, level, index) = stack[height];
            if squared > limit {
                continue;
            }
            let squared = self.levels[level as usize][index as usize].squared(&at);
            let mut near = squared.simd_le(f32x8::splat(limit)).to_bitmask();
            let squared = squared.to_array();
            while near != 0 {
                let lane = near.trailing_zeros();
                near &= near - 1;
                let child = index * WIDTH as u32 + lane;
                let squared = squared[lane as usize & (WIDTH - 1)];
                if level > 0 {
                    stack[height] = (squared, level - 1, child);
                    height += 1;
                } else if squared <= limit {
                    limit = raised(test(child));
                }
            }
        }
    }
}
