//! The rotation group SO(3): exponential, logarithm and the Jacobian of the logarithm.
//!
//! Rotations are perturbed **from the left**: R becomes exp(w) R, with w in radians and in the axes of the target frame
//! (for `b_from_a`, those of b). Solà, Deray & Atchuthan, *A micro Lie theory for state estimation in robotics*, 2018.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Below this squared angle the series replace the closed forms: their next terms are under the rounding error.
const SMALL_ANGLE_SQUARED: f64 = 1e-8;

/// The cross product as a matrix: `skew(a) b = a x b`.
#[must_use]
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The rotation by |w| radians about w.
#[must_use]
pub fn so3_exp(w: &Vector3<f64>) -> UnitQuaternion<f64> {
    let squared = w.norm_squared();
    // sin(a/2) / a and cos(a/2).
    let (ratio, real) = if squared < SMALL_ANGLE_SQUARED {
        (0.5 - squared / 48.0, 1.0 - squared / 8.0)
    } else {
        let angle = squared.sqrt();
        let (sin, cos) = (0.5 * angle).sin_cos();
        (sin / angle, cos)
    };
    UnitQuaternion::new_normalize(Quaternion::from_parts(real, ratio * w))
}

/// The rotation vector, of length at most pi, of a rotation; the inverse of [`so3_exp`].
///
/// At pi exactly both signs of the axis are right; one of them is returned.
#[must_use]
pub fn so3_log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    // q and -q are one rotation: the one with positive real part has the smaller angle.
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    let (real, imag) = (sign * rotation.w, sign * rotation.imag());
    let sine = imag.norm();
    if sine * sine < SMALL_ANGLE_SQUARED {
        // 2 atan(s / c) / s = (2 / c) (1 - (s / c)^2 / 3 + ...).
        let tangent = sine / real;
        imag * (2.0 / real * (1.0 - tangent * tangent / 3.0))
    } else {
        imag * (2.0 * sine.atan2(real) / sine)
    }
}

/// d log(exp(e) R) / d e at e = 0, for R = exp(w): the inverse of the left Jacobian of SO(3) at w.
///
/// `I - [w]/2 + (1/a2 - (1 + cos a) / (2 a sin a)) [w]^2` with a = |w|. Valid for a < 2 pi; at a = 2 pi it does not exist.
#[must_use]
pub fn so3_left_jacobian_inverse(w: &Vector3<f64>) -> Matrix3<f64> {
    let squared = w.norm_squared();
    let coefficient = if squared < 1e-4 {
        1.0 / 12.0 + squared * (1.0 / 720.0 + squared / 30240.0)
    } else {
        let half = 0.5 * squared.sqrt();
        // (1 + cos a) / (a sin a) = cot(a/2) / a.
        (1.0 - half * half.cos() / half.sin()) / squared
    };
    let k = skew(w);
    Matrix3::identity() - 0.5 * k + coefficient * (k * k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        (prop::array::uniform3(-1.0..1.0f64), -9.0..0.0f64).prop_map(move |(v, exponent)| Vector3::from(v) * limit * 10f64.powf(exponent))
    }

    proptest! {
        #[test]
        fn log_inverts_exp(w in vector(1.8)) {
            // |w| <= 1.8 sqrt 3 < pi.
            prop_assert!((so3_log(&so3_exp(&w)) - w).norm() <= 1e-14 * (1.0 + w.norm()) + 4e-16);
        }

        #[test]
        fn exp_agrees_with_nalgebra(w in vector(10.0)) {
            prop_assert!(so3_exp(&w).angle_to(&UnitQuaternion::from_scaled_axis(w)) < 1e-7);
            let difference = so3_exp(&w).to_rotation_matrix().into_inner() - UnitQuaternion::from_scaled_axis(w).to_rotation_matrix().into_inner();
            prop_assert!(difference.norm() < 1e-14);
        }

        #[test]
        fn left_jacobian_inverse_equals_differences(w in vector(1.7)) {
            let jacobian = so3_left_jacobian_inverse(&w);
            let h = 1e-6;
            for k in 0..3 {
                let e = Vector3::ith(k, h);
                let d = (so3_log(&(so3_exp(&e) * so3_exp(&w))) - so3_log(&(so3_exp(&-e) * so3_exp(&w)))) / (2.0 * h);
                // Step error h^2, rounding 1e-16 / h, both magnified near pi.
                prop_assert!((d - jacobian.column(k)).norm() < 1e-7, "{w} {k}");
            }
        }

        #[test]
        fn skew_is_the_cross_product(a in vector(3.0), b in vector(3.0)) {
            prop_assert!((skew(&a) * b - a.cross(&b)).norm() <= 1e-15 * a.norm() * b.norm());
        }
    }

    #[test]
    fn half_turns_have_a_logarithm() {
        for axis in [Vector3::x(), Vector3::y(), -Vector3::z()] {
            let w = so3_log(&so3_exp(&(axis * std::f64::consts::PI)));
            assert!((w.norm() - std::f64::consts::PI).abs() < 1e-14);
            assert!(w.cross(&axis).norm() < 1e-14);
        }
    }
}
