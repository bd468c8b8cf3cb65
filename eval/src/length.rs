//! Known lengths against found ones: scale bars, baselines, check distances.

use crate::EvalError;
use serde::Serialize;

/// One length that is known and was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LengthCheck {
    /// The calibrated length, metres.
    pub given_m: f64,
    /// The length in the model, metres.
    pub found_m: f64,
}

impl LengthCheck {
    /// Length measurement error, found minus given, metres (VDI/VDE 2634 part 1).
    #[must_use]
    pub fn error_m(&self) -> f64 {
        self.found_m - self.given_m
    }
}

/// The length measurement errors of several lengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LengthSummary {
    /// How many lengths.
    pub count: usize,
    /// Mean error, metres: a wrong scale shows here.
    pub mean_m: f64,
    /// Square root of the mean squared error, metres.
    pub rms_m: f64,
    /// Largest absolute error, metres.
    pub max_m: f64,
    /// Sum of the found over the sum of the given lengths.
    pub scale: f64,
}

/// Summarises length checks.
///
/// # Errors
/// [`EvalError::BadCount`] without any, [`EvalError::BadOption`] where a given length is not positive or a found one is not
/// finite.
pub fn summarise_lengths(checks: &[LengthCheck]) -> Result<LengthSummary, EvalError> {
    if checks.is_empty() {
        return Err(EvalError::BadCount { found: 0, truth: 0, needed: 1 });
    }
    for check in checks {
        if !(check.given_m > 0.0 && check.given_m.is_finite()) {
            return Err(EvalError::BadOption { name: "given_m", value: check.given_m });
        }
        if !check.found_m.is_finite() {
            return Err(EvalError::BadOption { name: "found_m", value: check.found_m });
        }
    }
    let n = checks.len() as f64;
    let errors = || checks.iter().map(LengthCheck::error_m);
    let total = |f: fn(&LengthCheck) -> f64| checks.iter().map(f).sum::<f64>();
    Ok(LengthSummary {
        count: checks.len(),
        mean_m: errors().sum::<f64>() / n,
        rms_m: (errors().map(|e| e * e).sum::<f64>() / n).sqrt(),
        max_m: errors().map(f64::abs).fold(0.0, f64::max),
        scale: total(|c| c.found_m) / total(|c| c.given_m),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_two_lengths() {
        let checks = [LengthCheck { given_m: 1.0, found_m: 1.003 }, LengthCheck { given_m: 2.0, found_m: 1.996 }];
        let summary = summarise_lengths(&checks).expect("two lengths");
        assert_eq!(summary.count, 2);
        for (found, expected) in
            [(summary.mean_m, -0.0005), (summary.rms_m, 12.5e-6f64.sqrt()), (summary.max_m, 0.004), (summary.scale, 2.999 / 3.0)]
        {
            assert!((found - expected).abs() < 1e-12, "{found} against {expected}");
        }
        assert!(summarise_lengths(&[]).is_err());
        assert!(summarise_lengths(&[LengthCheck { given_m: 0.0, found_m: 1.0 }]).is_err());
        assert!(summarise_lengths(&[LengthCheck { given_m: 1.0, found_m: f64::NAN }]).is_err());
    }
}
