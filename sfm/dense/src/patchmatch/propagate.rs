//! One update of one colour: better planes from the neighbours, then random changes of shrinking size.

use super::grid::{Cell, Grid};
use super::level::Level;
use super::patch::Patch;
use super::plane::Plane;
use super::random::Draw;
use super::score::{Kernel, NO_MATCH, Question, Scratch};
use rayon::prelude::*;

/// What a search needs beside the images.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchOptions {
    pub kernel: Kernel,
    pub seed: u64,
    /// Smallest and largest inverse depth.
    pub inverse_range: [f32; 2],
    /// Mean over this many best neighbours.
    pub best: usize,
    /// Square of the smallest cosine between a normal and its ray.
    pub min_squared_cosine: f32,
}

/// One pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pass {
    /// Number for the random stream, unique in the whole search.
    pub number: u32,
    /// Largest random change of the projection in the most sensitive neighbour, pixels.
    pub change_px: f32,
    /// Random planes of the whole range for pixels whose cost is above this.
    pub restart_above: f32,
    /// Whether planes are also taken from far away, which pays only until the first ones have spread.
    pub far: bool,
}

/// Planes closer than this in the most sensitive neighbour are one, pixels at the window's rim.
const SAME_PX: f32 = 0.1;

/// Positions of the other colour whose best plane is tried, for the direction "up"; the others are rotations.
const NEAR: [(i32, i32); 4] = [(0, -1), (0, -3), (-1, -2), (1, -2)];
const FAR: [(i32, i32); 5] = [(0, -5), (0, -7), (0, -9), (0, -13), (0, -19)];

/// Updates the pixels of one colour from those of the other.
pub(crate) fn update(grid: &mut Grid, colour: usize, level: &Level, options: &SearchOptions, pass: &Pass) {
    let (width, height, half) = (grid.width, grid.height, grid.half);
    let [first, second] = &mut grid.colours;
    let (mine, other) = if colour == 0 { (first, &*second) } else { (second, &*first) };
    mine.par_chunks_mut(half).enumerate().for_each(|(y, row)| {
        let mut scratch = Scratch::new();
        for (i, cell) in row.iter_mut().enumerate() {
            let x = 2 * i + ((y & 1) ^ colour);
            if x >= width {
                continue;
            }
            let Some(patch) = Patch::new(&level.grey, &level.valid, x, y, level.weights) else { continue };
            let neighbour = |dx: i32, dy: i32| {
                let (nx, ny) = (x as i32 + dx, y as i32 + dy);
                (nx >= 0 && ny >= 0 && nx < width as i32 && ny < height as i32).then(|| other[ny as usize * half + nx as usize / 2])
            };
            let mut pixel = Pixel::new(level, options, &patch, [x as f32, y as f32], *cell, &mut scratch);
            pixel.take_from_neighbours(pass.far, neighbour);
            pixel.change(&mut Draw::new(options.seed, pass.number, x, y), pass);
            *cell = pixel.cell;
        }
    });
}

/// Scores the planes that the grid starts with.
pub(crate) fn score_all(grid: &mut Grid, level: &Level, options: &SearchOptions) {
    let (width, half) = (grid.width, grid.half);
    for (colour, cells) in grid.colours.iter_mut().enumerate() {
        cells.par_chunks_mut(half).enumerate().for_each(|(y, row)| {
            let mut scratch = Scratch::new();
            for (i, cell) in row.iter_mut().enumerate() {
                let x = 2 * i + ((y & 1) ^ colour);
                cell.cost = NO_MATCH;
                if x < width
                    && let Some(patch) = Patch::new(&level.grey, &level.valid, x, y, level.weights)
                {
                    let mut pixel = Pixel::new(level, options, &patch, [x as f32, y as f32], *cell, &mut scratch);
                    cell.cost = pixel.score(cell.plane);
                }
            }
        });
    }
}

struct Pixel<'a> {
    level: &'a Level<'a>,
    options: &'a SearchOptions,
    question: Question<'a>,
    scratch: &'a mut Scratch,
    cell: Cell,
    /// Change of inverse depth that moves the projection by a pixel in the most sensitive neighbour.
    inverse_per_px: f32,
}

impl<'a> Pixel<'a> {
    fn new(level: &'a Level, options: &'a SearchOptions, patch: &'a Patch, at: [f32; 2], cell: Cell, scratch: &'a mut Scratch) -> Self {
        let offset = level.offsets.as_ref().map_or([0.0; 2], |o| o.at(at[0], at[1]));
        let most = level.sources.iter().map(|s| s.sensitivity(at[0], at[1], cell.plane.w, &offset)).fold(0.0, f32::max);
        let question = Question { sources: &level.sources, patch, at, offset, noise: level.weights.noise_variance, best: options.best };
        Self { level, options, question, scratch, cell, inverse_per_px: 1.0 / most.max(1e-20) }
    }

    fn score(&mut self, plane: Plane) -> f32 {
        let [low, high] = self.options.inverse_range;
        let [x, y] = self.question.at;
        if !(plane.w >= low && plane.w <= high) || plane.squared_cosine(&self.level.pinhole, x, y) < self.options.min_squared_cosine {
            return NO_MATCH;
        }
        self.options.kernel.score(&self.question, plane, self.scratch)
    }

    fn consider(&mut self, plane: Plane) {
        let cost = self.score(plane);
        if cost < self.cell.cost {
            self.cell = Cell { plane, cost };
        }
    }

    /// The best plane of each of four near regions, and of four far ones.
    fn take_from_neighbours(&mut self, far: bool, neighbour: impl Fn(i32, i32) -> Option<Cell>) {
        let regions: &[&[(i32, i32)]] = if far { &[&NEAR, &FAR] } else { &[&NEAR] };
        for offsets in regions {
            for turn in 0..4 {
                let mut found: Option<(Cell, i32, i32)> = None;
                for &(dx, dy) in *offsets {
                    let (dx, dy) = [(dx, dy), (dy, dx), (dx, -dy), (-dy, dx)][turn];
                    if let Some(cell) = neighbour(dx, dy)
                        && found.is_none_or(|(best, ..)| cell.cost < best.cost)
                    {
                        found = Some((cell, dx, dy));
                    }
                }
                let Some((cell, dx, dy)) = found.filter(|(c, ..)| c.cost < NO_MATCH) else { continue };
                let plane = cell.plane.moved(-dx as f32, -dy as f32);
                if !self.is_same(plane) {
                    self.consider(plane);
                }
            }
        }
    }

    fn is_same(&self, plane: Plane) -> bool {
        let own = self.cell.plane;
        let rim = super::patch::RADIUS as f32;
        let change = (plane.w - own.w).abs() + rim * ((plane.gx - own.gx).abs() + (plane.gy - own.gy).abs());
        change < SAME_PX * self.inverse_per_px
    }

    fn change(&mut self, draw: &mut Draw, pass: &Pass) {
        if self.cell.cost > pass.restart_above {
            let [low, high] = self.options.inverse_range;
            let w = low + draw.unit() * (high - low);
            // Up to about 45 degrees along each axis.
            let k = &self.level.pinhole;
            let (gx, gy) = (w / k.fx * draw.signed(), w / k.fy * draw.signed());
            self.consider(Plane { w, gx, gy });
        }
        let step = pass.change_px * self.inverse_per_px;
        // The same change at the window's rim.
        let tilt = step / super::patch::RADIUS as f32;
        let own = self.cell.plane;
        self.consider(Plane { w: own.w + step * draw.signed(), ..own });
        let own = self.cell.plane;
        self.consider(Plane { gx: own.gx + tilt * draw.signed(), gy: own.gy + tilt * draw.signed(), ..own });
        let own = self.cell.plane;
        let (dw, dx, dy) = (0.5 * step * draw.signed(), 0.5 * tilt * draw.signed(), 0.5 * tilt * draw.signed());
        self.consider(Plane { w: own.w + dw, gx: own.gx + dx, gy: own.gy + dy });
    }
}
