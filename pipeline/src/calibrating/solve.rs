//! From photographs to a calibration and its files.

use super::figures::{Solved, record};
use super::files::{camera_file, camera_toml, rig_toml};
use super::page::page;
use super::photographs::{self, Named, Photographs, in_words};
use super::record::Record;
use crate::config::{BoardConfig, CalibConfig, CameraConfig};
use crate::error::{Misfit, NoResult};
use crate::progress::Progress;
use crate::report::render;
use crate::store::Warning;
use anyhow::{Context, Result, bail};
use calibrate::{BoardFinding, CalibrateError, Calibration, CameraSetup, Setup, View, calibrate};
use nalgebra::Vector3;
use scene::camera::{MAX_CAMERA_PARAMS, ParamKind};
use std::collections::BTreeMap;
use std::path::Path;

/// Cameras together fit worse by this than the worst alone: they contradict each other.
const CONTRADICTION: f64 = 3.0;
/// Below this no contradiction is told: corners are not better known.
const CORNER_PX: f64 = 0.1;
/// A standard deviation of corners above this comes from something else than noise.
const LARGE_SIGMA_PX: f64 = 1.0;
/// Share of the parts of the image that corners should lie in.
const MIN_COVERAGE: f64 = 0.6;
/// Share of corners left out as mistakes above which something is wrong.
const MAX_OUTLIERS: f64 = 0.05;

/// What a calibration came to.
pub struct Made {
    /// All of it.
    pub record: Record,
    /// The files that were written, relative to the output folder, the report first.
    pub files: Vec<String>,
}

/// Calibrates and writes calib/NAME.toml, rig.toml (of several cameras), calibration.json and report.html.
///
/// # Errors
/// [`Misfit`] where the target is not the one described, [`NoResult`] where the photographs do not determine the calibration.
pub fn make(config: &CalibConfig, progress: &dyn Progress) -> Result<Made> {
    require_own(&config.output)?;
    let named: Vec<Named<'_>> = config.cameras.iter().map(|c| (c.name.as_str(), &c.images)).collect();
    let mut seen = photographs::read(&named, &config.target, config.frames_from, progress)?;
    require_target(&seen, &config.target, &config.file)?;
    progress.begin("adjusting", 1);
    let setup = setup(config, &seen)?;
    let name = |c: usize| config.cameras[c].name.as_str();
    let (calibration, alone) = solved(&setup, &|c| name(c).to_owned(), &|view| seen.list[view_of(&seen)[view]].name.clone())?;
    let coverage: Vec<f64> = (0..config.cameras.len()).map(|c| coverage(&setup, c)).collect();
    let warnings = warnings(config, &seen, &calibration, &coverage);
    seen.warnings.extend(warnings);
    let solved = Solved { config, seen: &seen, setup: &setup, calibration: &calibration, alone: &alone, coverage: &coverage };
    let record = record(&solved)?;
    let mut files = vec![
        ("report.html".to_owned(), render(&page(&solved, &record)?)),
        ("calibration.json".to_owned(), format!("{}\n", serde_json::to_string_pretty(&record)?)),
    ];
    for camera in &record.cameras {
        files.push((camera_file(&camera.name), camera_toml(camera)?));
    }
    if record.cameras.len() > 1 {
        files.push(("rig.toml".to_owned(), rig_toml(&record)));
    }
    std::fs::create_dir_all(config.output.join("calib")).with_context(|| config.output.display().to_string())?;
    for (path, text) in &files {
        let path = config.output.join(path);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    progress.advance(1);
    Ok(Made { record, files: files.into_iter().map(|(path, _)| path).collect() })
}

/// A folder of something else is left alone.
fn require_own(output: &Path) -> Result<()> {
    let filled = std::fs::read_dir(output).is_ok_and(|mut files| files.next().is_some());
    if filled && !output.join("calibration.json").is_file() {
        bail!("{} is not empty and holds no calibration: give another folder as calibration.output", output.display());
    }
    Ok(())
}

/// Indices of the photographs that are views, in their order.
pub(super) fn view_of(seen: &Photographs) -> Vec<usize> {
    (0..seen.list.len()).filter(|&k| matches!(seen.list[k].finding, BoardFinding::Found(_))).collect()
}

/// That the target was found, and is the one described.
pub(super) fn require_target(seen: &Photographs, board: &BoardConfig, file: &Path) -> Result<()> {
    if seen.list.is_empty() {
        let reason = seen.warnings.first().map(|w| format!("; {}: {}", w.about, w.message)).unwrap_or_default();
        return Err(NoResult(format!("none of the {} images can be used{reason}", seen.looked_at)).into());
    }
    let found = view_of(seen).len();
    let mut others: BTreeMap<(usize, usize), (usize, &str)> = BTreeMap::new();
    for photograph in &seen.list {
        if let BoardFinding::OtherSize { columns, rows } = photograph.finding {
            others.entry((columns, rows)).or_insert((0, &photograph.name)).0 += 1;
        }
    }
    let BoardConfig { columns, rows, .. } = board;
    if let Some((&(c, r), &(count, first))) = others.iter().max_by_key(|(_, (count, _))| *count)
        && count > found
    {
        return Err(Misfit(format!(
            "{}: target: {count} images show a board of {c} x {r} inner corners, {first} is one, and {found} one of {columns} x {rows}\n  \
             hint: columns and rows count inner corners, one less than squares",
            file.display()
        ))
        .into());
    }
    if found == 0 {
        let part = seen.list.iter().max_by_key(|p| match p.finding {
            BoardFinding::Part { corners } => corners,
            _ => 0,
        });
        let best = part.map(|p| format!("; the most is in {}: {}", p.name, in_words(&p.finding))).unwrap_or_default();
        return Err(NoResult(format!(
            "a whole board of {columns} x {rows} inner corners is in none of {} images{best}\n  hint: columns and rows count inner corners, \
             one less than squares; all of the board must be in the image, with a white margin",
            seen.list.len()
        ))
        .into());
    }
    Ok(())
}

pub(super) fn target_points(board: &BoardConfig) -> Vec<Vector3<f64>> {
    let at = |k: usize| Vector3::new((k % board.columns) as f64, (k / board.columns) as f64, 0.0) * board.square_m;
    (0..board.columns * board.rows).map(at).collect()
}

/// The views of the setup are the photographs that show the target, in their order.
pub(super) fn views(seen: &Photographs) -> Vec<View> {
    let view = |k: usize| match &seen.list[k].finding {
        BoardFinding::Found(board) => {
            let points = board.corners.iter().copied().enumerate().collect();
            Some(View { camera: seen.list[k].camera, exposure: seen.list[k].exposure, points })
        }
        _ => None,
    };
    (0..seen.list.len()).filter_map(view).collect()
}

fn setup(config: &CalibConfig, seen: &Photographs) -> Result<Setup> {
    let camera = |(index, camera): (usize, &CameraConfig)| {
        let Some(photograph) = seen.list.iter().find(|p| p.camera == index) else {
            return Err(NoResult(format!("camera {}: none of its images can be used", camera.name)));
        };
        let held: [bool; MAX_CAMERA_PARAMS] = std::array::from_fn(|k| camera.interior.held.get(k).copied().unwrap_or(false));
        Ok(CameraSetup { width: photograph.size.0, height: photograph.size.1, model: camera.interior.model, held })
    };
    let cameras = config.cameras.iter().enumerate().map(camera).collect::<Result<Vec<_>, _>>()?;
    Ok(Setup { target: target_points(&config.target), cameras, views: views(seen) })
}

/// The calibration, and the standard deviation of a corner where each camera is calibrated alone (of several).
pub(super) fn solved(
    setup: &Setup,
    camera: &dyn Fn(usize) -> String,
    view: &dyn Fn(usize) -> String,
) -> Result<(Calibration, Vec<Option<f64>>)> {
    let n = setup.cameras.len();
    if n == 1 {
        return Ok((calibrate(setup).map_err(|e| in_names(e, camera, view))?, vec![None]));
    }
    let mut alone = Vec::with_capacity(n);
    for c in 0..n {
        let places: Vec<usize> = (0..setup.views.len()).filter(|&v| setup.views[v].camera == c).collect();
        let views = places.iter().map(|&v| View { camera: 0, ..setup.views[v].clone() }).collect();
        let of = Setup { target: setup.target.clone(), cameras: vec![setup.cameras[c]], views };
        let found = calibrate(&of).map_err(|e| in_names(e, &|_| camera(c), &|v| view(places[v])))?;
        alone.push(Some(found.sigma0_px));
    }
    let worst = alone.iter().flatten().copied().fold(0.0, f64::max);
    let contradiction = |together: String| {
        NoResult(format!(
            "the cameras contradict each other: each alone fits its images to {worst:.2} px, together {together}\n  hint: are images paired \
             that were not exposed together, did the rig move, is one camera's image mirrored?"
        ))
    };
    let found = match calibrate(setup) {
        Err(CalibrateError::NotConverged) => return Err(contradiction("they do not at all".to_owned()).into()),
        other => other.map_err(|e| in_names(e, camera, view))?,
    };
    // Where the half of the views contradict the others, the mistakes are left out, and the rest fits.
    let left_out = found.outliers.len() as f64 / (found.outliers.len() + found.observations) as f64;
    if found.sigma0_px > CONTRADICTION * worst.max(CORNER_PX) || left_out > 4.0 * MAX_OUTLIERS {
        let together = format!("to {:.2} px, with {:.0} % of the corners left out", found.sigma0_px, 100.0 * left_out);
        return Err(contradiction(together).into());
    }
    Ok((found, alone))
}

/// An error of the library, with the names of cameras and photographs in place of their numbers.
fn in_names(error: CalibrateError, camera: &dyn Fn(usize) -> String, view: &dyn Fn(usize) -> String) -> NoResult {
    let text = match error {
        CalibrateError::TooFewViews { camera: c, found, needed } => format!(
            "camera {} sees the target in {found} images, {needed} are needed, and ten are better: take more, tilted to all sides",
            camera(c)
        ),
        CalibrateError::Parallel { camera: c, angle_deg } => format!(
            "camera {}: the target is turned by {angle_deg:.1} degrees at most between its images, so that they do not tell the principal \
             distance\n  hint: tilt it by 20 degrees and more, to all sides",
            camera(c)
        ),
        CalibrateError::NoFocal { camera: c } => {
            format!(
                "camera {}: no principal distance agrees with its images\n  hint: is the board flat, and its squares square?",
                camera(c)
            )
        }
        CalibrateError::NotConnected { camera: c } => format!(
            "camera {} sees the target in no exposure in which another camera does\n  hint: are the images paired as calibration.frames_from \
             says?",
            camera(c)
        ),
        CalibrateError::Mirrored { view: v } => format!("{}: the target is mirrored", view(v)),
        CalibrateError::Degenerate { view: v } => format!("{}: the corners do not determine a plane", view(v)),
        other => other.to_string(),
    };
    NoResult(text)
}

/// Share of 4 x 4 parts of a camera's image in which corners lie.
fn coverage(setup: &Setup, camera: usize) -> f64 {
    let CameraSetup { width, height, .. } = setup.cameras[camera];
    let mut hit = [false; 16];
    for (_, p) in setup.views.iter().filter(|v| v.camera == camera).flat_map(|v| &v.points) {
        let part = |v: f64, size: u32| ((4.0 * v / f64::from(size)) as usize).min(3);
        hit[4 * part(p.y, height) + part(p.x, width)] = true;
    }
    hit.iter().filter(|h| **h).count() as f64 / 16.0
}

fn warnings(config: &CalibConfig, seen: &Photographs, found: &Calibration, coverage: &[f64]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |about: &str, message: String| warnings.push(Warning { about: about.to_owned(), message });
    for (c, camera) in config.cameras.iter().enumerate() {
        let own = || seen.list.iter().filter(|p| p.camera == c);
        let missing: Vec<&str> = own().filter(|p| !matches!(p.finding, BoardFinding::Found(_))).map(|p| p.name.as_str()).collect();
        if let Some(first) = missing.first() {
            let more = if missing.len() > 1 { format!(" and {} more", missing.len() - 1) } else { String::new() };
            warn(&camera.name, format!("the target is not found in {} of {} images: {first}{more}", missing.len(), own().count()));
        }
        if coverage[c] < MIN_COVERAGE {
            let parts = (16.0 * coverage[c]).round();
            warn(&camera.name, format!("corners lie in {parts} of 16 parts of the image: distortion is not known in the others"));
        }
        let calibrated = &found.cameras[c];
        let named = |significant: bool| -> Vec<&str> {
            let kinds = calibrated.camera.model().param_kinds();
            let of =
                calibrated.parameters.iter().zip(kinds).filter(|(p, k)| **k == ParamKind::Distortion && p.significant == Some(significant));
            of.map(|(p, _)| p.name).collect()
        };
        let weak = named(false);
        if !weak.is_empty() {
            let list = weak.join(", ");
            let message =
                format!("not different from 0 at 99 %: {list}; with `interior.fixed` that stays 0, and the others get more precise");
            warn(&camera.name, message);
        }
    }
    if found.sigma0_px > LARGE_SIGMA_PX {
        warn(
            &config.name,
            format!("corners fit to {:.2} px only: is the board flat, does the model suit the lens, are images sharp?", found.sigma0_px),
        );
    }
    let left_out = found.outliers.len() as f64 / (found.outliers.len() + found.observations) as f64;
    if left_out > MAX_OUTLIERS {
        warn(&config.name, format!("{:.0} % of the corners are left out as mistakes", 100.0 * left_out));
    }
    if config.cameras.len() > 1 && (config.target.columns + config.target.rows).is_multiple_of(2) {
        let message = "a board with an even sum of columns and rows looks the same upside down: cameras that are rolled against each other by \
                       more than 90 degrees take different corners for the first";
        warn("target", message.to_owned());
    }
    warnings
}
