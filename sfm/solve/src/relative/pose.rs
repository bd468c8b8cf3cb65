//! From an essential matrix to a relative pose.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use scene::Rigid3;

/// A relative pose and how well points support it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativePose {
    /// The pose; its translation has length 1.
    pub cam2_from_cam1: Rigid3,
    /// Number of pairs whose point lies in front of both cameras.
    pub in_front: usize,
    /// Median angle between the rays of these pairs, radians: near zero the translation means nothing.
    pub median_angle_rad: f64,
}

/// `E = [t]x R`.
#[must_use]
pub fn essential_from_pose(cam2_from_cam1: &Rigid3) -> Matrix3<f64> {
    cam2_from_cam1.translation.cross_matrix() * cam2_from_cam1.rotation_matrix()
}

/// The one of the four poses of an essential matrix for which most points lie in front of both cameras.
///
/// `x1`, `x2` in normalised coordinates, best only inliers. With the singular value decomposition `E = U S V^T`: `R = U W V^T` or
/// `U W^T V^T`, `t = +-U_3` (Hartley & Zisserman, *Multiple View Geometry*, 9.6.2); depths from the midpoint of the two rays.
/// `None` when E is not finite or no point is in front in any. On a tie the first wins, in a fixed order. For rays
/// that are nearly parallel the signs are noise: look at [`RelativePose::median_angle_rad`].
#[must_use]
pub fn pose_from_essential(e: &Matrix3<f64>, x1: &[Vector2<f64>], x2: &[Vector2<f64>]) -> Option<RelativePose> {
    let (first, second, t) = decompose(e)?;
    let mut best: Option<(usize, Rigid3)> = None;
    for (rotation, t) in [(first, t), (first, -t), (second, t), (second, -t)] {
        let matrix = rotation.to_rotation_matrix();
        let count = x1.iter().zip(x2).filter(|(a, b)| in_front(&(matrix * a.push(1.0)), &b.push(1.0), &t)).count();
        if count > best.map_or(0, |(c, _)| c) {
            best = Some((count, Rigid3::new(rotation, t)));
        }
    }
    let (in_front_count, pose) = best?;
    let matrix = pose.rotation.to_rotation_matrix();
    let mut angles: Vec<f64> = x1
        .iter()
        .zip(x2)
        .map(|(a, b)| (matrix * a.push(1.0), b.push(1.0)))
        .filter(|(a, b)| in_front(a, b, &pose.translation))
        .map(|(a, b)| a.cross(&b).norm().atan2(a.dot(&b)))
        .collect();
    let middle = angles.len() / 2;
    let (_, &mut median_angle_rad, _) = angles.select_nth_unstable_by(middle, f64::total_cmp);
    Some(RelativePose { cam2_from_cam1: pose, in_front: in_front_count, median_angle_rad })
}

/// Signs of both depths at the midpoint of the rays `p a + t` and `q b` (Gram determinants; their common denominator is
/// positive).
fn in_front(a: &Vector3<f64>, b: &Vector3<f64>, t: &Vector3<f64>) -> bool {
    let (aa, bb, ab) = (a.norm_squared(), b.norm_squared(), a.dot(b));
    let (at, bt) = (a.dot(t), b.dot(t));
    ab * bt - bb * at > 0.0 && aa * bt - ab * at > 0.0
}

/// Both rotations and the translation (up to sign); `None` when E is not finite or zero.
pub(super) fn decompose(e: &Matrix3<f64>) -> Option<(UnitQuaternion<f64>, UnitQuaternion<f64>, Vector3<f64>)> {
    let norm = e.norm();
    if !(norm > 0.0 && norm.is_finite()) {
        return None;
    }
    let svd = (e / norm).svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let w = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let rotation = |w: Matrix3<f64>| {
        let mut r = u * w * v_t;
        if r.determinant() < 0.0 {
            r = -r;
        }
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r))
    };
    Some((rotation(w), rotation(w.transpose()), u.column(2).normalize()))
}

/// Two unit vectors that are orthogonal to the unit vector `t` and to each other.
pub(super) fn tangent(t: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = if t.x.abs() <= t.y.abs() && t.x.abs() <= t.z.abs() {
        Vector3::x()
    } else if t.y.abs() <= t.z.abs() {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let b = t.cross(&axis).normalize();
    [b, t.cross(&b)]
}
