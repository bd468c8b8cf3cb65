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
    /// Masks are made by a classifier.
    Ml,
    /// Both, combined.
    #[serde(rename = "ip+ml")]
    IpMl,
}

impl MaskStrategy {
    /// All, by name.
    pub const ALL: [(&'static str, Self); 5] =
        [("none", Self::None), ("files", Self::Files), ("ip", Self::Ip), ("ml", Self::Ml), ("ip+ml", Self::IpMl)];

    /// Whether image processing takes part.
    #[must_use]
    pub fn has_ip(self) -> bool {
        matches!(self, Self::Ip | Self::IpMl)
    }

    /// Whether a classifier takes part.
    #[must_use]
    pub fn has_ml(self) -> bool {
        matches!(self, Self::Ml | Self::IpMl)
    }

    /// The name in dive.toml and in `out/masks/<strategy>`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Files => "files",
            Self::Ip => "ip",
            Self::Ml => "ml",
            Self::IpMl => "ip+ml",
        }
    }
}

/// Options of the stage `mask`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskConfig {
    /// How masks are made.
    pub strategy: MaskStrategy,
    /// What is done with images before they are masked.
    pub preprocessing: Preprocessing,
    /// How small a part of the image may be.
    pub areas: AreaConfig,
    /// Options of the strategy `ip`.
    pub ip: IpConfig,
    /// Options of the strategy `ml`.
    pub ml: MlConfig,
    /// What the masks of `ip+ml` are.
    pub combine: Combine,
    /// Exposures on either side that vote on a mask; 0: none.
    pub vote: u32,
    /// What moves and is cut out of all masks.
    pub moving: Option<MovingConfig>,
}

/// What is cut out of masks, see `pipeline::moving`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MovingConfig {
    /// Folder of labels.
    #[serde(skip)]
    pub folder: PathBuf,
    /// Labels of polygons that move; empty: those that commonly do.
    pub labels: Vec<String>,
}

/// What is done with images before they are masked, see `masking::Preprocessing`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Preprocessing {
    /// Nothing.
    None,
    /// Equalisation of the channels.
    Equalise,
    /// Equalisation by tiles.
    Clahe,
    /// Correction of colour in l alpha beta.
    Lab,
    /// Ratio to the surroundings.
    Retinex,
}

/// What two masks are together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Combine {
    /// Structure in both.
    And,
    /// Structure in either.
    Or,
}

/// Areas below which structure is removed and holes are filled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AreaConfig {
    /// Of structure, share of the image.
    pub min_structure_area: f64,
    /// Of holes, share of the image.
    pub min_hole_area: f64,
    /// Of structure, square metres, in place of the share; needs `gsd_m`.
    pub min_structure_m2: Option<f64>,
    /// Of holes, square metres, in place of the share; needs `gsd_m`.
    pub min_hole_m2: Option<f64>,
    /// What a pixel shows at the distance of the structure, metres.
    pub gsd_m: Option<f64>,
}

impl AreaConfig {
    /// The least areas of structure and holes as shares of an image.
    #[must_use]
    pub fn shares(&self, width: usize, height: usize) -> (f64, f64) {
        let image_m2 = self.gsd_m.map(|gsd| gsd * gsd * (width * height).max(1) as f64);
        let share = |share: f64, m2: Option<f64>| m2.zip(image_m2).map_or(share, |(m2, image)| (m2 / image).min(1.0));
        (share(self.min_structure_area, self.min_structure_m2), share(self.min_hole_area, self.min_hole_m2))
    }
}

/// How patches get their logits, see `masking::Route`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Route {
    /// The network runs once over the whole image.
    Shared,
    /// The network runs for every patch.
    Patches,
}

/// Options of masks by a classifier, see `masking::MlOptions`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MlConfig {
    /// The model, ONNX; that of the program where none is named.
    #[serde(skip)]
    pub model: Option<PathBuf>,
    /// The ONNX Runtime library; found where none is named.
    #[serde(skip)]
    pub onnxruntime: Option<PathBuf>,
    /// How patches get their logits.
    pub route: Route,
    /// Depth of the quadtree.
    pub levels: u32,
}

/// What Otsu's threshold is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum OtsuOf {
    /// Each image.
    Image,
    /// All images of a camera together: the light on a dive is the same for all of them, but each camera has its own exposure.
    Dive,
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
    /// Texture that makes a part structure, share of the part.
    pub min_textured_share: f64,
    /// How far structure reaches from texture, share of the long side.
    pub reach: f64,
    /// Less texture is water alone, share of the image.
    pub min_texture: f64,
    /// What the threshold is of.
    pub otsu: OtsuOf,
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

/// Options of the stage `surface`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceConfig {
    /// Edge of the finest cells, metres (the unit of the model); `None`: twice the ground sample distance.
    pub cell_m: Option<f64>,
    /// Share of the median density of points below which the surface is cut off.
    pub trim: f64,
    /// Weight of the points against their normals.
    pub screening: f64,
    /// Points that a cell holds at least.
    pub samples_per_cell: f64,
    /// Whether points weigh by their standard deviation.
    pub sigma_weights: bool,
    /// Whether the points are those of a closed body.
    pub closed: bool,
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
