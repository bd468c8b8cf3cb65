//! The file as written: every value optional, with its place in the text. Nothing is checked here but names and types.

use super::path_text::PathText;
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

pub(super) type Place<T> = Option<Spanned<T>>;

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawConfig {
    pub(super) dive: RawDive,
    pub(super) camera: Vec<Spanned<RawCamera>>,
    pub(super) rig: RawRig,
    pub(super) scale_bar: Vec<Spanned<RawScaleBar>>,
    pub(super) world: RawWorld,
    pub(super) sensors: Place<RawSensors>,
    pub(super) control_point: Vec<Spanned<RawControlPoint>>,
    pub(super) mask: RawMask,
    pub(super) features: RawFeatures,
    pub(super) matching: RawMatching,
    pub(super) orient: RawOrient,
    pub(super) densify: RawDensify,
    pub(super) surface: RawSurface,
    pub(super) evaluate: RawEvaluate,
    pub(super) report: RawReport,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawDive {
    pub(super) name: Place<String>,
    pub(super) output: Place<PathText>,
    pub(super) frames_from: Place<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawCamera {
    pub(super) name: Place<String>,
    pub(super) images: Place<PathText>,
    pub(super) video: Place<PathText>,
    pub(super) rate_hz: Place<f64>,
    pub(super) offset_secs: Place<f64>,
    pub(super) mask: Place<PathText>,
    pub(super) interior: Place<RawInterior>,
}

/// Which parameters are not refined.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, expecting = "expected true, false or a list of names of parameters")]
pub(super) enum RawFixed {
    All(bool),
    Some(Vec<String>),
}

/// A flat port.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawPort {
    pub(super) normal: Place<Vec<f64>>,
    pub(super) distance_m: Place<f64>,
    pub(super) thickness_m: Place<f64>,
    pub(super) index_air: Place<f64>,
    pub(super) index_port: Place<f64>,
    pub(super) index_water: Place<f64>,
    pub(super) object_distance_m: Place<f64>,
}

macro_rules! raw_interior {
    ($($param:ident)*) => {
        /// Interior orientation, in dive.toml or in a file of its own.
        #[derive(Debug, Default, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub(super) struct RawInterior {
            pub(super) file: Place<PathText>,
            pub(super) model: Place<String>,
            pub(super) width: Place<u32>,
            pub(super) height: Place<u32>,
            pub(super) fixed: Place<RawFixed>,
            pub(super) sigma: Place<BTreeMap<String, f64>>,
            pub(super) port: Place<RawPort>,
            $($param: Place<f64>,)*
        }

        impl RawInterior {
            /// The parameters that are given, by name.
            pub(super) fn params(&self) -> Vec<(&'static str, &Spanned<f64>)> {
                [$((stringify!($param), &self.$param),)*].into_iter().filter_map(|(name, value)| Some((name, value.as_ref()?))).collect()
            }
        }
    };
}
raw_interior!(f fx fy cx cy k k1 k2 k3 k4 p1 p2 c x0 y0 a1 a2 a3 b1 b2 c1 c2);

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawRig {
    pub(super) file: Place<PathText>,
    pub(super) mode: Place<String>,
    pub(super) baseline: Vec<Spanned<RawBaseline>>,
    pub(super) pose: BTreeMap<Spanned<String>, Spanned<RawPose>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawBaseline {
    pub(super) between: Place<Vec<Spanned<String>>>,
    pub(super) length_m: Place<f64>,
    pub(super) sigma_m: Place<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawPose {
    pub(super) quaternion_wxyz: Place<Vec<f64>>,
    pub(super) axis_angle_deg: Place<Vec<f64>>,
    pub(super) matrix: Place<Vec<Vec<f64>>>,
    pub(super) translation_m: Place<Vec<f64>>,
    pub(super) sigma_deg: Place<f64>,
    pub(super) sigma_m: Place<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawScaleBar {
    pub(super) name: Place<String>,
    pub(super) length_m: Place<f64>,
    pub(super) sigma_m: Place<f64>,
    pub(super) check: Place<bool>,
    pub(super) target: Place<String>,
    pub(super) search_radius_px: Place<f64>,
    pub(super) endpoints: Place<Vec<Vec<Spanned<RawPick>>>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawPick {
    pub(super) image: Place<String>,
    pub(super) x: Place<f64>,
    pub(super) y: Place<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawWorld {
    pub(super) origin_m: Place<Vec<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawSensors {
    pub(super) file: Place<PathText>,
    pub(super) offset_secs: Place<f64>,
    pub(super) interval_secs: Place<f64>,
    pub(super) position_latency_secs: Place<f64>,
    pub(super) position_sigma_m: Place<f64>,
    pub(super) position_lever_m: Place<Vec<f64>>,
    pub(super) depth_sigma_m: Place<f64>,
    pub(super) depth_lever_m: Place<Vec<f64>>,
    pub(super) water_level_m: Place<f64>,
    pub(super) tilt_sigma_deg: Place<f64>,
    pub(super) heading_sigma_deg: Place<f64>,
    pub(super) mounting: Place<RawPose>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawControlPoint {
    pub(super) name: Place<String>,
    pub(super) xyz_m: Place<Vec<f64>>,
    pub(super) sigma_m: Place<f64>,
    pub(super) check: Place<bool>,
    pub(super) target: Place<String>,
    pub(super) search_radius_px: Place<f64>,
    pub(super) picks: Option<Vec<Spanned<RawPick>>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawMask {
    pub(super) strategy: Place<String>,
    pub(super) polarity: Place<String>,
    pub(super) channel: Place<String>,
    pub(super) working_long_side_px: Place<u32>,
    pub(super) blur_sigma_px: Place<f64>,
    pub(super) canny_low: Place<f64>,
    pub(super) canny_high: Place<f64>,
    pub(super) closing_radius: Place<f64>,
    pub(super) min_structure_area: Place<f64>,
    pub(super) min_hole_area: Place<f64>,
    pub(super) min_textured_share: Place<f64>,
    pub(super) reach: Place<f64>,
    pub(super) min_texture: Place<f64>,
    pub(super) otsu: Place<String>,
    pub(super) min_structure_m2: Place<f64>,
    pub(super) min_hole_m2: Place<f64>,
    pub(super) gsd_m: Place<f64>,
    pub(super) preprocessing: Place<String>,
    pub(super) model: Place<PathText>,
    pub(super) onnxruntime: Place<PathText>,
    pub(super) route: Place<String>,
    pub(super) levels: Place<u32>,
    pub(super) combine: Place<String>,
    pub(super) vote: Place<u32>,
    pub(super) moving: Place<PathText>,
    pub(super) moving_labels: Place<Vec<String>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawFeatures {
    pub(super) method: Place<String>,
    pub(super) max_keypoints: Place<u32>,
    pub(super) double_up_to_mpx: Place<f64>,
    pub(super) contrast_threshold: Place<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawMatching {
    pub(super) pairs: Place<String>,
    pub(super) exhaustive_up_to: Place<u32>,
    pub(super) overlap: Place<u32>,
    pub(super) ratio: Place<f64>,
    pub(super) min_correlation: Place<f64>,
    pub(super) max_error_px: Place<f64>,
    pub(super) min_inliers: Place<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawOrient {
    pub(super) mapper: Place<String>,
    pub(super) initial_min_inliers: Place<u32>,
    pub(super) initial_min_angle_deg: Place<f64>,
    pub(super) register_max_error_px: Place<f64>,
    pub(super) register_min_inliers: Place<u32>,
    pub(super) max_error_px: Place<f64>,
    pub(super) min_angle_deg: Place<f64>,
    pub(super) refine_principal_point: Place<bool>,
    pub(super) seed: Place<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawDensify {
    pub(super) quality: Place<String>,
    pub(super) max_views: Place<u32>,
    pub(super) min_views: Place<u32>,
    pub(super) seed: Place<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawSurface {
    pub(super) cell_m: Place<f64>,
    pub(super) trim: Place<f64>,
    pub(super) screening: Place<f64>,
    pub(super) samples_per_cell: Place<f64>,
    pub(super) sigma_weights: Place<bool>,
    pub(super) closed: Place<bool>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawEvaluate {
    pub(super) reference: Place<PathText>,
    pub(super) positions: Place<PathText>,
    pub(super) threshold_m: Place<f64>,
    pub(super) density_radius_m: Place<f64>,
    pub(super) grid_m: Place<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct RawReport {
    pub(super) thumbnails: Place<u32>,
    pub(super) thumbnail_px: Place<u32>,
}
