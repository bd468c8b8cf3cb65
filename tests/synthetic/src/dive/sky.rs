//! How much of the light from above reaches a place: what lies under slabs is darker.

use crate::trace::{HitPacket, RayPacket, Tracer};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Spacing of the places, metres.
const CELL_M: f64 = 0.2;
/// No more places than this along a side: larger scenes get larger cells.
const MOST: usize = 72;
/// Directions of a packet.
const DIRECTIONS: usize = 64;

/// Open shares of the upper half space on a grid, trilinear in between; 1 outside it.
#[derive(Clone, Debug)]
pub(super) struct Sky {
    low: Vector3<f64>,
    cell_m: f64,
    size: [usize; 3],
    open: Vec<f32>,
}

impl Sky {
    /// For the box between two corners.
    pub fn new(tracer: &Tracer, low: Vector3<f64>, high: Vector3<f64>) -> Self {
        let extent = high - low;
        let cell_m = extent.iter().fold(CELL_M, |cell, side| cell.max(side / (MOST - 1) as f64));
        let size: [usize; 3] = std::array::from_fn(|k| (extent[k].max(0.0) / cell_m).ceil() as usize + 1);
        let mut open = vec![1.0; size.iter().product()];
        open.par_chunks_mut(size[0]).enumerate().for_each(|(line, row)| {
            let (y, z) = (line % size[1], line / size[1]);
            for (x, open) in row.iter_mut().enumerate() {
                let place = low + Vector3::new(x as f64, y as f64, z as f64) * cell_m;
                *open = share(tracer, &place);
            }
        });
        Self { low, cell_m, size, open }
    }

    /// The open share at a surface: looked up a little above it.
    pub fn at(&self, point: &Vector3<f32>, normal: &Vector3<f32>) -> f32 {
        let place = (point.cast::<f64>() + normal.cast::<f64>() * (0.7 * self.cell_m) - self.low) / self.cell_m;
        let inside = (0..3).all(|k| place[k] >= 0.0 && place[k] < (self.size[k] - 1) as f64);
        if !inside {
            return 1.0;
        }
        let cell = place.map(|v| v as usize);
        let f = (place - cell.cast::<f64>()).cast::<f32>();
        let value = |i: usize, j: usize, k: usize| self.open[((cell.z + k) * self.size[1] + cell.y + j) * self.size[0] + cell.x + i];
        let along_x = |j, k| value(0, j, k) * (1.0 - f.x) + value(1, j, k) * f.x;
        let along_y = |k| along_x(0, k) * (1.0 - f.y) + along_x(1, k) * f.y;
        along_y(0) * (1.0 - f.z) + along_y(1) * f.z
    }
}

/// The share of 64 directions, spread evenly over the upper half space weighted by the cosine, in which nothing is met.
fn share(tracer: &Tracer, place: &Vector3<f64>) -> f32 {
    let mut rays = RayPacket { origin: [[0.0; DIRECTIONS]; 3], direction: [[0.0; DIRECTIONS]; 3] };
    for i in 0..DIRECTIONS {
        // A spiral of equal areas on the disc below, with the golden angle.
        let radius = ((i as f64 + 0.5) / DIRECTIONS as f64).sqrt();
        let angle = 2.399_963_229_728_653 * i as f64;
        let direction = [radius * angle.cos(), radius * angle.sin(), (1.0 - radius * radius).sqrt()];
        for k in 0..3 {
            rays.origin[k][i] = place[k] as f32;
            rays.direction[k][i] = direction[k] as f32;
        }
    }
    let mut hits = HitPacket::default();
    tracer.packet(&rays, &mut hits);
    hits.distance.iter().filter(|d| d.is_infinite()).count() as f32 / DIRECTIONS as f32
}
