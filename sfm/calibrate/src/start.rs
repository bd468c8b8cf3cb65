//! Start values of a calibration, and the check of its input.

use crate::calibration::{Setup, View};
use crate::error::CalibrateError;
use crate::plane::{focal, homography, pose};
use nalgebra::{Matrix3, Vector2};
use scene::{Camera, Rigid3};

/// Views a camera needs.
const MIN_VIEWS: usize = 3;
/// The plane of the target must turn by this much between views.
const MIN_ANGLE_DEG: f64 = 5.0;

/// Numbers of exposures are dense: a list of all of them is kept.
const MAX_EXPOSURES: usize = 1 << 20;

/// Start values.
pub(crate) struct Start {
    pub cameras: Vec<Camera>,
    /// `cam_from_rig`.
    pub sensors: Vec<Rigid3>,
    /// `rig_from_target`.
    pub exposures: Vec<Option<Rigid3>>,
}

pub(crate) fn start(setup: &Setup) -> Result<Start, CalibrateError> {
    check(setup)?;
    let homographies = setup.views.iter().enumerate().map(|(v, view)| of_view(setup, v, view)).collect::<Result<Vec<_>, _>>()?;
    let mut cameras = Vec::new();
    let mut cam_from_target: Vec<Option<Rigid3>> = vec![None; setup.views.len()];
    for (c, camera) in setup.cameras.iter().enumerate() {
        let of: Vec<usize> = (0..setup.views.len()).filter(|&v| setup.views[v].camera == c).collect();
        if of.len() < MIN_VIEWS {
            return Err(CalibrateError::TooFewViews { camera: c, found: of.len(), needed: MIN_VIEWS });
        }
        let (w, h) = (f64::from(camera.width), f64::from(camera.height));
        let centre = Vector2::new(w, h) / 2.0;
        let own: Vec<Matrix3<f64>> = of.iter().map(|&v| homographies[v]).collect();
        // Parallel planes look alike for any principal distance: one is assumed to see whether they are.
        let found = focal(&own, centre, w.max(h));
        let poses = |focal: f64| own.iter().map(|h| pose(h, focal, centre)).collect::<Option<Vec<_>>>();
        let all = poses(found.unwrap_or(w.max(h))).ok_or(CalibrateError::NoFocal { camera: c })?;
        let angle_deg = largest_angle(&all).to_degrees();
        if angle_deg < MIN_ANGLE_DEG {
            return Err(CalibrateError::Parallel { camera: c, angle_deg });
        }
        let focal = found.ok_or(CalibrateError::NoFocal { camera: c })?;
        let start = Camera::from_focal(camera.model, camera.width, camera.height, focal);
        cameras.push(start.map_err(|_| CalibrateError::NoFocal { camera: c })?);
        of.iter().zip(all).for_each(|(&v, pose)| cam_from_target[v] = Some(pose));
    }
    let (sensors, exposures) = rig(setup, &cam_from_target)?;
    Ok(Start { cameras, sensors, exposures })
}

fn check(setup: &Setup) -> Result<(), CalibrateError> {
    if setup.target.iter().any(|x| x.z != 0.0) {
        return Err(CalibrateError::NotFlat);
    }
    let good =
        |v: &View| v.camera < setup.cameras.len() && v.exposure < MAX_EXPOSURES && v.points.iter().all(|(p, _)| *p < setup.target.len());
    match setup.views.iter().position(|v| !good(v)) {
        Some(view) => Err(CalibrateError::BadIndex { view }),
        None if setup.cameras.is_empty() => Err(CalibrateError::TooFewViews { camera: 0, found: 0, needed: MIN_VIEWS }),
        None => Ok(()),
    }
}

fn of_view(setup: &Setup, v: usize, view: &View) -> Result<Matrix3<f64>, CalibrateError> {
    let plane: Vec<Vector2<f64>> = view.points.iter().map(|(p, _)| setup.target[*p].xy()).collect();
    let pixels: Vec<Vector2<f64>> = view.points.iter().map(|(_, pixel)| *pixel).collect();
    let h = homography(&plane, &pixels).ok_or(CalibrateError::Degenerate { view: v })?;
    // The sense of rotation, as H (x, y, 1) is in front.
    if h.determinant() < 0.0 { Err(CalibrateError::Mirrored { view: v }) } else { Ok(h) }
}

fn largest_angle(poses: &[Rigid3]) -> f64 {
    let normal = |p: &Rigid3| p.rotation_matrix().column(2).into_owned();
    let angles = poses.iter().flat_map(|a| poses.iter().map(move |b| normal(a).angle(&normal(b))));
    angles.fold(0.0, f64::max)
}

/// Poses of cameras and exposures from those of the views: camera after camera, by the exposures it shares with those before.
#[allow(clippy::type_complexity, reason = "poses of cameras and of exposures")]
fn rig(setup: &Setup, cam_from_target: &[Option<Rigid3>]) -> Result<(Vec<Rigid3>, Vec<Option<Rigid3>>), CalibrateError> {
    let n = setup.cameras.len();
    let mut sensors: Vec<Option<Rigid3>> = vec![None; n];
    let mut exposures: Vec<Option<Rigid3>> = vec![None; setup.views.iter().map(|v| v.exposure + 1).max().unwrap_or(0)];
    sensors[0] = Some(Rigid3::identity());
    loop {
        for (view, pose) in setup.views.iter().zip(cam_from_target) {
            if let (Some(sensor), Some(pose), None) = (sensors[view.camera], pose, exposures[view.exposure]) {
                exposures[view.exposure] = Some(sensor.inverse() * *pose);
            }
        }
        let Some(camera) = sensors.iter().position(Option::is_none) else { break };
        // Not the first but any that is joined now.
        let joined = |c: usize| -> Vec<Rigid3> {
            let views = setup.views.iter().zip(cam_from_target).filter(|(v, _)| v.camera == c);
            views.filter_map(|(v, pose)| Some((*pose)? * exposures[v.exposure]?.inverse())).collect()
        };
        let next = (0..n).filter(|&c| sensors[c].is_none()).find_map(|c| Some((c, medoid(&joined(c))?)));
        let Some((c, pose)) = next else { return Err(CalibrateError::NotConnected { camera }) };
        sensors[c] = Some(pose);
    }
    Ok((sensors.into_iter().flatten().collect(), exposures))
}

/// The pose that is nearest to all others: mistakes do not move it.
fn medoid(poses: &[Rigid3]) -> Option<Rigid3> {
    let distance = |a: &Rigid3, b: &Rigid3| {
        let length = (a.translation.norm() + b.translation.norm()).max(1e-12);
        a.rotation.angle_to(&b.rotation) + (a.translation - b.translation).norm() / length
    };
    let sum = |p: &Rigid3| poses.iter().map(|q| distance(p, q)).sum::<f64>();
    poses.iter().min_by(|a, b| sum(a).total_cmp(&sum(b))).copied()
}
