//! How an orientation is made.

use solve::adjust::Loss;

/// Which way a model is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mapper {
    /// All at once where there are many frames and the interior orientation is known, else one by one; what fails falls back to the latter.
    #[default]
    Auto,
    /// All frames at once.
    Global,
    /// One frame after the other.
    Incremental,
}

/// Options of [`crate::orient`]. The defaults suit photographs of 1 to 20 megapixels.
#[derive(Clone, Debug, PartialEq)]
pub struct OrientOptions {
    /// Which way a model is made.
    pub mapper: Mapper,
    /// Inliers that an initial pair needs.
    pub initial_min_inliers: usize,
    /// Median intersection angle that an initial pair should have, degrees; lowered step by step when no pair has it.
    pub initial_min_angle_deg: f64,
    /// Largest residual of a keypoint in RANSAC for the pose of a new frame, pixels.
    pub register_max_error_px: f64,
    /// Inliers that a new frame needs.
    pub register_min_inliers: usize,
    /// Share of inliers that a new frame needs.
    pub register_min_inlier_share: f64,
    /// Largest reprojection error of an observation that is kept, pixels, and twice as much while the model grows; of a keypoint with a
    /// standard deviation below a pixel, this many standard deviations.
    pub max_error_px: f64,
    /// Smallest intersection angle of a point that is kept, degrees.
    pub min_angle_deg: f64,
    /// Loss of the last adjustments.
    pub loss: Loss,
    /// Frees the principal point too (where the interior orientation is refined).
    pub refine_principal_point: bool,
    /// Images of a camera that must be oriented before its interior orientation is refined.
    pub refine_interior_from: usize,
    /// A model of fewer frames than this is not worth a second one.
    pub min_model_frames: usize,
    /// Seed of every random choice.
    pub seed: u64,
}

impl OrientOptions {
    /// Options while frames are still missing: interior orientation and poses are not what they will be.
    pub(crate) fn growing(&self) -> Self {
        Self { max_error_px: 2.0 * self.max_error_px, ..self.clone() }
    }
}

impl Default for OrientOptions {
    fn default() -> Self {
        Self {
            mapper: Mapper::Auto,
            initial_min_inliers: 100,
            initial_min_angle_deg: 16.0,
            register_max_error_px: 12.0,
            register_min_inliers: 30,
            register_min_inlier_share: 0.25,
            max_error_px: 2.0,
            min_angle_deg: 1.5,
            loss: Loss::Trivial,
            refine_principal_point: false,
            refine_interior_from: 3,
            min_model_frames: 3,
            seed: 0,
        }
    }
}
