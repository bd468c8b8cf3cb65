//! Errors of found poses relative to each other: drift, and the share of camera pairs that agree.

use crate::EvalError;
use nalgebra::Vector3;
use scene::Rigid3;
use serde::Serialize;
use std::f64::consts::PI;

/// Relative pose error (Sturm et al., *A benchmark for the evaluation of RGB-D SLAM systems*, IROS 2012).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RelativePoseError {
    /// Steps between the poses of a pair.
    pub step: usize,
    /// Pairs.
    pub count: usize,
    /// Root of the mean squared translation of the error, metres.
    pub translation_rmse_m: f64,
    /// Root of the mean squared angle of the error, degrees.
    pub rotation_rmse_deg: f64,
}

/// Compares the motion from pose i to pose i + `step` with the true one: with world_from_camera Q (true) and P (found),
/// E_i = (Q_i^-1 Q_(i+step))^-1 (P_i^-1 P_(i+step)). Poses are cam_from_world, in the order of time.
///
/// # Errors
/// [`EvalError::BadCount`] for lists of different lengths, a step of 0, or not more poses than the step.
pub fn relative_error(found: &[Rigid3], truth: &[Rigid3], step: usize) -> Result<RelativePoseError, EvalError> {
    if found.len() != truth.len() || step == 0 || found.len() <= step {
        return Err(EvalError::BadCount { found: found.len(), truth: truth.len(), needed: step.max(1) + 1 });
    }
    let motion = |poses: &[Rigid3], i: usize| poses[i] * poses[i + step].inverse();
    let errors: Vec<Rigid3> = (0..found.len() - step).map(|i| motion(truth, i).inverse() * motion(found, i)).collect();
    let n = errors.len() as f64;
    let rms = |f: &dyn Fn(&Rigid3) -> f64| (errors.iter().map(|e| f(e).powi(2)).sum::<f64>() / n).sqrt();
    Ok(RelativePoseError {
        step,
        count: errors.len(),
        translation_rmse_m: rms(&|e| e.translation.norm()),
        rotation_rmse_deg: rms(&|e| e.rotation.angle().to_degrees()),
    })
}

/// Angular error of every pair of images, degrees, as COLMAP's reconstruction benchmark has it: the larger of the angle
/// between the relative rotations and the angle between the directions of the relative translations; 180 where an image of
/// the pair was not oriented; the direction does not count where the true projection centres are closer than
/// `min_baseline_m`. No alignment is needed.
///
/// # Errors
/// [`EvalError::BadCount`] for lists of different lengths and for fewer than two poses.
pub fn pair_errors(found: &[Option<Rigid3>], truth: &[Rigid3], min_baseline_m: f64) -> Result<Vec<f64>, EvalError> {
    if found.len() != truth.len() || truth.len() < 2 {
        return Err(EvalError::BadCount { found: found.len(), truth: truth.len(), needed: 2 });
    }
    let mut errors = Vec::with_capacity(truth.len() * (truth.len() - 1) / 2);
    for j in 1..truth.len() {
        for i in 0..j {
            let (Some(a), Some(b)) = (found[i], found[j]) else {
                errors.push(180.0);
                continue;
            };
            let (f, t) = (a * b.inverse(), truth[i] * truth[j].inverse());
            let rotation = f.rotation.angle_to(&t.rotation);
            let direction = if t.translation.norm() < min_baseline_m { 0.0 } else { between(&f.translation, &t.translation) };
            errors.push(rotation.max(direction).to_degrees());
        }
    }
    Ok(errors)
}

/// Angle between two directions; a vector without length has the largest error.
fn between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    if a.norm() > 0.0 && b.norm() > 0.0 { a.angle(b) } else { PI }
}

/// Area under the curve of recall over error from 0 to each threshold, divided by the threshold, from 0 to 1. COLMAP's rule:
/// the n sorted errors carry the recalls 1/n, 2/n, ... 1; the curve runs straight from (0, 0) through these points to the
/// last one that is not beyond the threshold, and level from there.
///
/// # Errors
/// [`EvalError::BadCount`] without errors, [`EvalError::BadOption`] for thresholds that are not positive.
pub fn area_under_curve(errors: &[f64], thresholds: &[f64]) -> Result<Vec<f64>, EvalError> {
    if errors.is_empty() {
        return Err(EvalError::BadCount { found: 0, truth: 0, needed: 1 });
    }
    let mut sorted = errors.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let one = |&threshold: &f64| {
        if !(threshold > 0.0 && threshold.is_finite()) {
            return Err(EvalError::BadOption { name: "threshold", value: threshold });
        }
        let (mut area, mut before) = (0.0, (0.0, 0.0));
        for (i, &error) in sorted.iter().enumerate().take_while(|(_, e)| **e <= threshold) {
            let recall = (i + 1) as f64 / n;
            area += (error - before.0) * (recall + before.1) / 2.0;
            before = (error, recall);
        }
        Ok((area + (threshold - before.0) * before.1) / threshold)
    };
    thresholds.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn circle(n: usize) -> Vec<Rigid3> {
        (0..n)
            .map(|i| 0.2 * i as f64)
            .map(|t| Rigid3::new(UnitQuaternion::from_euler_angles(0.1, t, 0.3), Vector3::new(t.sin(), 0.1 * t, 4.0)))
            .collect()
    }

    #[test]
    fn a_moved_path_has_no_relative_error_and_a_constant_drift_is_found() {
        let truth = circle(12);
        let world = Rigid3::new(UnitQuaternion::from_euler_angles(1.0, -0.4, 0.2), Vector3::new(5.0, 6.0, 7.0));
        let moved: Vec<_> = truth.iter().map(|p| *p * world).collect();
        let none = relative_error(&moved, &truth, 3).expect("poses");
        assert!(none.count == 9 && none.translation_rmse_m < 1e-12 && none.rotation_rmse_deg < 1e-5, "{none:?}");
        // Every step is 1 cm too long along x of the camera and turns 0.5 degrees too far.
        let drift = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::z() * 0.5f64.to_radians()), Vector3::new(0.01, 0.0, 0.0));
        let mut found = vec![truth[0]];
        for i in 1..truth.len() {
            let step = truth[i - 1] * truth[i].inverse() * drift;
            found.push(step.inverse() * found[i - 1]);
        }
        let error = relative_error(&found, &truth, 1).expect("poses");
        assert!((error.translation_rmse_m - 0.01).abs() < 1e-12 && (error.rotation_rmse_deg - 0.5).abs() < 1e-9, "{error:?}");
        assert!(relative_error(&found, &truth, 0).is_err() && relative_error(&found, &truth, 12).is_err());
    }

    #[test]
    fn pairs_need_no_alignment_and_missing_images_count() {
        let truth = circle(4);
        let mut found: Vec<_> = truth.iter().map(|p| Some(*p)).collect();
        assert!(pair_errors(&found, &truth, 0.0).expect("poses").iter().all(|e| *e < 1e-5));
        found[3] = None;
        let errors = pair_errors(&found, &truth, 0.0).expect("poses");
        assert_eq!(errors.iter().filter(|e| **e == 180.0).count(), 3);
        // One camera turned by 2 degrees about its own centre: the rotations of its three pairs are off by 2 degrees.
        let turn = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::y() * 2f64.to_radians()), Vector3::zeros());
        found[3] = Some(turn * truth[3]);
        let errors = pair_errors(&found, &truth, f64::INFINITY).expect("poses");
        assert_eq!(errors.iter().filter(|e| (**e - 2.0).abs() < 1e-5).count(), 3, "{errors:?}");
    }

    #[test]
    fn area_is_that_of_the_trapezoids() {
        // Recalls 0.25 at 1, 0.5 at 2, 0.75 at 4; the fourth pair failed.
        let found = area_under_curve(&[180.0, 4.0, 2.0, 1.0], &[1.0, 3.0, 5.0]).expect("errors");
        let expected = [0.125, (0.125 + 0.375 + 0.5) / 3.0, (0.125 + 0.375 + 1.25 + 0.75) / 5.0];
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-15, "{found:?}");
        }
        assert_eq!(area_under_curve(&[0.0, 0.0], &[0.5, 10.0]), Ok(vec![1.0, 1.0]));
        assert!(area_under_curve(&[], &[1.0]).is_err() && area_under_curve(&[1.0], &[0.0]).is_err());
    }
}
