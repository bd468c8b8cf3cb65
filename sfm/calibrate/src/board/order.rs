//! Which corner is the first.

use super::grid::Grid;
use nalgebra::Vector2;

/// The corners row by row, `columns` a row, where the grid has that size in one of its directions.
///
/// Rows grow clockwise from columns on the screen, as on the board seen from its front. Of the turns that are left, the one is taken in
/// which the square beyond the first corner is dark; where columns + rows is even that is all of them or none, and the one whose rows run
/// most to the right is taken.
pub(super) fn ordered(grid: &Grid, columns: usize, rows: usize) -> Option<Vec<Vector2<f64>>> {
    let (w, h) = (columns as i32, rows as i32);
    // Quarter turns: place on the board to place in the grid.
    let turned = |turn: i32, i: i32, j: i32| match turn {
        0 => (i, j),
        1 => (grid.columns - 1 - j, i),
        2 => (grid.columns - 1 - i, grid.rows - 1 - j),
        _ => (j, grid.rows - 1 - i),
    };
    let fits = |turn: &i32| if turn % 2 == 0 { (grid.columns, grid.rows) == (w, h) } else { (grid.rows, grid.columns) == (w, h) };
    let corners = |turn: i32| -> Option<Vec<Vector2<f64>>> {
        (0..h).flat_map(|j| (0..w).map(move |i| (i, j))).map(|(i, j)| grid.corners.get(&turned(turn, i, j)).copied()).collect()
    };
    let score = |turn: i32| -> Option<(bool, f64, Vec<Vector2<f64>>)> {
        let corners = corners(turn)?;
        let along = corners[columns - 1] - corners[0];
        // The square beyond the first corner is opposite to that within, and has its colour; a quarter turn swaps colours.
        let dark = grid.is_bright(turned(turn, 0, 0)) == (turn % 2 == 1);
        Some((dark, along.x / along.norm(), corners))
    };
    let turns = (0..4).filter(fits).filter_map(score);
    turns.max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(_, _, corners)| corners)
}
