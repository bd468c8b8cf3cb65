//! The sections of the stages.

use super::error::Source;
use super::model::{CameraConfig, EvaluateConfig, FeaturesConfig, MaskConfig, MaskStrategy, MatchingConfig, PairRule};
use super::raw::{RawEvaluate, RawFeatures, RawMask, RawMatching};
use super::values::Values;
use std::path::Path;

pub(super) fn mask(source: &mut Source<'_>, raw: &RawMask, cameras: &[CameraConfig]) -> MaskConfig {
    let mut values = Values { source };
    let strategies = [("none", MaskStrategy::None), ("files", MaskStrategy::Files), ("ip", MaskStrategy::Ip)];
    let any_file = cameras.iter().any(|c| c.mask.is_some());
    let default = if any_file { MaskStrategy::Files } else { MaskStrategy::None };
    let strategy = values.choice("mask.strategy", &raw.strategy, &strategies).unwrap_or(default);
    if let (MaskStrategy::Files, false, Some(place)) = (strategy, any_file, &raw.strategy) {
        let hint = "add `mask = \"masks/{stem}.png\"` to a [[camera]]";
        values.problem_with_hint(place.span(), "mask.strategy", "no camera names its mask files", hint);
    }
    MaskConfig { strategy }
}

pub(super) fn features(source: &mut Source<'_>, raw: &RawFeatures) -> FeaturesConfig {
    let mut values = Values { source };
    FeaturesConfig { max_keypoints: values.count("features.max_keypoints", &raw.max_keypoints, 100, 100_000, 8192) }
}

pub(super) fn matching(source: &mut Source<'_>, raw: &RawMatching) -> MatchingConfig {
    let mut values = Values { source };
    let rules = [("auto", PairRule::Auto), ("exhaustive", PairRule::Exhaustive), ("sequential", PairRule::Sequential)];
    MatchingConfig { pairs: values.choice("matching.pairs", &raw.pairs, &rules).unwrap_or(PairRule::Auto) }
}

pub(super) fn evaluate(source: &mut Source<'_>, raw: &RawEvaluate, folder: &Path) -> EvaluateConfig {
    let reference = raw.reference.as_ref().map(|place| {
        let path = folder.join(place.get_ref());
        if !path.is_file() {
            source.problem(Some(place.span()), "evaluate.reference", format!("there is no file {}", path.display()), None);
        }
        path
    });
    EvaluateConfig { reference }
}
