//! Planes through neighbours.

use crate::distance::Index;
use nalgebra::{Matrix3, Vector3};

/// Normal of the plane through the points within `radius` of `p` (relative to the index's origin): the eigenvector of the
/// smallest eigenvalue of their covariance (Hoppe et al., *Surface reconstruction from unorganized points*, SIGGRAPH 1992).
/// `None` for fewer than three points or points on one line. The sign is that of a positive largest component.
pub(crate) fn normal(index: &Index<Vector3<f64>>, p: &Vector3<f64>, radius: f64) -> Option<Vector3<f64>> {
    let (mut count, mut sum, mut squares) = (0.0, Vector3::zeros(), Matrix3::zeros());
    index.within(p, radius, |slot, _| {
        let d = index.primitive(slot).0 - p;
        count += 1.0;
        sum += d;
        squares += d * d.transpose();
    });
    if count < 3.0 {
        return None;
    }
    let mean = sum / count;
    let eigen = (squares / count - mean * mean.transpose()).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    if eigen.eigenvalues[order[1]] <= 1e-12 * eigen.eigenvalues[order[2]] {
        return None;
    }
    let normal: Vector3<f64> = eigen.eigenvectors.column(order[0]).into();
    let largest = normal[normal.iamax()];
    Some(if largest < 0.0 { -normal } else { normal })
}
