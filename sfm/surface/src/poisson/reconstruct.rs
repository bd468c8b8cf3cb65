//! From points to a mesh.

use super::attributes::colours;
use super::base;
use super::density::Density;
use super::divergence::{ByDepth, of_base, of_level};
use super::extract::{Solved, Surface, finest, march};
use super::level::Level;
use super::options::PoissonOptions;
use super::samples::{Samples, cell_of};
use super::screen::Pulls;
use super::solve::{Matrix, Steps};
use super::transfer::{prolong, restrict, restrict_to_dense};
use crate::SurfaceError;
use crate::clean::drop_unused;
use crate::lattice::{Bricks, NODES};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use scene::{Cloud, Mesh};
use serde::Serialize;

/// What one level of the octree took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelSummary {
    /// The level: 2^depth cells along the edge of the cube.
    pub depth: u32,
    /// Unknowns.
    pub unknowns: usize,
    /// Steps of the conjugate gradients.
    pub iterations: u32,
    /// Norm of the residual at the end as a share of that at the start.
    pub residual: f64,
}

/// What went in, what was solved, what came out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoissonSummary {
    /// Points that were used.
    pub points: usize,
    /// Points without a finite position or a normal.
    pub dropped: usize,
    /// Finest level.
    pub depth: u32,
    /// Edge of the finest cells, in the unit of the cloud.
    pub cell: f64,
    /// Points that are too sparse for the finest level.
    pub coarser: usize,
    /// The indicator at the surface: its mean over the points. The jump from inside to outside is 1.
    pub iso: f64,
    /// The levels, coarsest first.
    pub levels: Vec<LevelSummary>,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Faces of the mesh.
    pub faces: usize,
}

/// A surface with what is known of its support.
#[derive(Clone, Debug)]
pub struct PoissonSurface {
    /// The mesh, coloured where the cloud is.
    pub mesh: Mesh,
    /// Points a unit of area around each vertex; 0 where there are none.
    pub density: Vec<f32>,
    /// Median of the same at the points.
    pub median_density: f64,
    /// What was done.
    pub summary: PoissonSummary,
}

/// The surface through oriented points, by screened Poisson reconstruction.
///
/// Sought is the function chi that is small inside and large outside and minimises
///
/// ```text
/// E(chi) = integral |V - grad chi|^2 + alpha 2^d sum_s a_s chi(s)^2
/// ```
///
/// with V the normals spread by a box three cells wide, each weighing by the area a_s that its point stands for (edge of the cube 1, d the level;
/// Kazhdan, Bolitho & Hoppe, *Poisson surface reconstruction*, SGP 2006; Kazhdan & Hoppe, *Screened Poisson surface reconstruction*, ACM TOG
/// 32(3), 2013). chi is a sum of trilinear tents on the nodes of an octree that is fine where the points are dense; levels are solved from the
/// coarsest, each for what the coarser ones leave. The cube is free at its faces, so that an open surface may leave it, unless the points are said to be of a closed body. The surface is where
/// chi has its mean over the points; away from the cube's faces it is closed, every edge has two triangles. Outside is where the normals
/// point.
///
/// Normals must point to one side consistently. Where there are no points the surface is made up: look at `density` and cut with
/// [`crate::trim`].
///
/// # Errors
/// [`SurfaceError`] where normals are missing, fewer than 10 points can be used, they lie in one place, or an option is out of range.
pub fn reconstruct(cloud: &Cloud, options: &PoissonOptions) -> Result<PoissonSurface, SurfaceError> {
    let mut samples = Samples::new(cloud, options)?;
    let density = Density::new(&mut samples, options.samples_per_cell);
    let solution = solve(&samples, options);
    let (bricks, values) = finest(solution.base, &solution.levels, solution.iso as f32);
    drop(solution.levels);
    let mut surface = march(&bricks, &values, solution.iso as f32, samples.depth);
    drop((bricks, values));
    drop_unused(&mut surface.vertices, &mut surface.faces);
    Ok(finish(cloud, &samples, &density, surface, solution.iso, solution.summaries))
}

/// The indicator, level by level.
struct Solution {
    base: (Bricks, Vec<f32>),
    levels: Vec<Solved>,
    iso: f64,
    summaries: Vec<LevelSummary>,
}

fn solve(samples: &Samples, options: &PoissonOptions) -> Solution {
    let base_depth = base::DEPTH.min(samples.depth);
    let by_depth = ByDepth::new(samples);
    let levels: Vec<Level> = (base_depth + 1..=samples.depth).map(|depth| Level::new(samples, depth)).collect();
    // Right sides, finest first: what a level's samples give reaches all coarser ones.
    let (mut rights, mut carried) = (Vec::new(), None::<Vec<f32>>);
    for (i, level) in levels.iter().enumerate().rev() {
        let (mut own, coarser) = of_level(samples, &by_depth, level, base_depth);
        if let Some(finer) = &carried {
            restrict(&levels[i + 1], finer, &level.bricks, &mut own);
        }
        let cells = (1u64 << level.depth) as f32;
        rights.push(own.par_iter().zip(&coarser).map(|(a, b)| (a + b) * cells).collect::<Vec<f32>>());
        carried = Some(own);
    }
    let mut right = of_base(samples, &by_depth, base_depth);
    if let (Some(finer), Some(level)) = (&carried, levels.first()) {
        restrict_to_dense(level, finer, (1 << base_depth) + 1, &mut right);
    }
    drop(carried);
    right.iter_mut().for_each(|b| *b *= (1u64 << base_depth) as f32);
    // alpha 2^d a unit of area of the cube, over the cell's edge that the stiffness is scaled by.
    let screening = |depth: u32| options.screening * 4f64.powi(depth as i32);
    let (values, steps) = base::solve(samples, base_depth, screening(base_depth), &right, options.closed);
    let mut summaries = vec![summary(base_depth, values.len(), steps)];
    let base = base::in_bricks(base_depth, &values);
    let mut mean = Mean::default();
    mean.add(samples, base_depth, &base.0, &base.1);
    let mut solved: Vec<Solved> = Vec::new();
    let mut values = base.1.clone();
    for (level, right) in levels.into_iter().zip(rights.into_iter().rev()) {
        let coarser = solved.last().map_or(&base.0, |s| &s.level.bricks);
        let mut start = prolong(coarser, &values, &level.bricks);
        let pulls = Pulls::new(samples, &level, screening(level.depth));
        let matrix = Matrix { level: &level, pulls: &pulls };
        let (correction, steps) = matrix.solve(&start, &right, options.max_iterations, options.tolerance);
        start.par_iter_mut().zip(&correction).for_each(|(v, c)| *v += c);
        summaries.push(summary(level.depth, level.count(), steps));
        mean.add(samples, level.depth, &level.bricks, &start);
        solved.push(Solved { level, correction });
        values = start;
    }
    Solution { base, levels: solved, iso: mean.value(), summaries }
}

fn summary(depth: u32, unknowns: usize, steps: Steps) -> LevelSummary {
    LevelSummary { depth, unknowns, iterations: steps.iterations, residual: steps.residual }
}

/// Mean of the indicator over the samples by their area.
#[derive(Default)]
struct Mean {
    sum: f64,
    area: f64,
}

impl Mean {
    /// Adds the samples that are taken to a level.
    fn add(&mut self, samples: &Samples, depth: u32, bricks: &Bricks, values: &[f32]) {
        let cells = f64::from(1u32 << depth);
        let sums: Vec<(f64, f64)> = samples
            .all
            .par_chunks(4096)
            .map(|piece| {
                let (mut sum, mut area, mut last) = (0.0, 0.0, (u64::MAX, 0));
                for sample in piece.iter().filter(|s| u32::from(s.depth) == depth) {
                    let cell = cell_of(&sample.position, depth);
                    let mut value = 0.0;
                    for k in 0..8u32 {
                        let step = [k & 1, k >> 1 & 1, k >> 2];
                        let node: [u32; 3] = std::array::from_fn(|a| cell[a] + step[a]);
                        let code = crate::lattice::encode(node.map(|v| v >> 3));
                        if code != last.0 {
                            last = (code, bricks.codes.binary_search(&code).unwrap_or_default());
                        }
                        let at = ((node[2] & 7) * 8 + (node[1] & 7)) * 8 + (node[0] & 7);
                        let weight = |a: usize| {
                            let t = sample.position[a] * cells - f64::from(cell[a]);
                            if step[a] == 1 { t } else { 1.0 - t }
                        };
                        value += weight(0) * weight(1) * weight(2) * f64::from(values[last.1 * NODES + at as usize]);
                    }
                    sum += f64::from(sample.area) * value;
                    area += f64::from(sample.area);
                }
                (sum, area)
            })
            .collect();
        for (sum, area) in sums {
            self.sum += sum;
            self.area += area;
        }
    }

    fn value(&self) -> f64 {
        self.sum / self.area
    }
}

/// Brings the surface to the world, with density and colours.
fn finish(cloud: &Cloud, samples: &Samples, density: &Density, surface: Surface, iso: f64, levels: Vec<LevelSummary>) -> PoissonSurface {
    let unit = 1.0 / (samples.edge * samples.edge);
    let densities = |positions: &[[f64; 3]]| -> Vec<f32> {
        positions
            .par_chunks(4096)
            .flat_map_iter(|piece| {
                let mut last = None;
                piece.iter().map(|p| (density.at(p, &mut last) * unit) as f32).collect::<Vec<_>>()
            })
            .collect()
    };
    let at_vertices = densities(&surface.vertices);
    let positions: Vec<[f64; 3]> = samples.all.iter().map(|s| s.position).collect();
    let mut at_points = densities(&positions);
    let middle = at_points.len() / 2;
    let median_density = f64::from(*at_points.select_nth_unstable_by(middle, f32::total_cmp).1);
    let colours = colours(cloud, samples, &surface.vertices);
    let to_world = |p: &[f64; 3]| Point3::from(samples.corner.coords + Vector3::from(*p) * samples.edge);
    let mesh = Mesh { vertices: surface.vertices.par_iter().map(to_world).collect(), faces: surface.faces, colours };
    let summary = PoissonSummary {
        points: samples.all.len(),
        dropped: cloud.len() - samples.all.len(),
        depth: samples.depth,
        cell: samples.edge / f64::from(1u32 << samples.depth),
        coarser: samples.all.iter().filter(|s| u32::from(s.depth) < samples.depth).count(),
        iso,
        levels,
        vertices: mesh.vertices.len(),
        faces: mesh.faces.len(),
    };
    PoissonSurface { mesh, density: at_vertices, median_density, summary }
}
