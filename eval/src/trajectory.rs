//! How far found camera positions are from true ones.

use crate::EvalError;
use crate::statistics::percentile;
use nalgebra::Vector3;
use scene::Similarity3;
use serde::Serialize;

/// What the found positions may be moved by before they are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// Nothing: both are in the same frame.
    None,
    /// A rigid motion: errors of scale count.
    Se3,
    /// A similarity: the scale is free.
    Sim3,
}

/// Absolute trajectory error (Sturm et al., *A benchmark for the evaluation of RGB-D SLAM systems*, IROS 2012).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrajectoryError {
    /// Square root of the mean squared distance of aligned to true positions, metres.
    pub rmse_m: f64,
    /// Median distance, metres.
    pub median_m: f64,
    /// Largest distance, metres.
    pub max_m: f64,
    /// True length over found length, as the best similarity has it, whatever the alignment: 1 for a metric result.
    pub scale: f64,
    /// Length of the true path, position to position, metres.
    pub path_m: f64,
}

/// Compares `found[i]` with `truth[i]` after the alignment that minimises the squared distances (Umeyama, PAMI 1991).
///
/// # Errors
/// [`EvalError::BadCount`] for lists of different lengths and for fewer than three positions (one without alignment);
/// [`EvalError::BadPosition`] for positions that are not finite; [`EvalError::NoAlignment`] where the positions lie on one
/// line, about which the rotation is free.
pub fn absolute_error(found: &[Vector3<f64>], truth: &[Vector3<f64>], alignment: Alignment) -> Result<TrajectoryError, EvalError> {
    let needed = if alignment == Alignment::None { 1 } else { 3 };
    if found.len() != truth.len() || found.len() < needed {
        return Err(EvalError::BadCount { found: found.len(), truth: truth.len(), needed });
    }
    for (what, positions) in [("found position", found), ("true position", truth)] {
        if let Some(index) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(EvalError::BadPosition { what, index, position: positions[index].into() });
        }
    }
    let similarity = Similarity3::align(found, truth, true);
    let aligned = match alignment {
        Alignment::None => Some(Similarity3::from_scale(1.0)),
        Alignment::Se3 => Similarity3::align(found, truth, false),
        Alignment::Sim3 => similarity,
    };
    let aligned = aligned.ok_or(EvalError::NoAlignment)?;
    let mut errors: Vec<f64> = found.iter().zip(truth).map(|(f, t)| (aligned.apply(f) - t).norm()).collect();
    let squares: f64 = errors.iter().map(|e| e * e).sum();
    errors.sort_unstable_by(f64::total_cmp);
    Ok(TrajectoryError {
        rmse_m: (squares / errors.len() as f64).sqrt(),
        median_m: percentile(&errors, 50.0),
        max_m: percentile(&errors, 100.0),
        scale: similarity.map_or(1.0, |s| s.scale),
        path_m: truth.windows(2).map(|w| (w[1] - w[0]).norm()).sum(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn path() -> Vec<Vector3<f64>> {
        (0..20).map(|i| f64::from(i) * 0.3).map(|t| Vector3::new(t.cos(), t.sin(), 0.1 * t)).collect()
    }

    #[test]
    fn a_moved_and_scaled_path_has_no_error_but_its_scale() {
        let truth = path();
        let motion = Similarity3 {
            scale: 0.5,
            rotation: UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0),
            translation: Vector3::new(4.0, 5.0, 6.0),
        };
        let found: Vec<_> = truth.iter().map(|p| motion.apply(p)).collect();
        let sim3 = absolute_error(&found, &truth, Alignment::Sim3).expect("a path");
        assert!(sim3.max_m < 1e-12 && (sim3.scale - 2.0).abs() < 1e-12, "{sim3:?}");
        let chord: f64 = truth.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        assert_eq!(sim3.path_m, chord);
        // A rigid motion leaves half of each distance to the mean: the RMS of these.
        let se3 = absolute_error(&found, &truth, Alignment::Se3).expect("a path");
        let mean = truth.iter().sum::<Vector3<f64>>() / truth.len() as f64;
        let expected = (truth.iter().map(|p| (p - mean).norm_squared() / 4.0).sum::<f64>() / truth.len() as f64).sqrt();
        assert!((se3.rmse_m - expected).abs() < 1e-12, "{} against {expected}", se3.rmse_m);
    }

    #[test]
    fn without_alignment_an_offset_is_the_error() {
        let truth = path();
        let found: Vec<_> = truth.iter().map(|p| p + Vector3::new(0.0, 3.0, 4.0)).collect();
        let error = absolute_error(&found, &truth, Alignment::None).expect("a path");
        for value in [error.rmse_m, error.median_m, error.max_m] {
            assert!((value - 5.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_cannot_be_aligned_is_an_error() {
        let truth = path();
        let line: Vec<_> = (0..20).map(|i| Vector3::new(f64::from(i), 0.0, 0.0)).collect();
        assert_eq!(absolute_error(&line, &line, Alignment::Se3), Err(EvalError::NoAlignment));
        assert!(matches!(absolute_error(&truth[..3], &truth, Alignment::Se3), Err(EvalError::BadCount { .. })));
        assert!(matches!(absolute_error(&truth[..2], &truth[..2], Alignment::Se3), Err(EvalError::BadCount { .. })));
        let mut bad = truth.clone();
        bad[3].y = f64::NAN;
        assert!(matches!(absolute_error(&bad, &truth, Alignment::Sim3), Err(EvalError::BadPosition { index: 3, .. })));
    }
}
