//! Rigid and similarity transforms.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

/// A rigid transform `b_from_a`: `x_in_b = R x_in_a + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid3 {
    /// R.
    pub rotation: UnitQuaternion<f64>,
    /// t, in the unit of the scene.
    pub translation: Vector3<f64>,
}

impl Default for Rigid3 {
    fn default() -> Self {
        Self::identity()
    }
}

impl Rigid3 {
    /// The transform from its rotation and translation.
    #[must_use]
    pub fn new(rotation: UnitQuaternion<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation, translation }
    }

    /// The transform that changes nothing.
    #[must_use]
    pub fn identity() -> Self {
        Self::new(UnitQuaternion::identity(), Vector3::zeros())
    }

    /// The transform from a rotation matrix, which must be orthonormal, and a translation.
    #[must_use]
    pub fn from_matrix(rotation: &Matrix3<f64>, translation: Vector3<f64>) -> Self {
        let rotation = Rotation3::from_matrix_unchecked(*rotation);
        Self::new(UnitQuaternion::from_rotation_matrix(&rotation), translation)
    }

    /// `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self::new(rotation, -(rotation * self.translation))
    }

    /// `x_in_b` of `x_in_a`.
    #[must_use]
    pub fn apply(&self, x_in_a: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * x_in_a + self.translation
    }

    /// The origin of b, expressed in a: the projection centre when this is `cam_from_world`.
    #[must_use]
    pub fn centre(&self) -> Vector3<f64> {
        -(self.rotation.inverse() * self.translation)
    }

    /// R as a matrix.
    #[must_use]
    pub fn rotation_matrix(&self) -> Matrix3<f64> {
        self.rotation.to_rotation_matrix().into_inner()
    }

    /// The same transform after a change of world: with `self = cam_from_world`, gives `cam_from_new_world`.
    ///
    /// Distances in the camera frame are multiplied by the scale of the similarity.
    #[must_use]
    pub fn in_new_world(&self, new_world_from_world: &Similarity3) -> Self {
        let rotation = self.rotation * new_world_from_world.rotation.inverse();
        let centre = new_world_from_world.apply(&self.centre());
        Self::new(rotation, -(rotation * centre))
    }
}

/// `c_from_b * b_from_a = c_from_a`.
impl std::ops::Mul for Rigid3 {
    type Output = Rigid3;
    fn mul(self, b_from_a: Rigid3) -> Rigid3 {
        Rigid3::new(self.rotation * b_from_a.rotation, self.apply(&b_from_a.translation))
    }
}

/// A similarity `b_from_a`: `x_in_b = s R x_in_a + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity3 {
    /// s, positive.
    pub scale: f64,
    /// R.
    pub rotation: UnitQuaternion<f64>,
    /// t.
    pub translation: Vector3<f64>,
}

impl Similarity3 {
    /// A change of unit alone.
    #[must_use]
    pub fn from_scale(scale: f64) -> Self {
        Self { scale, rotation: UnitQuaternion::identity(), translation: Vector3::zeros() }
    }

    /// `x_in_b` of `x_in_a`.
    #[must_use]
    pub fn apply(&self, x_in_a: &Vector3<f64>) -> Vector3<f64> {
        self.scale * (self.rotation * x_in_a) + self.translation
    }

    /// The similarity that maps `from` onto `to` with the least squared error, or the best rigid motion where
    /// `with_scale` is false.
    ///
    /// Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, PAMI 1991.
    /// `None` for fewer than three points, for lists of different lengths, and for points in one place or on one line
    /// (the rotation about the line is free).
    #[must_use]
    pub fn align(from: &[Vector3<f64>], to: &[Vector3<f64>], with_scale: bool) -> Option<Self> {
        Self::align_weighted(from, to, &vec![1.0; from.len()], with_scale)
    }

    /// As [`Similarity3::align`], each squared error times its weight, which must be positive.
    #[must_use]
    pub fn align_weighted(from: &[Vector3<f64>], to: &[Vector3<f64>], weights: &[f64], with_scale: bool) -> Option<Self> {
        if from.len() != to.len() || from.len() != weights.len() || from.len() < 3 {
            return None;
        }
        let n: f64 = weights.iter().sum();
        let mean = |points: &[Vector3<f64>]| points.iter().zip(weights).map(|(x, w)| x * *w).sum::<Vector3<f64>>() / n;
        let (mean_from, mean_to) = (mean(from), mean(to));
        let mut covariance = Matrix3::zeros();
        let mut variance = 0.0;
        for ((x, y), w) in from.iter().zip(to).zip(weights) {
            covariance += (y - mean_to) * (x - mean_from).transpose() * *w / n;
            variance += (x - mean_from).norm_squared() * w / n;
        }
        let svd = covariance.svd(true, true);
        let (u, v_t) = (svd.u?, svd.v_t?);
        // nalgebra sorts singular values in descending order; the second decides whether the points span a plane.
        if svd.singular_values[1].is_nan() || svd.singular_values[1] <= 1e-12 * svd.singular_values[0] {
            return None;
        }
        let mut sign = Matrix3::identity();
        sign[(2, 2)] = (u * v_t).determinant().signum();
        let rotation = u * sign * v_t;
        let scale = if with_scale { (Matrix3::from_diagonal(&svd.singular_values) * sign).trace() / variance } else { 1.0 };
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        Some(Self { scale, rotation, translation: mean_to - scale * (rotation * mean_from) })
    }

    /// `x_in_b` of `x_in_a`, for nalgebra points.
    #[must_use]
    pub fn apply_point(&self, x_in_a: &Point3<f64>) -> Point3<f64> {
        self.apply(&x_in_a.coords).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rigid() -> impl Strategy<Value = Rigid3> {
        (prop::array::uniform3(-3.0..3.0f64), prop::array::uniform3(-10.0..10.0f64))
            .prop_map(|(w, t)| Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::from(w)), Vector3::from(t)))
    }

    fn close(a: &Rigid3, b: &Rigid3) -> bool {
        a.rotation.angle_to(&b.rotation) < 1e-7 && (a.translation - b.translation).norm() < 1e-11
    }

    proptest! {
        #[test]
        fn group_laws(a in rigid(), b in rigid(), c in rigid()) {
            prop_assert!(close(&((a * b) * c), &(a * (b * c))));
            prop_assert!(close(&(a * a.inverse()), &Rigid3::identity()));
            prop_assert!(close(&(a * Rigid3::identity()), &a));
        }

        #[test]
        fn centre_maps_to_the_origin(a in rigid()) {
            prop_assert!(a.apply(&a.centre()).norm() < 1e-12 * (1.0 + a.translation.norm()) * 10.0);
        }

        #[test]
        fn alignment_recovers_the_similarity(a in rigid(), s in 0.1..10.0f64, xs in prop::collection::vec(prop::array::uniform3(-5.0..5.0f64), 4..9)) {
            let truth = Similarity3 { scale: s, rotation: a.rotation, translation: a.translation };
            let xs: Vec<_> = xs.into_iter().map(Vector3::from).collect();
            let ys: Vec<_> = xs.iter().map(|x| truth.apply(x)).collect();
            if let Some(found) = Similarity3::align(&xs, &ys, true) {
                for x in &xs {
                    prop_assert!((found.apply(x) - truth.apply(x)).norm() < 1e-6 * s);
                }
            }
        }

        #[test]
        fn change_of_world_scales_camera_coordinates(cam in rigid(), w in rigid(), s in 0.1..10.0f64, x in prop::array::uniform3(-5.0..5.0f64)) {
            let world = Similarity3 { scale: s, rotation: w.rotation, translation: w.translation };
            let x = Vector3::from(x);
            let moved = cam.in_new_world(&world).apply(&world.apply(&x));
            prop_assert!((moved - s * cam.apply(&x)).norm() < 1e-9 * (1.0 + s));
        }
    }

    #[test]
    fn points_on_a_line_have_no_alignment() {
        let line: Vec<_> = (0..5).map(|i| Vector3::new(f64::from(i), 2.0 * f64::from(i), 0.0)).collect();
        assert!(Similarity3::align(&line, &line, true).is_none());
    }
}
