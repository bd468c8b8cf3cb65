//! The points in the unit cube, sorted along a space-filling curve.

use super::options::{MAX_DEPTH, PoissonOptions, Resolution};
use crate::SurfaceError;
use crate::lattice::{Coordinates, encode};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use scene::Cloud;
use std::ops::Range;

/// Fewest points that make a surface.
const MIN_POINTS: usize = 10;
/// Space around the points, as a factor on their extent.
const MARGIN: f64 = 1.12;
/// A variance counts within this factor of the median, so that no point rules and none is lost.
const MAX_CONFIDENCE: f32 = 16.0;

/// A point with its normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Position in the unit cube.
    pub(super) position: [f64; 3],
    /// Unit normal.
    pub(super) normal: [f32; 3],
    /// Which point of the cloud.
    pub(super) index: u32,
    /// Relative weight among its neighbours.
    pub(super) confidence: f32,
    /// The area that it stands for, edge of the cube 1.
    pub(super) area: f32,
    /// Finest level that it is taken to.
    pub(super) depth: u8,
}

/// All points, sorted by the Morton code of their finest cell.
pub(super) struct Samples {
    pub(super) all: Vec<Sample>,
    /// Code of the finest cell of each.
    codes: Vec<u64>,
    /// Finest level.
    pub(super) depth: u32,
    /// First corner of the cube in the world.
    pub(super) corner: Point3<f64>,
    /// Edge of the cube in the world.
    pub(super) edge: f64,
}

impl Samples {
    pub(super) fn new(cloud: &Cloud, options: &PoissonOptions) -> Result<Self, SurfaceError> {
        options.check()?;
        if cloud.normals.len() != cloud.len() {
            return Err(SurfaceError::NoNormals { points: cloud.len(), normals: cloud.normals.len() });
        }
        let usable = |i: &usize| {
            let n = cloud.normals[*i].norm();
            n.is_finite() && n > 1e-6 && cloud.positions[*i].iter().all(|v| v.is_finite())
        };
        let kept: Vec<usize> = (0..cloud.len()).filter(usable).collect();
        if kept.len() < MIN_POINTS || kept.len() >= u32::MAX as usize {
            return Err(SurfaceError::TooFewPoints { usable: kept.len(), points: cloud.len(), needed: MIN_POINTS });
        }
        let (depth, corner, edge) = cube(cloud, &kept, options)?;
        let confidence = confidences(cloud, &kept, options);
        let mut all: Vec<(u64, Sample)> = kept
            .par_iter()
            .zip(confidence)
            .map(|(&i, confidence)| {
                let position: [f64; 3] = ((cloud.positions[i] - corner) / edge).into();
                let normal: Vector3<f32> = cloud.normals[i].normalize();
                let sample = Sample { position, normal: normal.into(), index: i as u32, confidence, area: 0.0, depth: depth as u8 };
                (encode(cell_of(&position, depth)), sample)
            })
            .collect();
        all.par_sort_unstable_by_key(|(code, sample)| (*code, sample.index));
        let (codes, all) = all.into_iter().unzip();
        Ok(Self { all, codes, depth, corner, edge })
    }

    /// The samples in a cube of `2^shift` cells of level `level` along its edge, given its coordinates in such cubes.
    pub(super) fn within(&self, cube: Coordinates, level: u32, shift: u32) -> Range<usize> {
        let bits = 3 * (self.depth - level + shift);
        let code = encode(cube);
        let start = self.codes.partition_point(|&c| c >> bits < code);
        start..start + self.codes[start..].partition_point(|&c| c >> bits == code)
    }

    /// Runs of samples in one cell of a level, among a range of samples.
    pub(super) fn cells(&self, range: Range<usize>, level: u32) -> impl Iterator<Item = (u64, Range<usize>)> + '_ {
        let bits = 3 * (self.depth - level);
        let mut next = range.start;
        std::iter::from_fn(move || {
            let start = next;
            let code = self.codes.get(start).filter(|_| start < range.end)? >> bits;
            while next < range.end && self.codes[next] >> bits == code {
                next += 1;
            }
            Some((code, start..next))
        })
    }
}

/// The cell of a level that holds a position of the unit cube.
pub(super) fn cell_of(position: &[f64; 3], level: u32) -> Coordinates {
    let cells = f64::from(1u32 << level);
    position.map(|v| (v * cells).floor().clamp(0.0, cells - 1.0) as u32)
}

/// Depth, first corner and edge of the cube: an eighth larger than the points, and a cell and a half of the coarsest level on every side.
fn cube(cloud: &Cloud, kept: &[usize], options: &PoissonOptions) -> Result<(u32, Point3<f64>, f64), SurfaceError> {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for &i in kept {
        low = low.inf(&cloud.positions[i].coords);
        high = high.sup(&cloud.positions[i].coords);
    }
    let extent = (high - low).max();
    let far = low.amax().max(high.amax());
    if !(extent > far * 1e-12 && extent < 1e30) {
        return Err(SurfaceError::NoExtent { extent });
    }
    let needed = |depth: u32| {
        let cells = f64::from(1u32 << depth.min(super::base::DEPTH));
        // The smallest bases hold the points in their middle cell.
        extent * MARGIN.max(cells / (cells - 3.0).max(0.5))
    };
    let (depth, edge) = match options.resolution {
        Resolution::Depth(depth) => (depth, needed(depth)),
        Resolution::Cell(cell) => {
            let fits = |depth: &u32| cell * f64::from(1u32 << depth) >= needed(*depth);
            let depth = (2..=MAX_DEPTH).find(fits).ok_or(SurfaceError::TooFine {
                cell,
                extent,
                finest: needed(MAX_DEPTH) / f64::from(1u32 << MAX_DEPTH),
            })?;
            (depth, cell * f64::from(1u32 << depth))
        }
    };
    Ok((depth, Point3::from((low + high) / 2.0 - Vector3::repeat(edge / 2.0)), edge))
}

fn confidences(cloud: &Cloud, kept: &[usize], options: &PoissonOptions) -> Vec<f32> {
    let usable = |s: f32| s.is_finite() && s > 0.0;
    if !options.sigma_weights || cloud.sigmas.len() != cloud.len() {
        return vec![1.0; kept.len()];
    }
    let mut sorted: Vec<f32> = kept.iter().map(|&i| cloud.sigmas[i]).filter(|&s| usable(s)).collect();
    if sorted.is_empty() {
        return vec![1.0; kept.len()];
    }
    let middle = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
    let weight = |s: f32| if usable(s) { ((median / s) * (median / s)).clamp(1.0 / MAX_CONFIDENCE, MAX_CONFIDENCE) } else { 1.0 };
    kept.iter().map(|&i| weight(cloud.sigmas[i])).collect()
}
