//! Settings of the adjustment.

use super::error::AdjustError;
pub use crate::robust::Loss;

/// Settings of [`crate::adjust::adjust`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdjustOptions {
    /// Loss of the image observations. Lengths, control points and priors always enter squared: an error in one shall show in
    /// its residual, not vanish.
    pub loss: Loss,
    /// Loss of each position, direction and heading, in units of their standard deviations: instruments fail. Default none.
    pub sensor_loss: Loss,
    /// The largest number of steps tried, rejected ones included. Default 50.
    pub max_iterations: usize,
    /// Stop when a step changes the cost by less than this share of it. Default 1e-6; with 0 only the other tolerances count.
    pub function_tolerance: f64,
    /// Stop when no component of the gradient is larger. Default 1e-10.
    pub gradient_tolerance: f64,
    /// Stop when a step would move no parameter by more than this share: points and translations of the larger of their norm and the size
    /// of the world (the root mean square of the points' norms), camera parameters of the larger of their value and 1, rotations in
    /// radians. Such a step is not taken: the adjustment of an adjusted problem leaves it as it is. Default 1e-8.
    pub parameter_tolerance: f64,
    /// Radius of the first trust region: the first damping is the diagonal of the normal equations divided by it.
    /// Default 1e4: nearly a Gauss-Newton step. Smaller values are for poor start values.
    pub initial_radius: f64,
}

impl Default for AdjustOptions {
    fn default() -> Self {
        Self {
            loss: Loss::Trivial,
            sensor_loss: Loss::Trivial,
            max_iterations: 50,
            function_tolerance: 1e-6,
            gradient_tolerance: 1e-10,
            parameter_tolerance: 1e-8,
            initial_radius: 1e4,
        }
    }
}

impl AdjustOptions {
    /// Refuses tolerances below zero, empty trust regions, loss scales that are not positive, and NaN.
    pub(super) fn validate(&self) -> Result<(), AdjustError> {
        let at_least_zero = [
            ("function_tolerance", self.function_tolerance),
            ("gradient_tolerance", self.gradient_tolerance),
            ("parameter_tolerance", self.parameter_tolerance),
        ];
        for (name, value) in at_least_zero {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(AdjustError::BadOption { name, value });
            }
        }
        let scale = |loss: &Loss| loss.scale_px().unwrap_or(1.0);
        let positive = [
            ("initial_radius", self.initial_radius),
            ("loss.scale_px", scale(&self.loss)),
            ("sensor_loss.scale_px", scale(&self.sensor_loss)),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(AdjustError::BadOption { name, value });
            }
        }
        Ok(())
    }
}
