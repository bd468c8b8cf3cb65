//! Options of the verification.

/// Options of [`verify_pair`](crate::verify_pair).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerifyOptions {
    /// Largest distance from the epipolar geometry (Sampson), pixels.
    pub max_error_px: f64,
    /// Fewest inliers of a pair.
    pub min_inliers: usize,
    /// Probability with which RANSAC is to draw a sample free of outliers, below 1.
    pub confidence: f64,
    /// Largest number of samples of one RANSAC.
    pub max_iterations: usize,
    /// A homography with at least this share of the inliers describes the pair too: it is planar or panoramic (COLMAP's rule).
    pub min_planar_share: f64,
    /// Known interior orientations are believed while the essential matrix has at least this share of the inliers of the fundamental matrix
    /// (COLMAP's rule).
    pub min_essential_share: f64,
    /// Largest displacement of a match that may belong to the vehicle or be written into the image, pixels.
    pub max_still_px: f64,
    /// Seed; each pair derives its own from its ids.
    pub seed: u64,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        Self {
            max_error_px: 4.0,
            min_inliers: 15,
            confidence: 0.9999,
            max_iterations: 3000,
            min_planar_share: 0.8,
            min_essential_share: 0.95,
            max_still_px: 1.5,
            seed: 0,
        }
    }
}
