//! The options of the stages.

use serde::Serialize;
use std::path::PathBuf;

/// How masks are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MaskStrategy {
    /// Every pixel takes part.
    None,
    /// Masks are read from files.
    Files,
    /// Masks are made by image processing.
    Ip,
}

impl MaskStrategy {
    /// The name in dive.toml and in `out/masks/<strategy>`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Files => "files",
            Self::Ip => "ip",
        }
    }
}

/// Options of the stage `mask`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskConfig {
    /// How masks are made.
    pub strategy: MaskStrategy,
    /// Options of the strategy `ip`.
    pub ip: IpConfig,
}

/// Which side of the threshold is structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Polarity {
    /// The side with more texture.
    Auto,
    /// Structure is darker than the water.
    Dark,
    /// Structure is brighter than the water.
    Bright,
}

/// Options of masks by image processing, see `masking::IpOptions`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IpConfig {
    /// Which side of the threshold is structure.
    pub polarity: Polarity,
    /// Channel: 0 red, 1 green, 2 blue.
    pub channel: u32,
    /// Long side of the reduced image, pixels; 0 works at full size.
    pub working_long_side_px: u32,
    /// Standard deviation of the low pass, pixels.
    pub blur_sigma_px: f64,
    /// Lower threshold of edges.
    pub canny_low: f64,
    /// Upper threshold of edges.
    pub canny_high: f64,
    /// Radius of the closing, share of the long side.
    pub closing_radius: f64,
    /// Smaller structures go, share of the image.
    pub min_structure_area: f64,
    /// Smaller holes are filled, share of the image.
    pub min_hole_area: f64,
    /// Texture that makes a part structure, share of the part.
    pub min_textured_share: f64,
    /// How far structure reaches from texture, share of the long side.
    pub reach: f64,
    /// Less texture is water alone, share of the image.
    pub min_texture: f64,
}

/// How distinctive points are found and matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureMethod {
    /// Scale-invariant features, matched by their descriptors.
    Sift,
    /// Harris corners, matched by the correlation of the grey values about them.
    HarrisNcc,
}

/// Options of the stage `features`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FeaturesConfig {
    /// How points are found.
    pub method: FeatureMethod,
    /// Most keypoints an image.
    pub max_keypoints: u32,
    /// Images of at most so many megapixels are doubled first.
    pub double_up_to_mpx: f64,
    /// Least contrast of a keypoint, grey values in 0..=1.
    pub contrast_threshold: f64,
}

/// Which pairs of images are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PairRule {
    /// Exhaustive up to a number of images, sequential above.
    Auto,
    /// All pairs.
    Exhaustive,
    /// Neighbours in time, and loop candidates.
    Sequential,
}

/// Options of the stage `matching`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MatchingConfig {
    /// Which pairs are matched.
    pub pairs: PairRule,
    /// Most images of which `auto` matches all pairs.
    pub exhaustive_up_to: u32,
    /// Neighbours in time that an image is matched with.
    pub overlap: u32,
    /// Largest ratio of the distances to the nearest and the next descriptor.
    pub ratio: f64,
    /// Least correlation of a match.
    pub min_correlation: f64,
    /// Largest residual of an inlier, pixels.
    pub max_error_px: f64,
    /// Fewer inliers are no pair.
    pub min_inliers: u32,
}

/// Which way a model is made, see `mapping::Mapper`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mapper {
    /// The program chooses.
    Auto,
    /// All frames at once.
    Global,
    /// One frame after the other.
    Incremental,
}

/// Options of the stage `orient`, see `mapping::OrientOptions`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OrientConfig {
    /// Which way a model is made.
    pub mapper: Mapper,
    /// Inliers that the first pair needs.
    pub initial_min_inliers: u32,
    /// Intersection angle that the first pair should have, degrees.
    pub initial_min_angle_deg: f64,
    /// Largest residual for the pose of a new frame, pixels.
    pub register_max_error_px: f64,
    /// Inliers that a new frame needs.
    pub register_min_inliers: u32,
    /// Largest reprojection error that is kept, pixels.
    pub max_error_px: f64,
    /// Smallest intersection angle that is kept, degrees.
    pub min_angle_deg: f64,
    /// Frees the principal point.
    pub refine_principal_point: bool,
    /// Seed of every random choice.
    pub seed: u32,
}

/// Working resolution of dense matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DenseQuality {
    /// Fast look.
    Low,
    /// For a laptop.
    Medium,
    /// For a night.
    High,
}

/// Options of the stage `densify`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DensifyConfig {
    /// Working resolution.
    pub quality: DenseQuality,
    /// Most neighbours of an image.
    pub max_views: u32,
    /// Images that must agree on a point.
    pub min_views: u32,
    /// Seed of the random search.
    pub seed: u32,
}

/// Options of the stage `evaluate`.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluateConfig {
    /// What the cloud is compared with.
    pub reference: Option<PathBuf>,
    /// Known positions of projection centres, in the frame of the reference.
    pub positions: Option<PathBuf>,
    /// Largest distance of a point that is signal, metres; `None`: twice the ground sample distance.
    pub threshold_m: Option<f64>,
    /// Radius of the surface density, metres; `None`: the threshold.
    pub density_radius_m: Option<f64>,
    /// Cell of the integrity, metres; `None`: the threshold.
    pub grid_m: Option<f64>,
}

/// Options of the stage `report`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReportConfig {
    /// Most images that are shown.
    pub thumbnails: u32,
    /// Their long side, pixels.
    pub thumbnail_px: u32,
}
