//! Options of the extraction.

use crate::FeatureError;

/// Options of [`extract`](crate::extract). The defaults follow COLMAP and VLFeat, but for the doubling of the image.
#[derive(Clone, Debug, PartialEq)]
pub struct SiftOptions {
    /// Largest number of features (a keypoint with two orientations is two features). COLMAP's limit is softer: it stops after the level
    /// that passes it, and finds 11,000 to 12,000 on 6 megapixels where it says 8,192.
    pub max_features: usize,
    /// Whether detection starts on an image of twice the size: more and finer keypoints for four times the work.
    pub double_image: bool,
    /// Smallest magnitude of the difference of Gaussians at a keypoint, for grey in 0..=1.
    pub contrast_threshold: f32,
    /// Where fewer than this many keypoints pass `contrast_threshold`, the strongest of the weaker ones fill up to it: murky water leaves
    /// little contrast, and what is faint there is still well above the noise.
    pub min_keypoints: usize,
    /// Smallest contrast of those weaker keypoints, as a fraction of `contrast_threshold`; 1 switches them off.
    pub low_contrast_fraction: f32,
    /// Largest ratio of the principal curvatures at a keypoint: rejects edges, along which the position is uncertain.
    pub edge_threshold: f32,
    /// Largest number of orientations that one keypoint is described with.
    pub max_orientations: usize,
    /// Number of scales at which extrema are looked for in each octave.
    pub octave_layers: usize,
    /// Standard deviation of the Gaussian of the lowest level, in pixels of the first octave.
    pub first_sigma_px: f32,
    /// Standard deviation of the blur that the image is assumed to have, in its own pixels.
    pub camera_sigma_px: f32,
}

impl Default for SiftOptions {
    fn default() -> Self {
        Self {
            max_features: 8192,
            double_image: false,
            contrast_threshold: 0.02 / 3.0,
            min_keypoints: 4096,
            low_contrast_fraction: 0.25,
            edge_threshold: 10.0,
            max_orientations: 2,
            octave_layers: 3,
            first_sigma_px: 1.6,
            camera_sigma_px: 0.5,
        }
    }
}

impl SiftOptions {
    /// Magnitude below which nothing is looked at.
    pub(super) fn lowest_contrast(&self) -> f32 {
        self.contrast_threshold * self.low_contrast_fraction
    }

    /// Refuses values with which nothing could be computed.
    pub(super) fn check(&self) -> Result<(), FeatureError> {
        let positive = |option, value: f32| match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => Err(FeatureError::Option { option, value: value.to_string(), expected: "a positive number" }),
        };
        positive("contrast_threshold", self.contrast_threshold)?;
        positive("first_sigma_px", self.first_sigma_px)?;
        if !(self.low_contrast_fraction > 0.0 && self.low_contrast_fraction <= 1.0) {
            let value = self.low_contrast_fraction.to_string();
            return Err(FeatureError::Option { option: "low_contrast_fraction", value, expected: "above 0 and at most 1" });
        }
        if !(self.edge_threshold >= 1.0 && self.edge_threshold.is_finite()) {
            let value = self.edge_threshold.to_string();
            return Err(FeatureError::Option { option: "edge_threshold", value, expected: "at least 1" });
        }
        if !(self.camera_sigma_px >= 0.0 && self.camera_sigma_px.is_finite()) {
            let value = self.camera_sigma_px.to_string();
            return Err(FeatureError::Option { option: "camera_sigma_px", value, expected: "0 or more" });
        }
        if !(0.5..=8.0).contains(&self.first_sigma_px) {
            let value = self.first_sigma_px.to_string();
            return Err(FeatureError::Option { option: "first_sigma_px", value, expected: "between 0.5 and 8" });
        }
        if !(1..=16).contains(&self.octave_layers) {
            let value = self.octave_layers.to_string();
            return Err(FeatureError::Option { option: "octave_layers", value, expected: "between 1 and 16" });
        }
        Ok(())
    }
}
