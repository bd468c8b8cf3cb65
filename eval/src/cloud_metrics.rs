//! The figures of a cloud.

use crate::distance::{Reference, check_mesh, check_positions, signed_to_mesh, to_cloud};
use crate::grid::{Cells, PointGrid, occupied};
use crate::statistics::{percentile, sum};
use crate::{EvalError, morton, surface};
use nalgebra::Point3;
use rayon::prelude::*;
use scene::Cloud;
use serde::Serialize;

/// What to measure with.
#[derive(Clone, Debug, PartialEq)]
pub struct EvalOptions {
    /// Ground sampling distance: what a pixel covers on the object, metres. Sets the threshold where that is not given.
    pub gsd_m: Option<f64>,
    /// Largest distance from the reference of a point that is signal, metres. Default: 2 GSD, as in the paper (5 cm).
    pub threshold_m: Option<f64>,
    /// Radius R of the surface density, metres. Default: the threshold, as in the paper.
    pub density_radius_m: Option<f64>,
    /// Cell of the integrity, metres. Default: the threshold, as in the paper.
    pub grid_m: Option<f64>,
    /// Most points at which the surface density is measured; a larger cloud is sampled evenly. Dense clouds have thousands
    /// of neighbours within R at each of millions of points, and the mean does not need them all.
    pub max_density_samples: usize,
    /// Most points of a mesh at which the completeness is measured.
    pub max_completeness_samples: usize,
}

impl Default for EvalOptions {
    fn default() -> Self {
        Self {
            gsd_m: None,
            threshold_m: None,
            density_radius_m: None,
            grid_m: None,
            max_density_samples: 100_000,
            max_completeness_samples: 200_000,
        }
    }
}

/// Percentiles of the unsigned distances, metres, interpolated linearly between ranks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// 25 %.
    pub p25_m: f64,
    /// 75 %.
    pub p75_m: f64,
    /// 90 %: the accuracy of Seitz et al., CVPR 2006.
    pub p90_m: f64,
    /// 95 %.
    pub p95_m: f64,
    /// 99 %.
    pub p99_m: f64,
}

/// The figures of a cloud. d is the distance of a point to the reference, T the threshold, N the number of points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CloudMetrics {
    /// N, the paper's NB 3D.
    pub points: usize,
    /// T, metres.
    pub threshold_m: f64,
    /// C2M of the paper: mean of |d|, metres.
    pub c2m_mean_m: f64,
    /// Mean of d, metres, positive outside the surface (CloudCompare's default); only against a mesh.
    pub c2m_signed_mean_m: Option<f64>,
    /// Square root of the mean of d squared, metres.
    pub c2m_rms_m: f64,
    /// Median of |d|, metres.
    pub c2m_median_m: f64,
    /// Largest |d|, metres.
    pub c2m_max_m: f64,
    /// Percentiles of |d|.
    pub c2m_percentiles_m: Percentiles,
    /// SNR of the paper, from 0 to 1: share of points with |d| at most T.
    pub snr: f64,
    /// SD of the paper, points per square metre: mean over the points of n / (pi R^2), n being the number of points within
    /// R, the point itself included (as CloudCompare counts).
    pub surface_density_per_m2: f64,
    /// R, metres.
    pub density_radius_m: f64,
    /// I of the paper: number of cells that hold a point with |d| at most T, over the number of cells that the reference
    /// passes through. Points beside the surface fill cells beside it, so noise can raise this above 1.
    pub integrity: f64,
    /// Share of the reference's cells that hold a point with |d| at most T: the same without that flaw, from 0 to 1.
    pub integrity_coverage: f64,
    /// Edge of a cell, metres.
    pub grid_m: f64,
    /// Share of points with |d| at most T, from 0 to 1: precision in Knapitsch et al., accuracy in Schoeps et al. (ETH3D,
    /// CVPR 2017). By definition equal to the SNR.
    pub accuracy: f64,
    /// Share of the reference that has a point of the cloud within T, from 0 to 1, by area for a mesh, by points for a cloud
    /// (recall in Knapitsch et al.).
    pub completeness: f64,
    /// Harmonic mean of accuracy and completeness; 0 where both are 0.
    pub f_score: f64,
}

/// Compares a cloud with a reference; both in metres and in the same frame.
///
/// # Errors
/// [`EvalError`]: an empty cloud or reference, positions that are not finite, faces without vertices, options that are not
/// positive, no threshold, or cells too fine for the extent.
pub fn evaluate(cloud: &Cloud, reference: &Reference, options: &EvalOptions) -> Result<CloudMetrics, EvalError> {
    let threshold = threshold(options)?;
    let radius = positive("density_radius_m", options.density_radius_m.unwrap_or(threshold))?;
    let grid = positive("grid_m", options.grid_m.unwrap_or(threshold))?;
    if cloud.is_empty() {
        return Err(EvalError::EmptyCloud);
    }
    check_positions("point", &cloud.positions, &Point3::origin())?;
    let signed = match reference {
        Reference::Mesh(mesh) => signed_to_mesh(&cloud.positions, mesh)?,
        Reference::Cloud(other) => to_cloud(&cloud.positions, &other.positions)?,
    };
    let count = signed.len() as f64;
    let signal: Vec<Point3<f64>> = cloud.positions.iter().zip(&signed).filter(|(_, d)| d.abs() <= threshold).map(|(p, _)| *p).collect();
    let mut distances: Vec<f64> = signed.iter().map(|d| d.abs()).collect();
    distances.par_sort_unstable_by(f64::total_cmp);
    let at = |percent| percentile(&distances, percent);
    let snr = signal.len() as f64 / count;
    let completeness = completeness(&cloud.positions, reference, threshold, options)?;
    let (integrity, integrity_coverage) = integrity(&signal, reference, grid, threshold)?;
    Ok(CloudMetrics {
        points: cloud.len(),
        threshold_m: threshold,
        c2m_mean_m: sum(&distances, |d| d) / count,
        c2m_signed_mean_m: matches!(reference, Reference::Mesh(_)).then(|| sum(&signed, |d| d) / count),
        c2m_rms_m: (sum(&distances, |d| d * d) / count).sqrt(),
        c2m_median_m: at(50.0),
        c2m_max_m: at(100.0),
        c2m_percentiles_m: Percentiles { p25_m: at(25.0), p75_m: at(75.0), p90_m: at(90.0), p95_m: at(95.0), p99_m: at(99.0) },
        snr,
        surface_density_per_m2: surface_density(&cloud.positions, radius, options.max_density_samples),
        density_radius_m: radius,
        integrity,
        integrity_coverage,
        grid_m: grid,
        accuracy: snr,
        completeness,
        f_score: if snr + completeness > 0.0 { 2.0 * snr * completeness / (snr + completeness) } else { 0.0 },
    })
}

fn positive(name: &'static str, value: f64) -> Result<f64, EvalError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(EvalError::BadOption { name, value }) }
}

fn threshold(options: &EvalOptions) -> Result<f64, EvalError> {
    match (options.threshold_m, options.gsd_m) {
        (Some(threshold), _) => positive("threshold_m", threshold),
        (None, Some(gsd)) => positive("gsd_m", gsd).map(|gsd| 2.0 * gsd),
        (None, None) => Err(EvalError::NoThreshold),
    }
}

/// Counts of fixed chunks, added in order; integers, so any order would do.
fn count(points: &[Point3<f64>], f: impl Fn(&Point3<f64>) -> usize + Sync) -> usize {
    points.par_chunks(256).map(|chunk| chunk.iter().map(&f).sum::<usize>()).sum()
}

fn surface_density(points: &[Point3<f64>], radius: f64, max_samples: usize) -> f64 {
    let grid = PointGrid::new(points, Cells::new(morton::bounds(points).0, radius));
    // Every k-th point in the order of the cells: an even sample of the cloud.
    let stride = points.len().div_ceil(max_samples.max(1));
    let asked: Vec<_> = grid.points().iter().step_by(stride).copied().collect();
    let neighbours = count(&asked, |p| grid.count_within(p, radius));
    neighbours as f64 / asked.len() as f64 / (std::f64::consts::PI * radius * radius)
}

fn completeness(points: &[Point3<f64>], reference: &Reference, threshold: f64, options: &EvalOptions) -> Result<f64, EvalError> {
    let samples = match reference {
        Reference::Mesh(mesh) => {
            check_mesh(mesh)?;
            // Four samples for each disc of the threshold's radius resolve its coverage; more tell nothing new.
            let wanted = 4.0 * surface::area(mesh) / (threshold * threshold);
            surface::sample(mesh, (wanted as usize).clamp(1000, options.max_completeness_samples.max(1000)))
        }
        Reference::Cloud(other) => other.positions.clone(),
    };
    if samples.is_empty() {
        return Err(EvalError::EmptyReference("the mesh has no area"));
    }
    let grid = PointGrid::new(points, Cells::new(morton::bounds(points).0, threshold));
    Ok(count(&samples, |p| usize::from(grid.any_within(p, threshold))) as f64 / samples.len() as f64)
}

fn integrity(signal: &[Point3<f64>], reference: &Reference, grid: f64, threshold: f64) -> Result<(f64, f64), EvalError> {
    let positions = match reference {
        Reference::Mesh(mesh) => &mesh.vertices,
        Reference::Cloud(other) => &other.positions,
    };
    let (min, max) = morton::bounds(positions);
    // One cell is centred on the corner of the reference; whole cells are added for the points beside it.
    let margin = (threshold / grid).ceil() * grid;
    let cells = Cells::distinct("cells of the integrity", min.map(|c| c - margin), max.map(|c| c + margin), grid)?;
    let truth = match reference {
        Reference::Mesh(mesh) => surface::raster(mesh, cells)?,
        Reference::Cloud(other) => occupied(cells, &other.positions),
    };
    let found = occupied(cells, signal);
    let common = found.iter().filter(|key| truth.binary_search(key).is_ok()).count();
    Ok((found.len() as f64 / truth.len() as f64, common as f64 / truth.len() as f64))
}
