//! Geometrically verified matches between two images.

use crate::{ImageId, KeypointIndex};
use nalgebra::Matrix3;

/// Which two-view model explains a pair best.
#[derive(Clone, Debug, PartialEq)]
pub enum PairConfiguration {
    /// Both interior orientations are known: essential matrix, `y2^T E y1 = 0` in normalised undistorted coordinates.
    Calibrated {
        /// E.
        essential: Matrix3<f64>,
    },
    /// Fundamental matrix, `x2^T F x1 = 0` in pixels.
    Uncalibrated {
        /// F.
        fundamental: Matrix3<f64>,
    },
    /// A plane or a pure rotation explains the matches as well: `x2 ~ H x1` in pixels. No relative position is trusted.
    PlanarOrPanoramic {
        /// H.
        homography: Matrix3<f64>,
    },
}

/// Two images and the matches between them that agree with one two-view model.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifiedPair {
    /// The images, the smaller id first.
    pub images: (ImageId, ImageId),
    /// Inlier matches: keypoint in the first image, keypoint in the second; sorted, one to one.
    pub matches: Vec<(KeypointIndex, KeypointIndex)>,
    /// The model that the inliers agree with.
    pub configuration: PairConfiguration,
    /// Number of inliers of a homography estimated on the same tentative matches (degeneracy measure).
    pub homography_inliers: usize,
}
