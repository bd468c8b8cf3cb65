//! The nodes of a brick with one more on every side.

use super::{EDGE, NODES, NONE};

/// Nodes along the edge of a brick with its halo.
pub(crate) const HALO: usize = EDGE + 2;

/// Place in a halo buffer of a node whose coordinates count from the brick's first node, -1 to 8.
#[inline]
pub(crate) fn halo_index(x: isize, y: isize, z: isize) -> usize {
    ((x + 1) + (y + 1) * HALO as isize + (z + 1) * (HALO * HALO) as isize) as usize
}

/// Copies a brick and the nodes beside it; nodes of absent bricks become `missing`.
pub(crate) fn load_halo(field: &[f32], near: &[u32; 27], missing: f32, out: &mut [f32; HALO * HALO * HALO]) {
    // For -1..=8: which of the three bricks, which node of it.
    let split = |i: usize| match i {
        0 => (0, EDGE - 1),
        9 => (2, 0),
        _ => (1, i - 1),
    };
    for k in 0..HALO {
        let (bz, z) = split(k);
        for j in 0..HALO {
            let (by, y) = split(j);
            let row = &mut out[(k * HALO + j) * HALO..][..HALO];
            let bricks = &near[bz * 9 + by * 3..][..3];
            let at = |brick: u32, x: usize| brick as usize * NODES + (z * EDGE + y) * EDGE + x;
            row[0] = if bricks[0] == NONE { missing } else { field[at(bricks[0], EDGE - 1)] };
            if bricks[1] == NONE {
                row[1..=EDGE].fill(missing);
            } else {
                row[1..=EDGE].copy_from_slice(&field[at(bricks[1], 0)..][..EDGE]);
            }
            row[EDGE + 1] = if bricks[2] == NONE { missing } else { field[at(bricks[2], 0)] };
        }
    }
}
