//! The search on one level of the pyramid.

use super::grid::{Cell, Grid};
use super::offsets::LevelOffsets;
use super::patch::PatchWeights;
use super::plane::{Pinhole, Plane};
use super::propagate::{Pass, SearchOptions, score_all, update};
use super::random::Draw;
use super::score::{NO_MATCH, SourceView};
use scene::Raster;

/// Reference and neighbours at one resolution.
pub(crate) struct Level<'a> {
    pub grey: Raster<u16>,
    pub valid: Raster<u8>,
    pub pinhole: Pinhole,
    /// Behind a port, where the rays of the reference pass.
    pub offsets: Option<LevelOffsets>,
    pub sources: Vec<SourceView>,
    pub weights: &'a PatchWeights,
}

/// Where the search starts.
pub(crate) enum Start<'a> {
    /// Inverse depths of the nearest seeds, 0 where there are none: random.
    Seeds(&'a Raster<f32>),
    /// What was found at half the resolution.
    Coarser(&'a Raster<Cell>),
}

/// Largest random change in the first pass, pixels; halves with each pass.
const FIRST_CHANGE_PX: f32 = 4.0;
/// The same where the search continues from a coarser level, whose error is a fraction of a pixel.
const NEXT_CHANGE_PX: f32 = 0.8;
/// The first search tries random planes wherever the fit is not almost perfect.
const FIRST_RESTART_ABOVE: f32 = 0.05;
/// Continued searches try them only where nothing fits.
const RESTART_ABOVE: f32 = 0.6;

/// Runs `passes` updates of both colours; `first_pass` numbers the random streams.
pub(crate) fn search(level: &Level, start: &Start, options: &SearchOptions, passes: u32, first_pass: u32) -> Raster<Cell> {
    let (w, h) = (level.grey.width(), level.grey.height());
    let mut grid = Grid::new(w, h);
    for y in 0..h {
        for x in 0..w {
            let plane = match start {
                Start::Seeds(seeds) => from_seed(seeds[(x, y)], level, options, first_pass, x, y),
                Start::Coarser(cells) => from_coarser(cells, x, y),
            };
            grid.set(x, y, Cell { plane, cost: NO_MATCH });
        }
    }
    score_all(&mut grid, level, options);
    let (mut change_px, restart_above, far) = match start {
        Start::Seeds(_) => (FIRST_CHANGE_PX, FIRST_RESTART_ABOVE, true),
        Start::Coarser(_) => (NEXT_CHANGE_PX, RESTART_ABOVE, false),
    };
    for pass in 0..passes {
        let pass = Pass { number: first_pass + 1 + pass, change_px, restart_above, far };
        update(&mut grid, 0, level, options, &pass);
        update(&mut grid, 1, level, options, &pass);
        change_px *= 0.5;
    }
    let cells = (0..w * h).map(|i| grid.get(i % w, i / w)).collect();
    Raster::from_vec(w, h, cells).expect("one cell a pixel")
}

fn from_seed(seed: f32, level: &Level, options: &SearchOptions, pass: u32, x: usize, y: usize) -> Plane {
    if seed > 0.0 {
        return Plane { w: seed, gx: 0.0, gy: 0.0 };
    }
    let mut draw = Draw::new(options.seed, pass, x, y);
    let [low, high] = options.inverse_range;
    let w = low + draw.unit() * (high - low);
    let k = &level.pinhole;
    Plane { w, gx: w / k.fx * draw.signed(), gy: w / k.fy * draw.signed() }
}

/// The plane of the pixel that covers (x, y) at half the resolution.
fn from_coarser(cells: &Raster<Cell>, x: usize, y: usize) -> Plane {
    let (cx, cy) = ((x / 2).min(cells.width() - 1), (y / 2).min(cells.height() - 1));
    let coarse = cells[(cx, cy)].plane;
    let plane = Plane { w: coarse.w, gx: coarse.gx / 2.0, gy: coarse.gy / 2.0 };
    // The centre of a coarse pixel lies between its four fine ones.
    plane.moved(x as f32 - 2.0 * cx as f32 - 0.5, y as f32 - 2.0 * cy as f32 - 0.5)
}
