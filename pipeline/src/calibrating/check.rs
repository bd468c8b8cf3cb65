//! Whether a calibration is still true.

use super::files::{camera_file, camera_toml, rig_toml};
use super::photographs::{self, Named, Photographs};
use super::record::Record;
use super::solve::{require_target, solved, target_points, view_of, views};
use crate::config::{ImageSource, images_of_folder};
use crate::error::{Misfit, NoResult};
use crate::progress::Progress;
use crate::store::Warning;
use anyhow::{Context, Result};
use calibrate::{CameraDrift, CameraSetup, DriftTest, KnownCamera, Setup, drift, fit_held};
use scene::camera::MAX_CAMERA_PARAMS;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Chance that cameras which did not change are told to have drifted.
const LEVEL: f64 = 0.01;
/// New corners fit worse by this with everything held, where a difference is called a drift: less moves image points by less than corners are
/// known to. Halves of one set of photographs (OpenCV's) differ beyond chance and fit worse by 1.2: errors of corners, and a board that is not quite
/// flat, are not independent, as the stated deviations take them to be.
const WORSE: f64 = 1.5;

/// What a check found. docs/calibrate.md explains the keys.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    pub verdict: Verdict,
    pub images: usize,
    pub with_target: usize,
    pub held: Held,
    pub free_sigma0_px: Option<f64>,
    pub smallest_probability: Option<f64>,
    pub limit: Option<f64>,
    pub cameras: Vec<CameraCheck>,
    pub baselines: Vec<BaselineCheck>,
    pub warnings: Vec<Warning>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// No difference beyond chance.
    Holds,
    /// A difference beyond chance that shows in the images.
    Drifted,
    /// A difference beyond chance that hardly shows in the images.
    Doubtful,
    /// The new images do not make a calibration of their own.
    Unknown,
}

impl Verdict {
    /// In words.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Holds => "the calibration holds: no difference beyond chance",
            Self::Drifted => "the calibration has drifted",
            Self::Doubtful => "doubtful: different beyond chance, but new corners fit nearly as well; is the board quite flat?",
            Self::Unknown => "not known: the new images are too few to tell",
        }
    }
}

/// The new images with everything held.
#[derive(Clone, Debug, Serialize)]
pub struct Held {
    pub sigma0_px: f64,
    pub ratio: f64,
    pub cameras: Vec<HeldCamera>,
}

#[derive(Clone, Debug, Serialize)]
pub struct HeldCamera {
    pub name: String,
    pub rms_px: Option<f64>,
}

#[derive(Clone, Debug, Serialize)]
pub struct CameraCheck {
    pub name: String,
    pub parameters: Vec<ParameterCheck>,
    pub interior: Option<TestRecord>,
    pub shift_rms_px: f64,
    pub shift_max_px: f64,
    pub turned_deg: f64,
    pub moved_m: f64,
    pub pose: Option<TestRecord>,
}

#[derive(Clone, Debug, Serialize)]
pub struct ParameterCheck {
    pub name: &'static str,
    pub before: f64,
    pub after: f64,
    pub sigma: f64,
    pub normalised: Option<f64>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub struct TestRecord {
    pub chi_square: f64,
    pub freedom: usize,
    pub probability: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct BaselineCheck {
    pub between: [String; 2],
    pub before_m: f64,
    pub after_m: f64,
    pub sigma_m: f64,
    pub normalised: f64,
}

/// Compares the calibration whose rig.toml or calibration.json is given with images in `folder`: one folder a camera, of its name, or all in it
/// where there is one camera.
///
/// # Errors
/// [`Misfit`] where files do not belong together, [`NoResult`] where the images show nothing of the target.
pub fn check(file: &Path, folder: &Path, progress: &dyn Progress) -> Result<Check> {
    let record = load(file)?;
    let known = record.cameras.iter().map(super::record::CameraRecord::known).collect::<Result<Vec<KnownCamera>>>()?;
    let sources = record.cameras.iter().map(|c| images(folder, &c.name, record.cameras.len())).collect::<Result<Vec<_>>>()?;
    let named: Vec<Named<'_>> = record.cameras.iter().map(|c| c.name.as_str()).zip(&sources).collect();
    let mut seen = photographs::read(&named, &record.target, record.frames_from, progress)?;
    require_target(&seen, &record.target, file)?;
    fitting_sizes(&seen, &record)?;
    let cameras = record.cameras.iter().zip(&known).map(|(r, k)| CameraSetup {
        width: k.camera.width(),
        height: k.camera.height(),
        model: k.camera.model(),
        held: std::array::from_fn::<_, MAX_CAMERA_PARAMS, _>(|i| r.parameters.get(i).is_some_and(|p| p.held)),
    });
    let setup = Setup { target: target_points(&record.target), cameras: cameras.collect(), views: views(&seen) };
    let fit = fit_held(&setup, &known).map_err(|e| NoResult(e.to_string()))?;
    let name = |c: usize| record.cameras[c].name.clone();
    let again = solved(&setup, &name, &|v| seen.list[view_of(&seen)[v]].name.clone());
    let mut warnings = std::mem::take(&mut seen.warnings);
    let mut check = Check {
        verdict: Verdict::Unknown,
        images: seen.list.len(),
        with_target: setup.views.len(),
        held: Held {
            sigma0_px: fit.sigma0_px,
            ratio: fit.sigma0_px / record.sigma0_px,
            cameras: fit.rms_px.iter().enumerate().map(|(c, rms)| HeldCamera { name: name(c), rms_px: *rms }).collect(),
        },
        free_sigma0_px: None,
        smallest_probability: None,
        limit: None,
        cameras: Vec::new(),
        baselines: Vec::new(),
        warnings: Vec::new(),
    };
    match again {
        Err(error) => warnings.push(Warning {
            about: record.name.clone(),
            message: format!("the new images make no calibration of their own, so that significance is not known: {error}"),
        }),
        Ok((found, _)) => {
            let drifts = drift(&known, &found).context("the cameras are not those of the calibration")?;
            check.free_sigma0_px = Some(found.sigma0_px);
            check.cameras = drifts.iter().enumerate().map(|(c, d)| camera_check(name(c), d)).collect();
            for (before, after) in record.baselines.iter().zip(&found.baselines) {
                let sigma_m = before.sigma_m.hypot(after.sigma_m);
                check.baselines.push(BaselineCheck {
                    between: before.between.clone(),
                    before_m: before.length_m,
                    after_m: after.length_m,
                    sigma_m,
                    normalised: (after.length_m - before.length_m) / sigma_m,
                });
            }
            let tests: Vec<f64> = drifts.iter().flat_map(|d| [d.interior, d.pose]).flatten().map(|t| t.probability).collect();
            // Several tests: the chance that any of them fails by chance (Bonferroni).
            let limit = LEVEL / tests.len().max(1) as f64;
            let smallest = tests.iter().copied().reduce(f64::min);
            check.verdict = match smallest {
                Some(p) if p < limit && fit.sigma0_px > WORSE * record.sigma0_px.max(found.sigma0_px) => Verdict::Drifted,
                Some(p) if p < limit => Verdict::Doubtful,
                Some(_) => Verdict::Holds,
                None => Verdict::Unknown,
            };
            (check.smallest_probability, check.limit) = (smallest, Some(limit));
        }
    }
    check.warnings = warnings;
    Ok(check)
}

fn camera_check(name: String, drift: &CameraDrift) -> CameraCheck {
    let test = |t: &DriftTest| TestRecord { chi_square: t.chi_square, freedom: t.freedom, probability: t.probability };
    let parameters = drift.parameters.iter().map(|p| ParameterCheck {
        name: p.name,
        before: p.before,
        after: p.after,
        sigma: p.sigma,
        normalised: (p.sigma > 0.0).then(|| (p.after - p.before) / p.sigma),
    });
    CameraCheck {
        name,
        parameters: parameters.collect(),
        interior: drift.interior.as_ref().map(test),
        shift_rms_px: drift.shift_rms_px,
        shift_max_px: drift.shift_max_px,
        turned_deg: drift.turned_rad.to_degrees(),
        moved_m: drift.moved_m,
        pose: drift.pose.as_ref().map(test),
    }
}

/// The record beside rig.toml, where the files beside it are still those that it was written with.
fn load(file: &Path) -> Result<Record> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let is_record = file.file_name().is_some_and(|n| n == "calibration.json");
    let path = if is_record { file.to_path_buf() } else { folder.join("calibration.json") };
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}, which `sfm calibrate` writes", path.display()))?;
    let record: Record = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    if is_record {
        return Ok(record);
    }
    let mut files: Vec<(PathBuf, String)> = vec![(file.to_path_buf(), rig_toml(&record))];
    for camera in &record.cameras {
        files.push((folder.join(camera_file(&camera.name)), camera_toml(camera)?));
    }
    for (path, written) in files {
        let now = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        if now != written {
            let hint = "  hint: give calibration.json in its place to check what was calibrated";
            return Err(Misfit(format!("{} is not as calibration.json beside it has it\n{hint}", path.display())).into());
        }
    }
    Ok(record)
}

fn images(folder: &Path, camera: &str, cameras: usize) -> Result<ImageSource> {
    let own = folder.join(camera);
    let folder = if cameras == 1 && !own.is_dir() { folder.to_path_buf() } else { own };
    let files = images_of_folder(&folder);
    if files.is_empty() {
        let hint = "put the images of each camera into a folder of its name";
        return Err(Misfit(format!("camera {camera}: no image in {}\n  hint: {hint}", folder.display())).into());
    }
    Ok(ImageSource::Files(files))
}

fn fitting_sizes(seen: &Photographs, record: &Record) -> Result<()> {
    for photograph in &seen.list {
        let camera = &record.cameras[photograph.camera];
        let (w, h) = photograph.size;
        if [w, h] != camera.size {
            let [cw, ch] = camera.size;
            return Err(
                Misfit(format!("{}: it has {w} x {h} pixels, {} was calibrated with {cw} x {ch}", photograph.name, camera.name)).into()
            );
        }
    }
    Ok(())
}
