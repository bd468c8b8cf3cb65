//! Which bricks there are, and which lie beside each other.

use super::morton::{Coordinates, decode, encode};
use rayon::prelude::*;

/// No brick.
pub(crate) const NONE: u32 = u32::MAX;

/// Bricks of one level in the order of their Morton codes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bricks {
    /// Code of each brick, ascending.
    pub(crate) codes: Vec<u64>,
    /// The 27 bricks around each, itself in the middle, x fastest; [`NONE`] where there is none.
    pub(crate) near: Vec<[u32; 27]>,
}

impl Bricks {
    /// From codes in any order, with repetitions.
    pub(crate) fn new(mut codes: Vec<u64>) -> Self {
        codes.par_sort_unstable();
        codes.dedup();
        let near = codes.par_iter().map(|&code| neighbours(&codes, decode(code))).collect();
        Self { codes, near }
    }

    pub(crate) fn len(&self) -> usize {
        self.codes.len()
    }

    /// Coordinates of a brick, in bricks.
    pub(crate) fn at(&self, brick: usize) -> Coordinates {
        decode(self.codes[brick])
    }

    /// The brick with these coordinates.
    pub(crate) fn find(&self, c: Coordinates) -> Option<usize> {
        self.codes.binary_search(&encode(c)).ok()
    }
}

fn neighbours(codes: &[u64], centre: Coordinates) -> [u32; 27] {
    std::array::from_fn(|k| {
        let step = [k % 3, k / 3 % 3, k / 9];
        let mut c = [0; 3];
        for axis in 0..3 {
            match (centre[axis] + step[axis] as u32).checked_sub(1) {
                Some(v) => c[axis] = v,
                None => return NONE,
            }
        }
        codes.binary_search(&encode(c)).map_or(NONE, |i| i as u32)
    })
}
