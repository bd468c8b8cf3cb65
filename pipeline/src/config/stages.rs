//! The sections of the stages.

use super::error::Source;
use super::model::CameraConfig;
use super::path_text::PathText;
use super::raw::{RawDensify, RawEvaluate, RawFeatures, RawMask, RawMatching, RawOrient, RawReport, RawSurface};
use super::stage_options::{
    AreaConfig, Combine, DenseQuality, DensifyConfig, EvaluateConfig, FeatureMethod, FeaturesConfig, IpConfig, Mapper, MaskConfig,
    MaskStrategy, MatchingConfig, MlConfig, MovingConfig, OrientConfig, OtsuOf, PairRule, Polarity, Preprocessing, ReportConfig, Route,
    SurfaceConfig,
};
use super::values::Values;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Full HD and less: what so few pixels show is worth the time, and their finer keypoints are twice as precise.
const DOUBLE_UP_TO_MPX: f64 = 2.1;

pub(super) fn mask(source: &mut Source<'_>, raw: &RawMask, cameras: &[CameraConfig], folder: &Path) -> MaskConfig {
    let model = existing_file(source, "mask.model", &raw.model, folder);
    let onnxruntime = existing_file(source, "mask.onnxruntime", &raw.onnxruntime, folder);
    let moving = moving(source, raw, folder);
    let mut values = Values { source };
    let any_file = cameras.iter().any(|c| c.mask.is_some());
    let default = if any_file { MaskStrategy::Files } else { MaskStrategy::None };
    let strategy = values.choice("mask.strategy", &raw.strategy, &MaskStrategy::ALL).unwrap_or(default);
    if let (MaskStrategy::Files, false, Some(place)) = (strategy, any_file, &raw.strategy) {
        let hint = "add `mask = \"masks/{stem}.png\"` to a [[camera]]";
        values.problem_with_hint(place.span(), "mask.strategy", "no camera names its mask files", hint);
    }
    let corrections = [
        ("none", Preprocessing::None),
        ("equalise", Preprocessing::Equalise),
        ("clahe", Preprocessing::Clahe),
        ("lab", Preprocessing::Lab),
        ("retinex", Preprocessing::Retinex),
    ];
    let routes = [("shared", Route::Shared), ("patches", Route::Patches)];
    let default = masking::MlOptions::default();
    MaskConfig {
        strategy,
        preprocessing: values.choice("mask.preprocessing", &raw.preprocessing, &corrections).unwrap_or(Preprocessing::None),
        areas: areas(&mut values, raw),
        ip: ip(&mut values, raw),
        ml: MlConfig {
            model,
            onnxruntime,
            route: values.choice("mask.route", &raw.route, &routes).unwrap_or(Route::Shared),
            levels: values.count("mask.levels", &raw.levels, 0, masking::MAX_LEVELS as u32, default.levels as u32),
        },
        combine: values.choice("mask.combine", &raw.combine, &[("and", Combine::And), ("or", Combine::Or)]).unwrap_or(Combine::And),
        vote: values.count("mask.vote", &raw.vote, 0, MAX_VOTE, 0),
        moving,
    }
}

/// Most exposures on either side that vote: farther ones see other places.
const MAX_VOTE: u32 = 5;

fn moving(source: &mut Source<'_>, raw: &RawMask, folder: &Path) -> Option<MovingConfig> {
    let Some(place) = &raw.moving else {
        if let Some(labels) = &raw.moving_labels {
            let hint = "add `moving = \"FOLDER\"`, the folder of the label files".to_owned();
            source.problem(Some(labels.span()), "mask.moving_labels", "without mask.moving nothing is cut out", Some(hint));
        }
        return None;
    };
    let path = folder.join(place.get_ref().as_str());
    if !path.is_dir() {
        source.problem(Some(place.span()), "mask.moving", format!("there is no folder {}", path.display()), None);
    }
    Some(MovingConfig { folder: path, labels: raw.moving_labels.as_ref().map_or_else(Vec::new, |l| l.get_ref().clone()) })
}

fn areas(values: &mut Values<'_, '_>, raw: &RawMask) -> AreaConfig {
    let default = masking::IpOptions::default();
    let found = AreaConfig {
        min_structure_area: values.within("mask.min_structure_area", &raw.min_structure_area, 0.0, 1.0, default.min_structure_area),
        min_hole_area: values.within("mask.min_hole_area", &raw.min_hole_area, 0.0, 1.0, default.min_hole_area),
        min_structure_m2: values.positive("mask.min_structure_m2", &raw.min_structure_m2),
        min_hole_m2: values.positive("mask.min_hole_m2", &raw.min_hole_m2),
        gsd_m: values.positive("mask.gsd_m", &raw.gsd_m),
    };
    for (key, place) in [("mask.min_structure_m2", &raw.min_structure_m2), ("mask.min_hole_m2", &raw.min_hole_m2)] {
        if let (Some(place), None) = (place, &raw.gsd_m) {
            let hint = "add gsd_m, what a pixel shows at the distance of the structure, in metres";
            values.problem_with_hint(place.span(), key, "cannot be told in pixels", hint);
        }
    }
    found
}

/// A file that dive.toml names, relative to its folder; a problem where there is none.
fn existing_file(source: &mut Source<'_>, key: &str, place: &Option<Spanned<PathText>>, folder: &Path) -> Option<PathBuf> {
    let place = place.as_ref()?;
    let path = folder.join(place.get_ref().as_str());
    if !path.is_file() {
        source.problem(Some(place.span()), key, format!("there is no file {}", path.display()), None);
    }
    Some(path)
}

fn ip(values: &mut Values<'_, '_>, raw: &RawMask) -> IpConfig {
    let default = masking::IpOptions::default();
    let polarities = [("auto", Polarity::Auto), ("dark", Polarity::Dark), ("bright", Polarity::Bright)];
    let channels = [("red", 0), ("green", 1), ("blue", 2)];
    let mut share = |key: &str, value, default| values.within(key, value, 0.0, 1.0, default);
    let closing_radius = share("mask.closing_radius", &raw.closing_radius, default.closing_radius);
    let min_textured_share = share("mask.min_textured_share", &raw.min_textured_share, default.min_textured_share);
    let reach = share("mask.reach", &raw.reach, default.reach);
    let min_texture = share("mask.min_texture", &raw.min_texture, default.min_texture);
    let canny_low = values.within("mask.canny_low", &raw.canny_low, 0.0, 255.0, default.canny.low);
    let canny_high = values.within("mask.canny_high", &raw.canny_high, 0.0, 255.0, default.canny.high);
    if let (true, Some(place)) = (canny_low > canny_high, raw.canny_low.as_ref().or(raw.canny_high.as_ref())) {
        values.problem(place.span(), "mask.canny_low", format!("is {canny_low}, above canny_high, {canny_high}"));
    }
    IpConfig {
        polarity: values.choice("mask.polarity", &raw.polarity, &polarities).unwrap_or(Polarity::Auto),
        channel: values.choice("mask.channel", &raw.channel, &channels).unwrap_or(default.channel as u32),
        working_long_side_px: values.count(
            "mask.working_long_side_px",
            &raw.working_long_side_px,
            0,
            100_000,
            default.working_long_side_px as u32,
        ),
        blur_sigma_px: values.within("mask.blur_sigma_px", &raw.blur_sigma_px, 0.0, 10.0, default.blur_sigma_px),
        canny_low,
        canny_high,
        closing_radius,
        min_textured_share,
        reach,
        min_texture,
        otsu: values.choice("mask.otsu", &raw.otsu, &[("image", OtsuOf::Image), ("dive", OtsuOf::Dive)]).unwrap_or(OtsuOf::Image),
    }
}

fn flag(value: &Option<Spanned<bool>>, default: bool) -> bool {
    value.as_ref().map_or(default, |v| *v.get_ref())
}

pub(super) fn features(source: &mut Source<'_>, raw: &RawFeatures) -> FeaturesConfig {
    let (mut values, default) = (Values { source }, ::features::SiftOptions::default());
    let contrast = f64::from(default.contrast_threshold);
    let methods = [("sift", FeatureMethod::Sift), ("harris-ncc", FeatureMethod::HarrisNcc)];
    FeaturesConfig {
        method: values.choice("features.method", &raw.method, &methods).unwrap_or(FeatureMethod::Sift),
        max_keypoints: values.count("features.max_keypoints", &raw.max_keypoints, 100, 100_000, default.max_features as u32),
        double_up_to_mpx: values.within("features.double_up_to_mpx", &raw.double_up_to_mpx, 0.0, 1000.0, DOUBLE_UP_TO_MPX),
        contrast_threshold: values.within("features.contrast_threshold", &raw.contrast_threshold, 1e-6, 1.0, contrast),
    }
}

pub(super) fn matching(source: &mut Source<'_>, raw: &RawMatching) -> MatchingConfig {
    let mut values = Values { source };
    let (matches, verify) = (::features::MatchOptions::default(), ::features::VerifyOptions::default());
    let ratio = (f64::from(matches.max_ratio) * 1e6).round() / 1e6;
    let correlation = ::features::NccOptions::default().min_correlation;
    let rules = [("auto", PairRule::Auto), ("exhaustive", PairRule::Exhaustive), ("sequential", PairRule::Sequential)];
    MatchingConfig {
        pairs: values.choice("matching.pairs", &raw.pairs, &rules).unwrap_or(PairRule::Auto),
        exhaustive_up_to: values.count("matching.exhaustive_up_to", &raw.exhaustive_up_to, 0, 100_000, 200),
        overlap: values.count("matching.overlap", &raw.overlap, 1, 10_000, 10),
        ratio: values.within("matching.ratio", &raw.ratio, 0.1, 1.0, ratio),
        min_correlation: values.within("matching.min_correlation", &raw.min_correlation, 0.0, 1.0, correlation),
        max_error_px: values.within("matching.max_error_px", &raw.max_error_px, 0.1, 100.0, verify.max_error_px),
        min_inliers: values.count("matching.min_inliers", &raw.min_inliers, 8, 10_000, verify.min_inliers as u32),
    }
}

pub(super) fn orient(source: &mut Source<'_>, raw: &RawOrient) -> OrientConfig {
    let (mut values, default) = (Values { source }, mapping::OrientOptions::default());
    let mut count = |key: &str, value, low, default: usize| values.count(key, value, low, 100_000, default as u32);
    let initial_min_inliers = count("orient.initial_min_inliers", &raw.initial_min_inliers, 10, default.initial_min_inliers);
    let register_min_inliers = count("orient.register_min_inliers", &raw.register_min_inliers, 6, default.register_min_inliers);
    let mappers = [("auto", Mapper::Auto), ("global", Mapper::Global), ("incremental", Mapper::Incremental)];
    let mapper = values.choice("orient.mapper", &raw.mapper, &mappers).unwrap_or(Mapper::Auto);
    let mut within = |key: &str, value, low, high, default| values.within(key, value, low, high, default);
    OrientConfig {
        mapper,
        initial_min_inliers,
        initial_min_angle_deg: within("orient.initial_min_angle_deg", &raw.initial_min_angle_deg, 0.1, 90.0, default.initial_min_angle_deg),
        register_max_error_px: within(
            "orient.register_max_error_px",
            &raw.register_max_error_px,
            0.1,
            200.0,
            default.register_max_error_px,
        ),
        register_min_inliers,
        max_error_px: within("orient.max_error_px", &raw.max_error_px, 0.1, 100.0, default.max_error_px),
        min_angle_deg: within("orient.min_angle_deg", &raw.min_angle_deg, 0.0, 45.0, default.min_angle_deg),
        refine_principal_point: flag(&raw.refine_principal_point, default.refine_principal_point),
        seed: values.count("orient.seed", &raw.seed, 0, u32::MAX, default.seed as u32),
    }
}

pub(super) fn densify(source: &mut Source<'_>, raw: &RawDensify) -> DensifyConfig {
    let mut values = Values { source };
    let (views, fusion) = (dense::ViewSelectionOptions::default(), dense::FusionOptions::default());
    let qualities = [("low", DenseQuality::Low), ("medium", DenseQuality::Medium), ("high", DenseQuality::High)];
    DensifyConfig {
        quality: values.choice("densify.quality", &raw.quality, &qualities).unwrap_or(DenseQuality::Medium),
        max_views: values.count("densify.max_views", &raw.max_views, 1, 16, views.max_views as u32),
        min_views: values.count("densify.min_views", &raw.min_views, 2, 16, fusion.min_views as u32),
        seed: values.count("densify.seed", &raw.seed, 0, u32::MAX, dense::DepthOptions::default().seed as u32),
    }
}

pub(super) fn surface(source: &mut Source<'_>, raw: &RawSurface) -> SurfaceConfig {
    let mut values = Values { source };
    let options = surface::PoissonOptions::default();
    let yes = |value: &super::raw::Place<bool>, default: bool| value.as_ref().map_or(default, |v| *v.get_ref());
    SurfaceConfig {
        cell_m: values.positive("surface.cell_m", &raw.cell_m),
        trim: values.within("surface.trim", &raw.trim, 0.0, 1.0, crate::surfacing::TRIM),
        screening: values.within("surface.screening", &raw.screening, 0.0, 1e4, options.screening),
        samples_per_cell: values.within("surface.samples_per_cell", &raw.samples_per_cell, 0.1, 1000.0, options.samples_per_cell),
        sigma_weights: yes(&raw.sigma_weights, options.sigma_weights),
        closed: yes(&raw.closed, options.closed),
    }
}

pub(super) fn evaluate(source: &mut Source<'_>, raw: &RawEvaluate, folder: &Path) -> EvaluateConfig {
    let reference = existing_file(source, "evaluate.reference", &raw.reference, folder);
    let positions = existing_file(source, "evaluate.positions", &raw.positions, folder);
    let mut values = Values { source };
    EvaluateConfig {
        reference,
        positions,
        threshold_m: values.positive("evaluate.threshold_m", &raw.threshold_m),
        density_radius_m: values.positive("evaluate.density_radius_m", &raw.density_radius_m),
        grid_m: values.positive("evaluate.grid_m", &raw.grid_m),
    }
}

pub(super) fn report(source: &mut Source<'_>, raw: &RawReport) -> ReportConfig {
    let mut values = Values { source };
    ReportConfig {
        thumbnails: values.count("report.thumbnails", &raw.thumbnails, 0, 1000, 24),
        thumbnail_px: values.count("report.thumbnail_px", &raw.thumbnail_px, 32, 4096, 480),
    }
}
