//! What the adjustment reports.

/// Why the adjustment stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// The cost no longer changed.
    FunctionTolerance,
    /// The gradient vanished.
    GradientTolerance,
    /// The parameters no longer changed.
    ParameterTolerance,
    /// The largest number of iterations was reached.
    MaxIterations,
    /// No step, however short, lowered the cost.
    NoProgress,
    /// No block is free, or no residual depends on one.
    NothingToAdjust,
}

impl Termination {
    /// Whether a minimum was reached (or there was nothing to do), as opposed to running out of iterations or of step length.
    #[must_use]
    pub fn is_converged(self) -> bool {
        !matches!(self, Self::MaxIterations | Self::NoProgress)
    }
}

/// How many parameters were adjusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ParameterCounts {
    /// Free frames that a residual depends on, 6 parameters each.
    pub frames: usize,
    /// Free sensors that a residual depends on, 6 parameters each.
    pub sensors: usize,
    /// Free camera parameters.
    pub camera_parameters: usize,
    /// Free points that a residual depends on, 3 parameters each.
    pub points: usize,
    /// Their number of parameters.
    pub total: usize,
}

/// Distribution of the reprojection errors of the observations that took part, after the adjustment, in pixels (not
/// divided by sigma).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReprojectionErrors {
    /// Root of the mean square.
    pub rms_px: f64,
    /// Mean.
    pub mean_px: f64,
    /// Median.
    pub median_px: f64,
    /// Quantile 0.9.
    pub q90_px: f64,
    /// Quantile 0.99.
    pub q99_px: f64,
    /// The largest.
    pub max_px: f64,
}

impl ReprojectionErrors {
    /// Of the errors, whose order it changes; all zero when there are none. A quantile q is the element at (n - 1) q,
    /// rounded down, of the sorted list.
    pub(super) fn of(errors: &mut [f64]) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        let n = errors.len();
        let square: f64 = errors.iter().map(|e| e * e).sum();
        let sum: f64 = errors.iter().sum();
        let mut quantile = |q: f64| *errors.select_nth_unstable_by(((n - 1) as f64 * q) as usize, f64::total_cmp).1;
        Self {
            rms_px: (square / n as f64).sqrt(),
            mean_px: sum / n as f64,
            median_px: quantile(0.5),
            q90_px: quantile(0.9),
            q99_px: quantile(0.99),
            max_px: quantile(1.0),
        }
    }
}

/// A measured length after the adjustment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LengthResidual {
    /// The measured length.
    pub given: f64,
    /// The length in the adjusted model.
    pub found: f64,
    /// Standard deviation of the measurement.
    pub sigma: f64,
    /// (found - given) / sigma.
    pub normalised_residual: f64,
}

/// What went in, what came out, and why the adjustment stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct AdjustSummary {
    /// Cost before: half the sum of the squared residuals, each divided by its sigma, robustified where a loss is set,
    /// of image observations, lengths and priors.
    pub initial_cost: f64,
    /// Cost after.
    pub final_cost: f64,
    /// Steps tried.
    pub iterations: usize,
    /// Steps that lowered the cost and were taken.
    pub steps_taken: usize,
    /// Why it stopped.
    pub termination: Termination,
    /// Largest absolute component of the gradient at the last linearisation.
    pub gradient_max: f64,
    /// Image observations that took part.
    pub observations: usize,
    /// Image observations left out because their point did not project at the start: behind the camera, or beyond the
    /// fold of its distortion.
    pub observations_left_out: usize,
    /// Scalar residuals: two an image observation, one a length, six a pose prior, one a parameter prior.
    pub residuals: usize,
    /// What was adjusted.
    pub free: ParameterCounts,
    /// Reprojection errors after.
    pub reprojection: ReprojectionErrors,
    /// Each baseline, in the order of the problem.
    pub baselines: Vec<LengthResidual>,
    /// Each scale bar, in the order of the problem.
    pub scale_bars: Vec<LengthResidual>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_elements_of_the_sorted_list() {
        let mut errors: Vec<f64> = (0..101).rev().map(f64::from).collect();
        let e = ReprojectionErrors::of(&mut errors);
        assert_eq!((e.median_px, e.q90_px, e.q99_px, e.max_px, e.mean_px), (50.0, 90.0, 99.0, 100.0, 50.0));
        // Sum of squares 0..100 = 338350.
        assert!((e.rms_px - (338_350.0f64 / 101.0).sqrt()).abs() < 1e-12);
        assert_eq!(ReprojectionErrors::of(&mut []), ReprojectionErrors::default());
    }
}
