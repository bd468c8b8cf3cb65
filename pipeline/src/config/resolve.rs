//! From the text to a checked [`Config`].

use super::error::{ConfigError, ConfigProblem, Source, did_you_mean};
use super::files::{NoFiles, image_files};
use super::keys::{check_names, key_at, kind_of};
use super::model::{CameraConfig, Config, FramesFrom, ImageSource, MaskPattern};
use super::raw::{RawCamera, RawConfig};
use super::values::Values;
use super::{interior, rig, sensors, stages};
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::DeTable;

/// Frames a second that are taken from a video when nothing is said.
const DEFAULT_RATE_HZ: f64 = 2.0;

/// Reads a dive.toml; relative paths in it start from its folder.
///
/// # Errors
/// [`ConfigError`] with everything that is wrong in it.
pub fn read(file: &Path) -> Result<Config, ConfigError> {
    let text = std::fs::read_to_string(file).map_err(|e| ConfigError {
        problems: vec![ConfigProblem {
            file: file.to_path_buf(),
            line: None,
            column: None,
            key: String::new(),
            message: format!("cannot be read: {e}"),
            hint: (e.kind() == std::io::ErrorKind::NotFound).then(|| "`sfm init FOLDER > dive.toml` writes one".to_owned()),
        }],
    })?;
    parse(file, &text)
}

/// Resolves the text of a dive.toml that lies, or is to lie, at `file`.
///
/// # Errors
/// As [`read`].
pub fn parse(file: &Path, text: &str) -> Result<Config, ConfigError> {
    let mut source = Source::new(file, text);
    let raw = raw_table::<RawConfig>(&mut source, |source, table| check_names(source, table, ""));
    let config = raw.map(|raw| resolve(&mut source, &raw, file));
    source.finish(config)
}

/// Reads a file's tables: syntax first, then the names of the keys, then the types.
pub(super) fn raw_table<T: for<'de> Deserialize<'de>>(
    source: &mut Source<'_>,
    names: impl FnOnce(&mut Source<'_>, &DeTable<'_>),
) -> Option<T> {
    let text = source.text();
    let table = match DeTable::parse(text) {
        Ok(table) => table,
        Err(error) => {
            source.problem(error.span(), "", error.message().trim().replace('\n', ", "), None);
            return None;
        }
    };
    names(source, table.get_ref());
    if source.has_problems() {
        return None;
    }
    match toml::from_str::<T>(text) {
        Ok(raw) => Some(raw),
        Err(error) => {
            let span = error.span();
            let key = span.clone().map(|s| key_at(table.get_ref(), s.start)).unwrap_or_default();
            source.problem(span, &key, error.message().to_owned(), type_hint(&key));
            None
        }
    }
}

fn type_hint(key: &str) -> Option<String> {
    if matches!(key, "camera" | "scale_bar" | "rig.baseline" | "control_point") {
        return Some(format!("write [[{key}]] in double brackets: there can be several"));
    }
    let kind = kind_of(key).or_else(|| kind_of(&format!("camera.interior.{key}")))?;
    Some(format!("`{key}` takes {kind}"))
}

fn resolve(source: &mut Source<'_>, raw: &RawConfig, file: &Path) -> Config {
    let folder = file.parent().unwrap_or(Path::new(""));
    let cameras = cameras(source, &raw.camera, folder);
    let rig = rig::resolve(source, &raw.rig, &cameras, folder);
    let scale_bars = rig::scale_bars(source, &raw.scale_bar, &cameras);
    let origin_m = sensors::origin(source, &raw.world);
    let sensors = sensors::sensors(source, raw.sensors.as_ref(), folder);
    let control_points = sensors::control_points(source, &raw.control_point, &cameras, origin_m);
    let rules = [("order", FramesFrom::Order), ("stem", FramesFrom::Stem), ("timestamp", FramesFrom::Timestamp)];
    let frames_from = Values { source }.choice("dive.frames_from", &raw.dive.frames_from, &rules).unwrap_or(FramesFrom::Order);
    let name = raw.dive.name.as_ref().map_or_else(|| "dive".to_owned(), |n| n.get_ref().clone());
    let output = raw.dive.output.as_ref().map_or("out", |o| o.get_ref().as_str());
    if let (true, Some(place)) = (output.is_empty(), &raw.dive.output) {
        source.problem(Some(place.span()), "dive.output", "is empty", None);
    }
    Config {
        file: file.to_path_buf(),
        name,
        output: folder.join(output),
        frames_from,
        rig,
        scale_bars,
        origin_m,
        sensors,
        control_points,
        mask: stages::mask(source, &raw.mask, &cameras, folder),
        features: stages::features(source, &raw.features),
        matching: stages::matching(source, &raw.matching),
        orient: stages::orient(source, &raw.orient),
        densify: stages::densify(source, &raw.densify),
        surface: stages::surface(source, &raw.surface),
        evaluate: stages::evaluate(source, &raw.evaluate, folder),
        report: stages::report(source, &raw.report),
        cameras,
    }
}

pub(super) fn cameras(source: &mut Source<'_>, raw: &[Spanned<RawCamera>], folder: &Path) -> Vec<CameraConfig> {
    if raw.is_empty() {
        let hint = "add a [[camera]] with `images = \"folder\"`, or let `sfm init FOLDER` write one";
        source.problem(None, "camera", "no camera is given", Some(hint.to_owned()));
    }
    let mut cameras: Vec<CameraConfig> = Vec::new();
    for (i, entry) in raw.iter().enumerate() {
        let camera = entry.get_ref();
        let name = camera.name.as_ref().map_or_else(|| format!("C{}", i + 1), |n| n.get_ref().clone());
        let name_at = camera.name.as_ref().map_or(entry.span(), Spanned::span);
        if cameras.iter().any(|c| c.name == name) {
            source.problem(Some(name_at.clone()), "camera.name", format!("there are two cameras \"{name}\""), None);
        }
        if !is_safe_name(&name) {
            let hint = "letters, digits, '-', '_' and '.', not starting with '.': it names folders".to_owned();
            source.problem(Some(name_at), "camera.name", format!("\"{name}\" cannot name a camera"), Some(hint));
        }
        let images = images(source, camera, entry.span(), folder);
        let mask = camera.mask.as_ref().map(|place| {
            if !place.get_ref().as_str().contains("{stem}") {
                let hint = "{stem} stands for the image's name without extension".to_owned();
                source.problem(Some(place.span()), "camera.mask", "has no {stem} in it", Some(hint));
            }
            MaskPattern { folder: folder.to_path_buf(), pattern: place.get_ref().as_str().to_owned() }
        });
        let interior = interior::resolve(source, folder, camera.interior.as_ref());
        // A wrong source leaves a camera without images, so that names in other tables still resolve.
        cameras.push(CameraConfig { name, images: images.unwrap_or(ImageSource::Files(Vec::new())), mask, interior });
    }
    cameras
}

/// Whether a name can be a folder on every system.
pub(crate) fn is_safe_name(name: &str) -> bool {
    !name.is_empty() && !name.starts_with('.') && name.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c))
}

fn images(source: &mut Source<'_>, camera: &RawCamera, entry: Range<usize>, folder: &Path) -> Option<ImageSource> {
    match (&camera.images, &camera.video) {
        (Some(_), Some(video)) => {
            source.problem(Some(video.span()), "camera.video", "stands beside `images`", Some("give one of them a camera".to_owned()));
            None
        }
        (None, None) => {
            source.problem(Some(entry), "camera.images", "is missing", Some("give `images` or `video`".to_owned()));
            None
        }
        (Some(images), None) => {
            for (key, place) in [("rate_hz", &camera.rate_hz), ("offset_secs", &camera.offset_secs)] {
                if let Some(place) = place {
                    source.problem(Some(place.span()), &format!("camera.{key}"), "only a video has it", None);
                }
            }
            let (message, hint) = match image_files(folder, images.get_ref().as_str(), images.get_ref().as_pattern()) {
                Ok(files) => return Some(ImageSource::Files(files)),
                Err(NoFiles::Pattern(message)) => (format!("is not a pattern: {message}"), None),
                Err(NoFiles::Unreadable(message)) => (format!("cannot be searched: {message}"), None),
                Err(NoFiles::Nothing) => (
                    format!("no image at {}", folder.join(images.get_ref().as_str()).display()),
                    near_hint(folder, images.get_ref().as_str()),
                ),
            };
            source.problem(Some(images.span()), "camera.images", message, hint);
            None
        }
        (None, Some(video)) => {
            let mut values = Values { source };
            let rate_hz = values.positive("camera.rate_hz", &camera.rate_hz).unwrap_or(DEFAULT_RATE_HZ);
            let offset_secs = values.within("camera.offset_secs", &camera.offset_secs, 0.0, 1e9, 0.0);
            let file = folder.join(video.get_ref().as_str());
            if !file.is_file() {
                let hint = near_hint(folder, video.get_ref().as_str());
                source.problem(Some(video.span()), "camera.video", format!("there is no file {}", file.display()), hint);
            }
            Some(ImageSource::Video { file, rate_hz, offset_secs })
        }
    }
}

/// What to look at when a path does not exist: the first folder of it that is missing, and a neighbour of a similar name.
fn near_hint(folder: &Path, written: &str) -> Option<String> {
    let mut here = folder.to_path_buf();
    for part in Path::new(written).components() {
        let next = here.join(part);
        let name = part.as_os_str().to_str()?;
        if next.exists() || name.contains(['*', '?', '[']) {
            here = next;
            continue;
        }
        let listed = if here.as_os_str().is_empty() { Path::new(".") } else { &here };
        let mut names: Vec<String> = std::fs::read_dir(listed).ok()?.flatten().filter_map(|e| e.file_name().into_string().ok()).collect();
        names.sort();
        return Some(match did_you_mean(name, names.iter().map(String::as_str)) {
            Some(meant) => format!("there is no \"{name}\" in {}; did you mean \"{meant}\"?", listed.display()),
            None => format!("there is no \"{name}\" in {}", listed.display()),
        });
    }
    None
}
