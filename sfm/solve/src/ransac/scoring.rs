//! From squared errors to the cost of a model.

/// What one correspondence adds to the cost of a model.
pub trait Scoring {
    /// Cost of a squared error, between 0 and a bound; rising. An error that is NaN or infinite costs as much as an outlier.
    fn cost(&self, squared_error: f64) -> f64;
}

/// MSAC: the squared error up to a limit, the limit beyond (Torr & Zisserman, *MLESAC*, CVIU 2000).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Msac {
    /// Square of the largest error of an inlier.
    pub max_squared_error: f64,
}

impl Scoring for Msac {
    #[inline]
    fn cost(&self, squared_error: f64) -> f64 {
        // Written so that NaN takes the second branch.
        if squared_error < self.max_squared_error { squared_error } else { self.max_squared_error }
    }
}

/// The original count of outliers (Fischler & Bolles, CACM 1981).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InlierCount {
    /// Square of the largest error of an inlier.
    pub max_squared_error: f64,
}

impl Scoring for InlierCount {
    #[inline]
    fn cost(&self, squared_error: f64) -> f64 {
        if squared_error < self.max_squared_error { 0.0 } else { 1.0 }
    }
}
