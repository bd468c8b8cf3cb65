//! Robust losses.

/// How the square of a residual enters the cost.
///
/// With s the squared norm of a residual divided by its sigma, the cost is the sum of rho(s) / 2. All scales c are
/// given in pixels for an observation of sigma 1 px, and grow with sigma: they are multiples of sigma.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// rho = s: least squares.
    #[default]
    Trivial,
    /// rho = 2 c2 (sqrt(1 + s / c2) - 1): grows like the norm.
    SoftL1 {
        /// c.
        scale_px: f64,
    },
    /// rho = c2 log(1 + s / c2): grows like the logarithm; distant outliers lose their influence.
    Cauchy {
        /// c.
        scale_px: f64,
    },
    /// rho = s up to c2, 2 c sqrt s - c2 beyond: the norm outside a ball.
    Huber {
        /// c.
        scale_px: f64,
    },
}

impl Loss {
    /// rho(s) and its derivative, for s at least 0. The derivative lies in (0, 1] and falls with s.
    #[must_use]
    pub fn evaluate(&self, s: f64) -> (f64, f64) {
        match *self {
            Self::Trivial => (s, 1.0),
            Self::SoftL1 { scale_px } => {
                let c2 = scale_px * scale_px;
                let root = (1.0 + s / c2).sqrt();
                // 2 c2 (root - 1) without the cancellation.
                (2.0 * s / (root + 1.0), 1.0 / root)
            }
            Self::Cauchy { scale_px } => {
                let c2 = scale_px * scale_px;
                (c2 * (s / c2).ln_1p(), 1.0 / (1.0 + s / c2))
            }
            Self::Huber { scale_px } => {
                let c2 = scale_px * scale_px;
                if s <= c2 {
                    (s, 1.0)
                } else {
                    let root = s.sqrt();
                    (2.0 * scale_px * root - c2, scale_px / root)
                }
            }
        }
    }

    /// The scale, or `None` for [`Loss::Trivial`].
    #[must_use]
    pub fn scale_px(&self) -> Option<f64> {
        match *self {
            Self::Trivial => None,
            Self::SoftL1 { scale_px } | Self::Cauchy { scale_px } | Self::Huber { scale_px } => Some(scale_px),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn losses_are_concave_and_below_the_square(s in 0.0..1e4f64, scale_px in 0.1..10.0f64) {
            for loss in [Loss::Trivial, Loss::SoftL1 { scale_px }, Loss::Cauchy { scale_px }, Loss::Huber { scale_px }] {
                let (rho, slope) = loss.evaluate(s);
                prop_assert!(rho <= s * (1.0 + 1e-12) && slope > 0.0 && slope <= 1.0);
                prop_assert!(loss.evaluate(s + 1.0).1 <= slope);
                let h = 1e-5 * (1.0 + s);
                let (below, above) = ((s - h).max(0.0), s + h);
                let difference = (loss.evaluate(above).0 - loss.evaluate(below).0) / (above - below);
                prop_assert!((difference - loss.evaluate(0.5 * (above + below)).1).abs() < 1e-4, "{loss:?} at {s}");
            }
        }

        #[test]
        fn small_residuals_feel_no_loss(s in 0.0..1e-9f64) {
            for loss in [Loss::SoftL1 { scale_px: 1.0 }, Loss::Cauchy { scale_px: 1.0 }, Loss::Huber { scale_px: 1.0 }] {
                prop_assert!((loss.evaluate(s).0 - s).abs() <= 1e-9 * s);
            }
        }
    }
}
