//! calib.toml: which images of which target calibrate which cameras.

use super::error::{ConfigError, ConfigProblem, Source};
use super::model::{CameraConfig, FramesFrom};
use super::path_text::PathText;
use super::raw::{Place, RawCamera};
use super::resolve::{cameras, raw_table};
use super::values::Values;
use scene::CameraModel;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Model of cameras of which none is given: that of the paper's Table 3.
const DEFAULT_MODEL: CameraModel = CameraModel::Brown;
/// Inner corners a side.
const MIN_CORNERS: u32 = 3;
const MAX_CORNERS: u32 = 100;

/// What is calibrated, and from what.
#[derive(Clone, Debug)]
pub struct CalibConfig {
    /// The calib.toml.
    pub file: PathBuf,
    /// Name, for headings.
    pub name: String,
    /// Folder that is written to.
    pub output: PathBuf,
    /// How images of several cameras pair up into exposures.
    pub frames_from: FramesFrom,
    /// The target.
    pub target: BoardConfig,
    /// The cameras; the first one is the frame of the rig. Of the interior orientation, model and held parameters count.
    pub cameras: Vec<CameraConfig>,
}

/// A chequerboard.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoardConfig {
    /// Inner corners along one side.
    pub columns: usize,
    /// And along the other.
    pub rows: usize,
    /// Side of a square, metres.
    pub square_m: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RawCalib {
    calibration: RawCalibration,
    target: Place<RawTarget>,
    camera: Vec<Spanned<RawCamera>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RawCalibration {
    name: Place<String>,
    output: Place<PathText>,
    frames_from: Place<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RawTarget {
    kind: Place<String>,
    columns: Place<u32>,
    rows: Place<u32>,
    square_m: Place<f64>,
}

/// Reads a calib.toml; relative paths in it start from its folder.
///
/// # Errors
/// [`ConfigError`] with what is wrong in it.
pub fn read_calib(file: &Path) -> Result<CalibConfig, ConfigError> {
    let text = std::fs::read_to_string(file).map_err(|e| ConfigError {
        problems: vec![ConfigProblem {
            file: file.to_path_buf(),
            line: None,
            column: None,
            key: String::new(),
            message: format!("cannot be read: {e}"),
            hint: Some("docs/calibrate.md shows what stands in a calib.toml".to_owned()),
        }],
    })?;
    let mut source = Source::new(file, &text);
    // Unknown keys come out of the types here: there are few.
    let raw = raw_table::<RawCalib>(&mut source, |_, _| {});
    let config = raw.and_then(|raw| resolve(&mut source, &raw, file));
    source.finish(config)
}

fn resolve(source: &mut Source<'_>, raw: &RawCalib, file: &Path) -> Option<CalibConfig> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut found = cameras(source, &raw.camera, folder);
    for (camera, entry) in found.iter_mut().zip(&raw.camera) {
        of_camera(source, camera, entry);
    }
    let rules = [("order", FramesFrom::Order), ("stem", FramesFrom::Stem), ("timestamp", FramesFrom::Timestamp)];
    let frames_from = Values { source }.choice("calibration.frames_from", &raw.calibration.frames_from, &rules);
    let output = raw.calibration.output.as_ref().map_or("calibration", |o| o.get_ref().as_str());
    let target = target(source, raw.target.as_ref())?;
    Some(CalibConfig {
        file: file.to_path_buf(),
        name: raw.calibration.name.as_ref().map_or_else(|| "calibration".to_owned(), |n| n.get_ref().clone()),
        output: folder.join(output),
        // Names say more than positions: one photograph that was lost would shift all that follow.
        frames_from: frames_from.unwrap_or(FramesFrom::Stem),
        target,
        cameras: found,
    })
}

fn of_camera(source: &mut Source<'_>, camera: &mut CameraConfig, entry: &Spanned<RawCamera>) {
    let mut values = Values { source };
    if let Some(mask) = &entry.get_ref().mask {
        values.problem(mask.span(), "camera.mask", "a calibration takes no masks");
    }
    let Some(place) = &entry.get_ref().interior else {
        camera.interior.model = DEFAULT_MODEL;
        return;
    };
    let interior = place.get_ref();
    if !camera.interior.params.is_empty() || interior.file.is_some() || interior.width.is_some() || interior.height.is_some() {
        values.problem_with_hint(
            place.span(),
            "camera.interior",
            "parameters are what the calibration finds",
            "give `model` and, of those that shall stay 0, `fixed = [\"c1\", \"c2\"]`, nothing else",
        );
    }
    // Names in `fixed` have been compared with those of the default of dive.toml where no model is given.
    if let (None, Some(fixed)) = (&interior.model, &interior.fixed) {
        values.problem_with_hint(
            fixed.span(),
            "camera.interior.fixed",
            "the model is missing beside it",
            "add model = \"brown\" or another",
        );
    }
    camera.interior.model = if interior.model.is_some() { camera.interior.model } else { DEFAULT_MODEL };
    if let (CameraModel::Fisheye, Some(model)) = (camera.interior.model, &interior.model) {
        let hint = "\"brown\", \"opencv\", \"radial\", \"simple-radial\" and \"pinhole\" are";
        values.problem_with_hint(model.span(), "camera.interior.model", "\"fisheye\" is not calibrated from targets", hint);
    }
    let kinds = camera.interior.model.param_kinds();
    let focal = |k: usize| kinds[k] == scene::camera::ParamKind::Focal;
    if let (true, Some(fixed)) = (camera.interior.held.iter().enumerate().any(|(k, held)| *held && focal(k)), &interior.fixed) {
        values.problem(fixed.span(), "camera.interior.fixed", "a principal distance has no value to stay at");
    }
}

fn target(source: &mut Source<'_>, raw: Option<&Spanned<RawTarget>>) -> Option<BoardConfig> {
    let Some(place) = raw else {
        let hint = "[target] with kind = \"chequerboard\", columns, rows (inner corners) and square_m";
        source.problem(None, "target", "is missing", Some(hint.to_owned()));
        return None;
    };
    let raw = place.get_ref();
    let mut values = Values { source };
    values.choice("target.kind", &raw.kind, &[("chequerboard", ())]);
    for (key, missing) in
        [("target.columns", raw.columns.is_none()), ("target.rows", raw.rows.is_none()), ("target.square_m", raw.square_m.is_none())]
    {
        if missing {
            values.problem(place.span(), key, "is missing");
        }
    }
    let columns = values.count("target.columns", &raw.columns, MIN_CORNERS, MAX_CORNERS, 0);
    let rows = values.count("target.rows", &raw.rows, MIN_CORNERS, MAX_CORNERS, 0);
    let square_m = values.positive("target.square_m", &raw.square_m)?;
    Some(BoardConfig { columns: columns as usize, rows: rows as usize, square_m })
}
