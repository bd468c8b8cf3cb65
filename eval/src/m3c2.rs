//! Differences of two clouds along local normals, with their confidence.

use crate::EvalError;
use crate::distance::{Index, check_positions};
use crate::hilbert;
use crate::neighbours::normal;
use crate::statistics::percentile;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use serde::Serialize;

/// Scales of M3C2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct M3c2Options {
    /// D, diameter within which a normal is estimated, metres.
    pub normal_scale_m: f64,
    /// d, diameter of the cylinder in which positions are averaged, metres.
    pub projection_scale_m: f64,
    /// Half the length of the cylinder: larger differences are not seen, metres.
    pub max_depth_m: f64,
    /// Error of the registration of the two clouds, metres.
    pub registration_m: f64,
    /// Most points of the reference at which the difference is measured; of more, evenly spaced ones are taken.
    pub max_core_points: usize,
}

/// The difference at one core point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct M3c2Point {
    /// Place of the core point.
    pub position: [f64; 3],
    /// Mean place of the cloud less that of the reference along the normal, metres.
    pub distance_m: f64,
    /// Level of detection at 95 % confidence, metres; the difference is significant where it is larger.
    pub detection_m: f64,
}

/// Summary of the differences.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct M3c2Summary {
    /// Core points asked for.
    pub core_points: usize,
    /// Core points with at least four points of each cloud in the cylinder.
    pub measured: usize,
    /// Mean difference, metres.
    pub mean_m: f64,
    /// Median difference, metres.
    pub median_m: f64,
    /// Root of the mean squared difference, metres.
    pub rms_m: f64,
    /// Mean level of detection, metres.
    pub mean_detection_m: f64,
    /// Share of the measured core points whose difference is significant, from 0 to 1.
    pub significant: f64,
}

/// Points in a cylinder below which no standard deviation is believed (Lague et al. 2013, section 3.3.2, take 4).
const MIN_POINTS: f64 = 4.0;

/// M3C2 (Lague, Brodu & Leroux, *Accurate 3D comparison of complex topography with terrestrial laser scanner*, ISPRS Journal
/// of Photogrammetry and Remote Sensing, 2013): at core points i of the reference with normal N at the scale D, the
/// distance of the mean positions of both clouds along N in a cylinder of diameter d, and
/// LOD95 = 1.96 (sqrt(s1^2 / n1 + s2^2 / n2) + reg). Normals point along the positive side of their largest component.
///
/// # Errors
/// [`EvalError`]: an empty cloud or reference, positions that are not usable, scales that are not positive, no core point with
/// points of both clouds.
pub fn m3c2(cloud: &[Point3<f64>], reference: &[Point3<f64>], options: &M3c2Options) -> Result<(M3c2Summary, Vec<M3c2Point>), EvalError> {
    for (name, value) in [
        ("normal_scale_m", options.normal_scale_m),
        ("projection_scale_m", options.projection_scale_m),
        ("max_depth_m", options.max_depth_m),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(EvalError::BadOption { name, value });
        }
    }
    if !(options.registration_m >= 0.0 && options.registration_m.is_finite()) {
        return Err(EvalError::BadOption { name: "registration_m", value: options.registration_m });
    }
    if cloud.is_empty() {
        return Err(EvalError::EmptyCloud);
    }
    if reference.is_empty() {
        return Err(EvalError::EmptyReference("the cloud has no points"));
    }
    check_positions("reference point", reference, &Point3::origin())?;
    let (low, high) = hilbert::bounds(reference);
    let origin = nalgebra::center(&low, &high);
    check_positions("point", cloud, &origin)?;
    let index = |points: &[Point3<f64>]| Index::new(origin, points.iter().map(|p| p - origin).collect());
    let (first, second) = (index(reference), index(cloud));
    let stride = reference.len().div_ceil(options.max_core_points.max(1));
    let core: Vec<Vector3<f64>> = reference.iter().step_by(stride).map(|p| p - origin).collect();
    let points: Vec<M3c2Point> =
        core.par_iter().map(|p| difference(&first, &second, p, options)).collect::<Vec<_>>().into_iter().flatten().collect();
    if points.is_empty() {
        return Err(EvalError::BadCount { found: 0, truth: core.len(), needed: 1 });
    }
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&M3c2Point) -> f64| points.iter().map(f).sum::<f64>() / n;
    let mut sorted: Vec<f64> = points.iter().map(|p| p.distance_m).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let summary = M3c2Summary {
        core_points: core.len(),
        measured: points.len(),
        mean_m: mean(&|p| p.distance_m),
        median_m: percentile(&sorted, 50.0),
        rms_m: mean(&|p| p.distance_m * p.distance_m).sqrt(),
        mean_detection_m: mean(&|p| p.detection_m),
        significant: mean(&|p| f64::from(u8::from(p.distance_m.abs() > p.detection_m))),
    };
    Ok((summary, points))
}

fn difference(first: &Index<Vector3<f64>>, second: &Index<Vector3<f64>>, p: &Vector3<f64>, options: &M3c2Options) -> Option<M3c2Point> {
    let normal = normal(first, p, options.normal_scale_m / 2.0)?;
    let (mean1, variance1, n1) = along(first, p, &normal, options)?;
    let (mean2, variance2, n2) = along(second, p, &normal, options)?;
    Some(M3c2Point {
        position: (first.origin + p).into(),
        distance_m: mean2 - mean1,
        detection_m: 1.96 * ((variance1 / n1 + variance2 / n2).sqrt() + options.registration_m),
    })
}

/// Mean, variance and number of the places along `normal` of the points in the cylinder.
fn along(index: &Index<Vector3<f64>>, p: &Vector3<f64>, normal: &Vector3<f64>, options: &M3c2Options) -> Option<(f64, f64, f64)> {
    let (radius, depth) = (options.projection_scale_m / 2.0, options.max_depth_m);
    let (mut n, mut mean, mut squares) = (0.0, 0.0, 0.0);
    index.within(p, radius.hypot(depth), |slot, squared| {
        let along = normal.dot(&(index.primitive(slot).0 - p));
        if along.abs() <= depth && squared - along * along <= radius * radius {
            // Welford's update keeps its digits.
            n += 1.0;
            let step = along - mean;
            mean += step / n;
            squares += step * (along - mean);
        }
    });
    (n >= MIN_POINTS).then(|| (mean, squares / (n - 1.0), n))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tilted plane with steps of 1 cm and heights from a low-discrepancy sequence, uniform within +-`noise`.
    fn plane(shift: f64, noise: f64, start: usize) -> Vec<Point3<f64>> {
        let up = Vector3::new(0.6, 0.0, 0.8);
        let along = Vector3::new(0.8, 0.0, -0.6);
        let height = |k: usize| noise * (2.0 * (0.5 + 0.754_877_666_246_692_7 * (k + start) as f64).fract() - 1.0);
        (0..10_000)
            .map(|k| Point3::from(along * (0.01 * (k % 100) as f64) + Vector3::y() * (0.01 * (k / 100) as f64) + up * (shift + height(k))))
            .collect()
    }

    const OPTIONS: M3c2Options =
        M3c2Options { normal_scale_m: 0.3, projection_scale_m: 0.1, max_depth_m: 0.2, registration_m: 0.0, max_core_points: 500 };

    #[test]
    fn parallel_planes_with_noise_have_their_distance_and_confidence() {
        let (summary, points) = m3c2(&plane(0.05, 0.01, 777), &plane(0.0, 0.01, 0), &OPTIONS).expect("planes");
        assert_eq!((summary.core_points, summary.measured, summary.significant), (500, 500, 1.0));
        assert!((summary.mean_m - 0.05).abs() < 2e-4, "{summary:?}");
        // About 79 points in the cylinder inside, sigma 0.01 / sqrt 3 each; fewer at the border, so the mean is larger.
        let inside = 1.96 * (2.0 * 1e-4f64 / 3.0 / 79.0).sqrt();
        let smallest = points.iter().map(|p| p.detection_m).fold(f64::INFINITY, f64::min);
        assert!((smallest / inside - 1.0).abs() < 0.1 && summary.mean_detection_m < 1.3 * inside, "{smallest} against {inside}");
    }

    #[test]
    fn no_change_is_not_significant_and_registration_widens() {
        let (same, _) = m3c2(&plane(0.0, 0.01, 777), &plane(0.0, 0.01, 0), &OPTIONS).expect("planes");
        assert!(same.significant < 0.1 && same.mean_m.abs() < 2e-4, "{same:?}");
        let with = M3c2Options { registration_m: 0.03, ..OPTIONS };
        let (wide, _) = m3c2(&plane(0.05, 0.01, 777), &plane(0.0, 0.01, 0), &with).expect("planes");
        let (narrow, _) = m3c2(&plane(0.05, 0.01, 777), &plane(0.0, 0.01, 0), &OPTIONS).expect("planes");
        assert!((wide.mean_detection_m - narrow.mean_detection_m - 1.96 * 0.03).abs() < 1e-12);
        assert_eq!(wide.significant, 0.0);
    }

    #[test]
    fn what_cannot_be_compared_is_an_error() {
        assert!(m3c2(&[], &plane(0.0, 0.0, 0), &OPTIONS).is_err() && m3c2(&plane(0.0, 0.0, 0), &[], &OPTIONS).is_err());
        assert!(m3c2(&plane(5.0, 0.0, 0), &plane(0.0, 0.0, 0), &OPTIONS).is_err());
        assert!(m3c2(&plane(0.0, 0.0, 0), &plane(0.0, 0.0, 0), &M3c2Options { max_depth_m: 0.0, ..OPTIONS }).is_err());
    }
}
