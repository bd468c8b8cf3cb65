//! The two interleaved pixel sets of a chequerboard, each contiguous: one is updated while the other is only read.

use super::plane::Plane;
use super::score::NO_MATCH;

/// What is known at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub plane: Plane,
    pub cost: f32,
}

/// Pixels of both colours; the colour of (x, y) is the parity of x + y.
pub(crate) struct Grid {
    pub width: usize,
    pub height: usize,
    /// Cells of a row and colour (one may be unused at an odd width).
    pub half: usize,
    pub colours: [Vec<Cell>; 2],
}

impl Grid {
    pub fn new(width: usize, height: usize) -> Self {
        let half = width.div_ceil(2);
        let empty = Cell { plane: Plane::default(), cost: NO_MATCH };
        Self { width, height, half, colours: [vec![empty; half * height], vec![empty; half * height]] }
    }

    pub fn get(&self, x: usize, y: usize) -> Cell {
        self.colours[(x + y) & 1][y * self.half + x / 2]
    }

    pub fn set(&mut self, x: usize, y: usize, cell: Cell) {
        self.colours[(x + y) & 1][y * self.half + x / 2] = cell;
    }
}
