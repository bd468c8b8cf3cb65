//! Start values from views of a flat target.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};
use scene::Rigid3;

/// The homography `pixel ~ H (x, y, 1)` of least algebraic error on conditioned coordinates (Hartley, PAMI 1997), with H (x, y, 1) in front.
/// `None` for fewer than four points or points in line.
pub(crate) fn homography(plane: &[Vector2<f64>], pixels: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    if plane.len() < 4 || plane.len() != pixels.len() {
        return None;
    }
    let (t1, t2) = (conditioning(plane)?, conditioning(pixels)?);
    let mut rows = DMatrix::zeros(2 * plane.len(), 9);
    for (k, (p, q)) in plane.iter().zip(pixels).enumerate() {
        let (a, b) = (t1 * p.push(1.0), t2 * q.push(1.0));
        for i in 0..3 {
            rows[(2 * k, i)] = a[i];
            rows[(2 * k, 6 + i)] = -b.x * a[i];
            rows[(2 * k + 1, 3 + i)] = a[i];
            rows[(2 * k + 1, 6 + i)] = -b.y * a[i];
        }
    }
    let eigen = (rows.transpose() * rows).symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    // Points in line leave more than one solution.
    if eigen.eigenvalues[order[1]] <= 1e-10 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = Matrix3::from_row_slice(eigen.eigenvectors.column(order[0]).as_slice());
    let h = t2.try_inverse()? * h * t1;
    let h = h / h.norm();
    Some(if (h * plane[0].push(1.0)).z < 0.0 { -h } else { h })
}

/// Moves points to mean 0 and mean distance sqrt 2.
fn conditioning(points: &[Vector2<f64>]) -> Option<Matrix3<f64>> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector2<f64>>() / n;
    let size = points.iter().map(|p| (p - mean).norm()).sum::<f64>() / n;
    let s = 2f64.sqrt() / size;
    s.is_finite().then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

/// The principal distance from homographies of a plane: the images of the plane's axes are orthogonal and of one length.
///
/// Zhang, *A flexible new technique for camera calibration*, PAMI 2000, his constraints (3) and (4) for square pixels and a principal point in
/// the middle, which makes them linear in 1 / c2; the adjustment frees the rest. `None` where they give nothing real.
pub(crate) fn focal(homographies: &[Matrix3<f64>], centre: Vector2<f64>, size: f64) -> Option<f64> {
    let to_centre = Matrix3::new(1.0 / size, 0.0, -centre.x / size, 0.0, 1.0 / size, -centre.y / size, 0.0, 0.0, 1.0);
    let (mut top, mut bottom) = (0.0, 0.0);
    for h in homographies {
        let h = to_centre * h;
        let (a, b) = (h.column(0), h.column(1));
        let scale = 1.0 / (a.norm() * b.norm());
        let orthogonal = (a.x * b.x + a.y * b.y, a.z * b.z);
        let equal = (a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y, a.z * a.z - b.z * b.z);
        for (u, v) in [orthogonal, equal] {
            top -= u * v * scale * scale;
            bottom += u * u * scale * scale;
        }
    }
    let focal = size / (top / bottom).sqrt();
    (focal.is_finite() && focal > 0.05 * size && focal < 100.0 * size).then_some(focal)
}

/// The pose `cam_from_target` of a plane's homography, for a principal distance and a principal point.
pub(crate) fn pose(h: &Matrix3<f64>, focal: f64, centre: Vector2<f64>) -> Option<Rigid3> {
    let k = Matrix3::new(focal, 0.0, centre.x, 0.0, focal, centre.y, 0.0, 0.0, 1.0);
    let m = k.try_inverse()? * h;
    let scale = 2.0 / (m.column(0).norm() + m.column(1).norm());
    let sign = if m[(2, 2)] < 0.0 { -scale } else { scale };
    let (x, y) = (m.column(0) * sign, m.column(1) * sign);
    let near = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let svd = near.svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    let translation: Vector3<f64> = m.column(2) * sign;
    (rotation.determinant() > 0.0 && translation.iter().all(|v| v.is_finite())).then(|| Rigid3::from_matrix(&rotation, translation))
}
