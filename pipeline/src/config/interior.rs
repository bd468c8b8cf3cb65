//! `[camera.interior]`, in dive.toml or in a file of its own.

use super::error::{ConfigError, Source};
use super::keys::check_names;
use super::model::InteriorConfig;
use super::raw::{RawFixed, RawInterior, RawPort};
use super::values::Values;
use nalgebra::{Unit, Vector3};
use scene::camera::ParamKind;
use scene::{CameraModel, FlatPort};
use std::path::Path;
use toml::Spanned;

/// Model of cameras of which no model is given: enough for the distortion of most lenses, also behind a port.
const DEFAULT_MODEL: CameraModel = CameraModel::Radial;

/// Refractive index of acrylic glass.
const ACRYLIC: f64 = 1.49;
/// Refractive index of sea water, 540 nm, 10 to 20 degrees.
const SEA_WATER: f64 = 1.34;
/// Distance at which directions through a port are exact, metres.
const OBJECT_DISTANCE_M: f64 = 3.0;

impl Default for InteriorConfig {
    fn default() -> Self {
        Self { model: DEFAULT_MODEL, size: None, params: Vec::new(), fixed: false, held: Vec::new(), sigmas: Vec::new(), port: None }
    }
}

/// The interior orientation of a camera; `folder` is where relative file names start.
pub(super) fn resolve(source: &mut Source<'_>, folder: &Path, raw: Option<&Spanned<RawInterior>>) -> InteriorConfig {
    let Some(raw) = raw else { return InteriorConfig::default() };
    let interior = raw.get_ref();
    let Some(file) = &interior.file else { return values(source, interior, raw.span()) };
    let key = "camera.interior.file";
    if interior.model.is_some() || !interior.params().is_empty() || interior.port.is_some() {
        source.problem(
            Some(file.span()),
            key,
            "stands beside a model, parameters or a port",
            Some("give either `file`, or the model and its parameters".to_owned()),
        );
    }
    let path = folder.join(file.get_ref().as_str());
    match std::fs::read_to_string(&path) {
        Err(e) => source.problem(Some(file.span()), key, format!("cannot read {}: {e}", path.display()), None),
        Ok(text) => match read_file(&path, &text) {
            Ok(mut config) => {
                // What stands in dive.toml goes before what stands in the file.
                if interior.fixed.is_some() {
                    (config.fixed, config.held) = fixed(&mut Values { source }, interior, config.model);
                }
                if interior.sigma.is_some() {
                    config.sigmas = sigmas(&mut Values { source }, interior, &config);
                }
                return config;
            }
            Err(error) => source.add(error),
        },
    }
    InteriorConfig::default()
}

/// Reads an interior orientation from the text of a file of its own.
///
/// # Errors
/// [`ConfigError`] with everything that is wrong in it.
pub(crate) fn read_file(path: &Path, text: &str) -> Result<InteriorConfig, ConfigError> {
    let mut source = Source::new(path, text);
    let config = super::resolve::raw_table::<RawInterior>(&mut source, |source, table| check_names(source, table, "camera.interior"))
        .map(|raw| values(&mut source, &raw, 0..0));
    source.finish(config)
}

fn values(source: &mut Source<'_>, raw: &RawInterior, whole: std::ops::Range<usize>) -> InteriorConfig {
    let mut values = Values { source };
    let models: Vec<(&'static str, CameraModel)> = CameraModel::ALL.into_iter().map(|m| (m.name(), m)).collect();
    let model = values.choice("camera.interior.model", &raw.model, &models);
    let given = raw.params();
    if let (None, None, Some((name, value))) = (model, &raw.model, given.first()) {
        let hint = format!("add `model = \"{}\"` or another", DEFAULT_MODEL.name());
        values.problem_with_hint(value.span(), &format!("camera.interior.{name}"), "the model that it belongs to is missing", hint);
    }
    let size = size(&mut values, raw, &whole);
    let mut config = InteriorConfig { model: model.unwrap_or(DEFAULT_MODEL), size, ..InteriorConfig::default() };
    if let (Some(model), false) = (model, given.is_empty()) {
        config.params = params(&mut values, model, &given, &whole);
    }
    (config.fixed, config.held) = fixed(&mut values, raw, config.model);
    config.sigmas = sigmas(&mut values, raw, &config);
    config.port = raw.port.as_ref().and_then(|place| port(&mut values, place));
    if let (true, Some(port)) = (given.is_empty(), &raw.port) {
        let hint = "add them: behind a port they are those of the lens in air";
        values.problem_with_hint(port.span(), "camera.interior.port", "the parameters of the lens are missing", hint);
    }
    if let (true, true, Some(fixed)) = (config.fixed, given.is_empty(), &raw.fixed) {
        values.problem_with_hint(
            fixed.span(),
            "camera.interior.fixed",
            "no parameters are given that could be kept",
            "add them, or leave `fixed` out",
        );
    }
    config
}

/// Whether all parameters are fixed, and whether each is.
fn fixed(values: &mut Values<'_, '_>, raw: &RawInterior, model: CameraModel) -> (bool, Vec<bool>) {
    let Some(place) = &raw.fixed else { return (false, Vec::new()) };
    let names = match place.get_ref() {
        RawFixed::All(all) => return (*all, Vec::new()),
        RawFixed::Some(names) => names,
    };
    let known = model.param_names();
    for name in names.iter().filter(|n| !known.contains(&n.as_str())) {
        let hint = format!("its parameters are {}", known.join(", "));
        let message = format!("model \"{}\" has no parameter {name}", model.name());
        values.problem_with_hint(place.span(), "camera.interior.fixed", message, hint);
    }
    (false, known.iter().map(|k| names.iter().any(|n| n == k)).collect())
}

/// Standard deviation of each given parameter.
fn sigmas(values: &mut Values<'_, '_>, raw: &RawInterior, config: &InteriorConfig) -> Vec<Option<f64>> {
    let Some(place) = &raw.sigma else { return Vec::new() };
    let names = config.model.param_names();
    let mut sigmas = vec![None; names.len()];
    for (name, &sigma) in place.get_ref() {
        let key = format!("camera.interior.sigma.{name}");
        match names.iter().position(|n| n == name) {
            Some(k) if config.params.get(k).copied().flatten().is_some() => sigmas[k] = Some(sigma),
            _ => values.problem_with_hint(
                place.span(),
                &key,
                "there is no such value",
                format!("give {name} beside it, of model \"{}\"", config.model.name()),
            ),
        }
        if !(sigma.is_finite() && sigma > 0.0) {
            values.problem(place.span(), &key, format!("must be above 0, is {sigma}"));
        }
    }
    sigmas
}

/// The window that the camera looks through.
fn port(values: &mut Values<'_, '_>, place: &Spanned<RawPort>) -> Option<FlatPort> {
    const KEY: &str = "camera.interior.port";
    let raw = place.get_ref();
    let key = |name: &str| format!("{KEY}.{name}");
    for (name, value) in [("distance_m", &raw.distance_m), ("thickness_m", &raw.thickness_m)] {
        if value.is_none() {
            values.problem_with_hint(place.span(), &key(name), "is missing", "give it in metres, as measured at the housing");
        }
    }
    let mut number = |name: &str, value, default: f64| values.finite(&key(name), value).unwrap_or(default);
    let [distance_m, thickness_m] = [number("distance_m", &raw.distance_m, 0.0), number("thickness_m", &raw.thickness_m, 0.0)];
    let index_air = number("index_air", &raw.index_air, 1.0);
    let index_port = number("index_port", &raw.index_port, ACRYLIC);
    let index_water = number("index_water", &raw.index_water, SEA_WATER);
    let object_distance_m = number("object_distance_m", &raw.object_distance_m, OBJECT_DISTANCE_M);
    let [x, y, z] = values.numbers(&key("normal"), &raw.normal).unwrap_or([0.0, 0.0, 1.0]);
    let Some(normal) = Unit::try_new(Vector3::new(x, y, z), 1e-9) else {
        values.problem(place.span(), &key("normal"), "has no direction");
        return None;
    };
    let port = FlatPort { normal, distance_m, thickness_m, index_air, index_port, index_water, object_distance_m };
    match port.check() {
        Ok(()) => Some(port),
        Err(error) => {
            values.problem(place.span(), KEY, error.to_string());
            None
        }
    }
}

fn params(
    values: &mut Values<'_, '_>,
    model: CameraModel,
    given: &[(&'static str, &Spanned<f64>)],
    whole: &std::ops::Range<usize>,
) -> Vec<Option<f64>> {
    let names = model.param_names();
    for (name, value) in given {
        if !names.contains(name) {
            let hint = format!("its parameters are {}", names.join(", "));
            values.problem_with_hint(
                value.span(),
                &format!("camera.interior.{name}"),
                format!("model \"{}\" has no such parameter", model.name()),
                hint,
            );
        }
    }
    let mut params = Vec::with_capacity(names.len());
    for (name, kind) in names.iter().zip(model.param_kinds()) {
        let key = format!("camera.interior.{name}");
        let place = given.iter().find(|(n, _)| n == name).map(|(_, value)| (*value).clone());
        if *kind == ParamKind::Focal {
            if place.is_none() {
                let hint = "give it in pixels, or leave all parameters out to start from EXIF or a guess";
                values.problem_with_hint(whole.clone(), &key, "is missing beside the other parameters", hint);
            }
            params.push(values.positive(&key, &place));
        } else {
            params.push(values.finite(&key, &place));
        }
    }
    params
}

fn size(values: &mut Values<'_, '_>, raw: &RawInterior, whole: &std::ops::Range<usize>) -> Option<(u32, u32)> {
    match (&raw.width, &raw.height) {
        (Some(width), Some(height)) => {
            for (key, value) in [("camera.interior.width", width), ("camera.interior.height", height)] {
                if *value.get_ref() == 0 {
                    values.problem(value.span(), key, "must be above 0, is 0");
                }
            }
            Some((*width.get_ref(), *height.get_ref()))
        }
        (None, None) => None,
        (width, _) => {
            let (key, other) = if width.is_some() { ("width", "height") } else { ("height", "width") };
            values.problem(whole.clone(), &format!("camera.interior.{key}"), format!("`{other}` is missing beside it"));
            None
        }
    }
}
