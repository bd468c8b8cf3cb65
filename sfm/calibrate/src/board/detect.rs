//! The search for a chequerboard.

use super::candidates::candidates;
use super::graph::patches;
use super::grid::Grid;
use super::order::ordered;
use crate::levels::{Level, levels};
use crate::saddle;
use nalgebra::Vector2;
use scene::Raster;

/// Long sides of the finest level that is searched, pixels.
const MAX_SIDE: usize = 1600;
/// Standard deviations of the smoothing, pixels: the second is for noise and marine snow.
const SMOOTHING_PX: [f32; 2] = [1.4, 2.4];
/// The least, and the mean, correlation of the corners of a board with the pattern.
const MIN_CORRELATION: f64 = 0.4;
const MIN_MEAN_CORRELATION: f64 = 0.65;
/// Half the window of the last refinement, as a share of the shortest edge, and its limits in pixels.
const WINDOW_SHARE: f64 = 0.4;
const WINDOW_PX: [f64; 2] = [2.0, 12.0];
/// Fewer corners than this are no part of a board but chance.
const MIN_PART: usize = 9;

/// A chequerboard in a photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// Inner corners in pixels, row by row from the first one: `columns` a row, rows clockwise from columns on the screen, and the square
    /// beyond the first corner is dark. Where columns + rows is even, the board looks the same upside down, and rows run to the right.
    pub corners: Vec<Vector2<f64>>,
}

/// What the search for a chequerboard gave.
#[derive(Clone, Debug, PartialEq)]
pub enum BoardFinding {
    /// The whole board.
    Found(Board),
    /// A whole board of another size.
    OtherSize {
        /// Its inner corners along the longer way.
        columns: usize,
        /// And along the other.
        rows: usize,
    },
    /// A part of a board: it is not used, as nothing tells which part.
    Part {
        /// Number of corners.
        corners: usize,
    },
    /// No board.
    Nothing,
}

/// Finds a chequerboard of `columns` x `rows` inner corners (2 or more each) in a grey image, to a few hundredths of a pixel.
///
/// Grey values are brought to a local mean of 0 and deviation of 1 on several reductions of the image. Saddles of the grey values whose
/// surrounding ring has four sectors are corners; corners that an edge of the right polarity joins are neighbours; the largest patch of
/// neighbours is freed of stray lines, its gaps are filled and it is extended to the size of the board. No line is assumed to be straight: the
/// distortion may be as strong as it likes. In the end each corner is refined in the image itself (see [`Board::corners`] for their order).
/// A board that is partly hidden or outside of the image is not found.
#[must_use]
pub fn detect_board(image: &Raster<f32>, columns: usize, rows: usize) -> BoardFinding {
    let mut other = BoardFinding::Nothing;
    if columns < 2 || rows < 2 {
        return other;
    }
    for sigma in SMOOTHING_PX {
        for level in levels(image, MAX_SIDE, sigma) {
            match on_level(image, &level, columns, rows) {
                found @ BoardFinding::Found(_) => return found,
                BoardFinding::Nothing => {}
                seen => {
                    if corner_count(&seen) > corner_count(&other) {
                        other = seen;
                    }
                }
            }
        }
    }
    other
}

fn corner_count(finding: &BoardFinding) -> usize {
    match finding {
        BoardFinding::Found(board) => board.corners.len(),
        BoardFinding::OtherSize { columns, rows } => columns * rows,
        BoardFinding::Part { corners } => *corners,
        BoardFinding::Nothing => 0,
    }
}

fn on_level(image: &Raster<f32>, level: &Level, columns: usize, rows: usize) -> BoardFinding {
    let all = candidates(&level.image, 6 * columns * rows + 400);
    let mut best = BoardFinding::Nothing;
    for patch in patches(&level.image, &all).iter().take(3).filter(|p| p.len() >= MIN_PART.min(columns * rows)) {
        let Some(mut grid) = Grid::new(patch, &all, &level.image) else { continue };
        grid.fill(&level.image);
        let Some(mut grid) = grid.shrunk(&level.image, columns as i32, rows as i32) else { continue };
        extend(&mut grid, &level.image, columns as i32, rows as i32);
        grid.fill(&level.image);
        let (least, mean) = grid.quality(&level.image);
        if mean < MIN_MEAN_CORRELATION || grid.corners.len() < MIN_PART.min(columns * rows) {
            continue;
        }
        if grid.is_full() && least > MIN_CORRELATION {
            if let Some(board) = ordered(&grid, columns, rows).and_then(|corners| refined(image, level, &corners, columns)) {
                return BoardFinding::Found(board);
            }
            let (long, short) = (grid.columns.max(grid.rows) as usize, grid.columns.min(grid.rows) as usize);
            // A board that is larger has been described wrongly; what is smaller may be hidden.
            if long > columns.max(rows) || short > columns.min(rows) {
                return BoardFinding::OtherSize { columns: long, rows: short };
            }
        }
        let seen = BoardFinding::Part { corners: grid.corners.len() };
        if corner_count(&seen) > corner_count(&best) {
            best = seen;
        }
    }
    best
}

/// Extends towards the size of the board, in the direction that needs fewer lines.
fn extend(grid: &mut Grid, image: &Raster<f32>, columns: i32, rows: i32) {
    let lacks = |grid: &Grid, w: i32, h: i32| (grid.columns <= w && grid.rows <= h).then(|| w - grid.columns + h - grid.rows);
    let ways = [(columns, rows), (rows, columns)];
    let Some((_, (w, h))) = ways.iter().filter_map(|&(w, h)| Some((lacks(grid, w, h)?, (w, h)))).min() else { return };
    while grid.columns < w && grid.extend(image, true) {}
    while grid.rows < h && grid.extend(image, false) {}
}

/// The corners in the image itself; `None` where one of them moves away.
fn refined(image: &Raster<f32>, level: &Level, corners: &[Vector2<f64>], columns: usize) -> Option<Board> {
    let [sx, sy] = level.scale;
    let at: Vec<Vector2<f64>> = corners.iter().map(|p| Vector2::new(p.x * sx, p.y * sy)).collect();
    let rows = at.len() / columns;
    let mut found = Vec::with_capacity(at.len());
    for (k, p) in at.iter().enumerate() {
        let (i, j) = (k % columns, k / columns);
        let neighbours =
            [(i > 0, k.wrapping_sub(1)), (i + 1 < columns, k + 1), (j > 0, k.wrapping_sub(columns)), (j + 1 < rows, k + columns)];
        let shortest = neighbours.iter().filter(|(is, _)| *is).map(|(_, q)| (at[*q] - p).norm()).fold(f64::INFINITY, f64::min);
        // Near the border of the image, as large a window as there is room for.
        let room = p.x.min(p.y).min(image.width() as f64 - p.x).min(image.height() as f64 - p.y) - 4.0;
        let half = (WINDOW_SHARE * shortest).clamp(WINDOW_PX[0], WINDOW_PX[1]).min(room.max(WINDOW_PX[0]));
        let first = saddle::refine(image, p, half.max(1.5 * sx).min(room.max(WINDOW_PX[0])))?;
        found.push(saddle::refine(image, &first, half)?);
    }
    Some(Board { corners: found })
}
