//! The figures of a cloud.

use crate::distance::{Reference, Ruler};
use crate::distribution::{Histogram, NormalFit, WeibullFit, fit_sample, percentiles_about};
use crate::gather::{Gathered, gather};
use crate::points::Points;
use crate::region::Region;
use crate::statistics::{percentile, sum};
use crate::{EvalError, warnings};
use rayon::prelude::*;
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
    /// Further thresholds of the curve, metres; a quarter, half, once, twice and four times the threshold are always there.
    pub curve_m: Vec<f64>,
    /// What of the reference counts for integrity and completeness. The cloud has to be cut to the same region
    /// ([`crate::Prepared`]).
    pub region: Option<Region>,
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
            curve_m: Vec::new(),
            region: None,
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
    /// Median of d, metres; only against a mesh.
    pub c2m_signed_median_m: Option<f64>,
    /// Median absolute deviation from the median of d (of |d| against a cloud), metres; times 1.4826 it estimates the standard
    /// deviation of a normal law (Hoehle & Hoehle, ISPRS Journal, 2009).
    pub c2m_mad_m: f64,
    /// Largest |d|, metres.
    pub c2m_max_m: f64,
    /// Percentiles of |d|.
    pub c2m_percentiles_m: Percentiles,
    /// Counts of d (of |d| against a cloud) in intervals of a tenth of T, out to 4 T: the same for all clouds that are measured
    /// with one T.
    pub c2m_histogram: Histogram,
    /// Normal law fitted to d; `None` against a cloud and where all d are the same.
    pub c2m_normal: Option<NormalFit>,
    /// Weibull's law fitted to |d|, by at most 50,000 evenly spaced ranks; `None` where all |d| are the same.
    pub c2m_weibull: Option<WeibullFit>,
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
    /// Accuracy, completeness and F-score at several thresholds, ascending.
    pub curve: Vec<CurvePoint>,
    /// What makes the figures doubtful.
    pub warnings: Vec<String>,
}

/// A point of the curves of Knapitsch et al. and Schoeps et al.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// The threshold, metres.
    pub threshold_m: f64,
    /// Share of points with |d| at most the threshold.
    pub accuracy: f64,
    /// Share of the reference that has a point within the threshold.
    pub completeness: f64,
    /// Harmonic mean of both; 0 where both are 0.
    pub f_score: f64,
}

/// What is told of each piece of a cloud when its distances are known: points, and signed or unsigned distances.
pub type EachDistance<'a> = dyn FnMut(&[nalgebra::Point3<f64>], &[f64]) -> Result<(), EvalError> + 'a;

/// Compares a cloud with a reference; both in metres and in the same frame. Holds eight bytes a point, whatever the cloud's
/// size, besides a piece of it.
///
/// # Errors
/// [`EvalError`]: an empty cloud or reference, positions that are not finite, faces without vertices, options that are not
/// positive, no threshold, or cells too fine for the extent.
pub fn evaluate(points: &dyn Points, reference: &Reference, options: &EvalOptions) -> Result<CloudMetrics, EvalError> {
    evaluate_each(points, reference, options, &mut |_, _| Ok(()))
}

/// As [`evaluate`], and hands over the points with their distances, in the order of the cloud.
///
/// # Errors
/// As [`evaluate`], and what `each` returns.
pub fn evaluate_each(
    points: &dyn Points,
    reference: &Reference,
    options: &EvalOptions,
    each: &mut EachDistance<'_>,
) -> Result<CloudMetrics, EvalError> {
    let threshold = threshold(options)?;
    let radius = positive("density_radius_m", options.density_radius_m.unwrap_or(threshold))?;
    let grid = positive("grid_m", options.grid_m.unwrap_or(threshold))?;
    let thresholds = curve_thresholds(threshold, options)?;
    let ruler = Ruler::new(reference)?;
    let Gathered {
        distances: mut signed,
        density_neighbours,
        density_samples,
        reference_squared,
        cells_found,
        cells_true,
        cells_common,
        warnings: mut doubts,
    } = gather(points, reference, &ruler, [threshold, radius, grid, thresholds[thresholds.len() - 1]], options, each)?;
    let has_sign = matches!(reference, Reference::Mesh(_));
    let n = signed.len() as f64;
    let (mean, signed_mean, squares) = (sum(&signed, f64::abs) / n, sum(&signed, |d| d) / n, sum(&signed, |d| d * d) / n);
    let bins = |side: f64| Histogram::new(&signed, -side * 4.0 * threshold, threshold / 10.0, if side > 0.0 { 80 } else { 40 });
    let c2m_histogram = bins(if has_sign { 1.0 } else { 0.0 });
    signed.par_sort_unstable_by(f64::total_cmp);
    let signed_median = percentile(&signed, 50.0);
    let unsigned = percentiles_about(&signed, 0.0, &[25.0, 50.0, 75.0, 90.0, 95.0, 99.0, 100.0]);
    let [p25_m, median, p75_m, p90_m, p95_m, p99_m, max] = unsigned[..] else { unreachable!("seven are asked for") };
    let within = |t: f64| (signed.partition_point(|&d| d <= t) - signed.partition_point(|&d| d < -t)) as f64 / n;
    let covered = |t: f64| reference_squared.iter().filter(|&&s| s <= t * t).count() as f64 / reference_squared.len() as f64;
    let at = |threshold_m: f64| {
        let (accuracy, completeness) = (within(threshold_m), covered(threshold_m));
        let sum = accuracy + completeness;
        let f_score = if sum > 0.0 { 2.0 * accuracy * completeness / sum } else { 0.0 };
        CurvePoint { threshold_m, accuracy, completeness, f_score }
    };
    let main = at(threshold);
    doubts.extend(warnings::of_distances(main.accuracy, median, reference));
    Ok(CloudMetrics {
        points: signed.len(),
        threshold_m: threshold,
        c2m_mean_m: mean,
        c2m_signed_mean_m: has_sign.then_some(signed_mean),
        c2m_rms_m: squares.sqrt(),
        c2m_median_m: median,
        c2m_signed_median_m: has_sign.then_some(signed_median),
        c2m_mad_m: percentiles_about(&signed, signed_median, &[50.0])[0],
        c2m_max_m: max,
        c2m_percentiles_m: Percentiles { p25_m, p75_m, p90_m, p95_m, p99_m },
        c2m_histogram,
        c2m_normal: if has_sign { NormalFit::new(&signed) } else { None },
        c2m_weibull: WeibullFit::new(&fit_sample(&signed)),
        snr: main.accuracy,
        surface_density_per_m2: density_neighbours as f64 / density_samples as f64 / (std::f64::consts::PI * radius * radius),
        density_radius_m: radius,
        integrity: cells_found as f64 / cells_true as f64,
        integrity_coverage: cells_common as f64 / cells_true as f64,
        grid_m: grid,
        accuracy: main.accuracy,
        completeness: main.completeness,
        f_score: main.f_score,
        curve: thresholds.into_iter().map(at).collect(),
        warnings: doubts,
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

fn curve_thresholds(threshold: f64, options: &EvalOptions) -> Result<Vec<f64>, EvalError> {
    let mut all = [0.25, 0.5, 1.0, 2.0, 4.0].map(|f| f * threshold).to_vec();
    for &value in &options.curve_m {
        all.push(positive("curve_m", value)?);
    }
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    Ok(all)
}
