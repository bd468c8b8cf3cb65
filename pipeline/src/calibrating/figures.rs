//! A calibration as its record.

use super::photographs::{Photographs, in_words};
use super::record::{
    BaselineRecord, CameraRecord, ImageCounts, ParameterRecord, PhotographRecord, PoseRecord, Record, RectificationRecord, wxyz,
};
use super::solve::view_of;
use crate::config::CalibConfig;
use anyhow::Result;
use calibrate::{CalibratedCamera, Calibration, Setup, rectify};
use nalgebra::Vector2;
use std::collections::{BTreeMap, BTreeSet};

/// A calibration with all that it came from.
pub(super) struct Solved<'a> {
    pub config: &'a CalibConfig,
    pub seen: &'a Photographs,
    pub setup: &'a Setup,
    pub calibration: &'a Calibration,
    /// Standard deviation of a corner of each camera alone.
    pub alone: &'a [Option<f64>],
    /// Share of the parts of the image with corners, of each camera.
    pub coverage: &'a [f64],
}

pub(super) fn record(solved: &Solved<'_>) -> Result<Record> {
    let Solved { config, seen, setup, calibration, .. } = solved;
    let name = |c: usize| config.cameras[c].name.clone();
    let between = |(a, b): (usize, usize)| [name(a), name(b)];
    let baselines = calibration.baselines.iter();
    let exposures: BTreeSet<usize> = setup.views.iter().map(|v| v.exposure).collect();
    Ok(Record {
        name: config.name.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        target: config.target,
        frames_from: config.frames_from,
        images: ImageCounts { found: seen.looked_at, total: seen.list.len(), with_target: setup.views.len() },
        exposures: exposures.len(),
        observations: calibration.observations,
        outliers: calibration.outliers.len(),
        rms_px: calibration.rms_px,
        sigma0_px: calibration.sigma0_px,
        cameras: (0..config.cameras.len()).map(|c| camera(solved, c)).collect(),
        baselines: baselines.map(|b| BaselineRecord { between: between(b.cameras), length_m: b.length_m, sigma_m: b.sigma_m }).collect(),
        rectifications: rectifications(solved),
        photographs: photographs(solved),
        warnings: seen.warnings.clone(),
    })
}

fn camera(solved: &Solved<'_>, c: usize) -> CameraRecord {
    let found = &solved.calibration.cameras[c];
    let n = found.parameters.len();
    let parameters = found.parameters.iter().enumerate().map(|(k, p)| ParameterRecord {
        name: p.name.to_owned(),
        value: p.value,
        sigma: p.sigma,
        held: solved.setup.cameras[c].held[k],
        significant: p.significant,
    });
    CameraRecord {
        name: solved.config.cameras[c].name.clone(),
        model: found.camera.model().name().to_owned(),
        size: [found.camera.width(), found.camera.height()],
        images: solved.seen.list.iter().filter(|p| p.camera == c).count(),
        with_target: solved.setup.views.iter().filter(|v| v.camera == c).count(),
        observations: found.observations,
        rms_px: found.rms_px,
        sigma0_alone_px: solved.alone[c],
        coverage: solved.coverage[c],
        parameters: parameters.collect(),
        correlations: (0..n).map(|i| (0..n).map(|j| found.correlations[(i, j)]).collect()).collect(),
        pose: pose(found),
    }
}

fn pose(found: &CalibratedCamera) -> PoseRecord {
    let s = found.sigma_pose;
    PoseRecord {
        quaternion_wxyz: wxyz(&found.cam_from_rig.rotation),
        translation_m: found.cam_from_rig.translation.into(),
        sigma_rotation_deg: [s[0], s[1], s[2]].map(f64::to_degrees),
        sigma_translation_m: [s[3], s[4], s[5]],
        covariance: found.pose_covariance.map(|m| std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))),
    }
}

/// Every pair of cameras that can be rectified and saw corners at one time.
fn rectifications(solved: &Solved<'_>) -> Vec<RectificationRecord> {
    let cameras = &solved.calibration.cameras;
    let pairs = (0..cameras.len()).flat_map(|a| (a + 1..cameras.len()).map(move |b| (a, b)));
    let of = |(a, b): (usize, usize)| {
        let (first, second) = (&cameras[a], &cameras[b]);
        let made = rectify(&first.camera, &second.camera, &(second.cam_from_rig * first.cam_from_rig.inverse()))?;
        let error = made.error([&first.camera, &second.camera], &shared(solved, a, b))?;
        Some(RectificationRecord {
            between: [a, b].map(|c| solved.config.cameras[c].name.clone()),
            focal_px: made.focal_px,
            principal_px: made.principal_px,
            rectified_from_cam_wxyz: made.rotations.map(|r| wxyz(&r)),
            points: error.points,
            mean_px: error.mean_px,
            rms_px: error.rms_px,
            max_px: error.max_px,
        })
    };
    pairs.filter_map(of).collect()
}

/// Corners that two cameras saw at one time, mistakes left out.
fn shared(solved: &Solved<'_>, a: usize, b: usize) -> Vec<[Vector2<f64>; 2]> {
    let outliers: BTreeSet<(usize, usize)> = solved.calibration.outliers.iter().copied().collect();
    let mut first: BTreeMap<(usize, usize), Vector2<f64>> = BTreeMap::new();
    let mut pairs = Vec::new();
    for camera in [a, b] {
        for (v, view) in solved.setup.views.iter().enumerate().filter(|(_, view)| view.camera == camera) {
            for (_, (point, pixel)) in view.points.iter().enumerate().filter(|(k, _)| !outliers.contains(&(v, *k))) {
                if camera == a {
                    first.insert((view.exposure, *point), *pixel);
                } else if let Some(other) = first.get(&(view.exposure, *point)) {
                    pairs.push([*other, *pixel]);
                }
            }
        }
    }
    pairs
}

fn photographs(solved: &Solved<'_>) -> Vec<PhotographRecord> {
    let residuals = solved.calibration.residuals(solved.setup);
    let of_view: BTreeMap<usize, usize> =
        view_of(solved.seen).into_iter().enumerate().map(|(view, photograph)| (photograph, view)).collect();
    let one = |(k, photograph): (usize, &super::photographs::Photograph)| {
        let view = of_view.get(&k);
        let left_out = |v: usize, place: usize| solved.calibration.outliers.contains(&(v, place));
        let errors: Vec<f64> = view.map_or_else(Vec::new, |&v| {
            let of = residuals[v].iter().enumerate().filter(|(place, _)| !left_out(v, *place));
            of.filter_map(|(_, r)| r.map(|r| r.norm_squared())).collect()
        });
        let corners = view.map_or(0, |&v| solved.setup.views[v].points.len());
        PhotographRecord {
            name: photograph.name.clone(),
            exposure: photograph.exposure,
            target: in_words(&photograph.finding),
            corners,
            left_out: view.map_or(0, |&v| solved.calibration.outliers.iter().filter(|o| o.0 == v).count()),
            rms_px: (!errors.is_empty()).then(|| (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()),
        }
    };
    solved.seen.list.iter().enumerate().map(one).collect()
}
