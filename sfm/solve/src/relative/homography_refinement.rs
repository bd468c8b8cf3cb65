//! Least symmetric transfer error of a homography.

use super::homography::Both;
use super::matches::Matches;
use crate::numeric::minimise::{COARSE, Normal, levenberg_marquardt};
use nalgebra::{Matrix3, SVector, Vector2, Vector3};

/// Trials of one refinement.
const MAX_STEPS: usize = 10;

/// `(u, v)` of `H (x, y, 1)` and its third coordinate.
#[inline]
pub(super) fn forward(h: &Matrix3<f64>, x: f64, y: f64) -> (f64, f64, f64) {
    let w = h[(2, 0)] * x + h[(2, 1)] * y + h[(2, 2)];
    let inverse = 1.0 / w;
    ((h[(0, 0)] * x + h[(0, 1)] * y + h[(0, 2)]) * inverse, (h[(1, 0)] * x + h[(1, 1)] * y + h[(1, 2)]) * inverse, w)
}

/// Levenberg-Marquardt over the nine entries; the damping takes up their common scale.
pub(super) fn refined(model: &Both, matches: &Matches, inliers: &[usize], max_error: f64) -> Both {
    let limit = max_error * max_error;
    let linearise = |m: &Both| {
        let mut normal = Normal::zero();
        for &i in inliers {
            let Some(terms) = linearised(m, &matches.first(i), &matches.second(i)) else {
                normal.cost += limit;
                continue;
            };
            let error = 0.5 * terms.iter().map(|(r, _)| r * r).sum::<f64>();
            if error < limit {
                terms.iter().for_each(|(r, j)| normal.add(*r, j, 0.5));
                normal.cost += error;
            } else {
                normal.cost += limit;
            }
        }
        Some(normal)
    };
    // A step that makes H singular keeps the model: its cost is not lower, and the damping grows.
    levenberg_marquardt(model, MAX_STEPS, COARSE, linearise, |m, step| moved(m, step).unwrap_or_else(|| m.clone()))
}

fn moved(model: &Both, step: &SVector<f64, 9>) -> Option<Both> {
    Both::new(&(model.h + Matrix3::from_row_slice(step.as_slice())))
}

/// Two residuals in each image with derivatives by the entries of H, row by row.
///
/// Forward `d u = P dH x1 / w`; backward, with `d H^-1 = -H^-1 dH H^-1`, `d u = -(P H^-1 / w) dH (H^-1 x2)`, where P are the rows (1, 0, -u)
/// and (0, 1, -v). `None` beyond the horizon.
fn linearised(m: &Both, x1: &Vector3<f64>, x2: &Vector3<f64>) -> Option<[(f64, [f64; 9]); 4]> {
    let (p, q) = (m.h * x1, m.inverse * x2);
    if !(p.z > 0.0 && q.z > 0.0) {
        return None;
    }
    let row = |image: &Vector3<f64>, axis: usize| {
        let mut row = Vector3::zeros();
        row[axis] = 1.0 / image.z;
        row.z = -image[axis] / (image.z * image.z);
        row
    };
    let outer = |left: &Vector3<f64>, right: &Vector3<f64>| std::array::from_fn(|k| left[k / 3] * right[k % 3]);
    let uv = |image: &Vector3<f64>| Vector2::new(image.x / image.z, image.y / image.z);
    let (a, b) = (uv(&p) - x2.xy(), uv(&q) - x1.xy());
    let back = |axis: usize| outer(&-m.inverse.tr_mul(&row(&q, axis)), &q);
    Some([(a.x, outer(&row(&p, 0), x1)), (a.y, outer(&row(&p, 1), x1)), (b.x, back(0)), (b.y, back(1))])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_differences() {
        let model = Both::new(&Matrix3::new(1.0, 0.1, -0.2, -0.05, 0.9, 0.3, 0.1, -0.2, 1.0)).unwrap();
        let (x1, x2) = (Vector3::new(0.4, -0.7, 1.0), Vector3::new(0.1, -0.3, 1.0));
        let terms = linearised(&model, &x1, &x2).unwrap();
        let h = 1e-6;
        for k in 0..9 {
            let mut step = SVector::<f64, 9>::zeros();
            step[k] = h;
            let plus = linearised(&moved(&model, &step).unwrap(), &x1, &x2).unwrap();
            let minus = linearised(&moved(&model, &-step).unwrap(), &x1, &x2).unwrap();
            for i in 0..4 {
                // Scaling to norm 1 does not change the residuals.
                assert!((terms[i].1[k] - (plus[i].0 - minus[i].0) / (2.0 * h)).abs() < 1e-7, "{i} {k}");
            }
        }
    }
}
