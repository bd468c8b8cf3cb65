//! Given poses of cameras in the rig that were refined, and what was found.

use crate::input::MapInput;
use crate::model::Model;
use crate::quality::CRITICAL;
use scene::{CameraId, Scale};
use solve::lie::so3_log;

/// A given pose of a camera in the rig that was refined under its standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigPoseReport {
    /// The camera.
    pub camera: CameraId,
    /// Angle between the given and the found orientation, radians.
    pub turned_rad: f64,
    /// Distance between the given and the found projection centre, metres.
    pub moved_m: f64,
    /// The largest of the six residuals, turns and shifts along the axes of the prior, over its standard deviation: above 3.3 once in 170
    /// times by chance.
    pub normalised_residual: f64,
}

/// Given and found poses in the rig; nothing of a model that is not metric.
pub(crate) fn report_rig(model: &Model, scale: Scale) -> Vec<RigPoseReport> {
    let [rig] = &model.rigs[..] else { return Vec::new() };
    if scale == Scale::Arbitrary {
        return Vec::new();
    }
    let of = |sensor: &scene::RigSensor| {
        let given = model.input.rig.poses.get(sensor.camera.index()).copied().flatten()?;
        let (sigma_rad, sigma_m) = given.sigma?;
        let turn = so3_log(&(sensor.cam_from_rig.rotation * given.cam_from_rig.rotation.inverse()));
        let shift = sensor.cam_from_rig.centre() - given.cam_from_rig.centre();
        let normalised_residual = (turn.amax() / sigma_rad).max(shift.amax() / sigma_m);
        Some(RigPoseReport { camera: sensor.camera, turned_rad: turn.norm(), moved_m: shift.norm(), normalised_residual })
    };
    // The first camera is the frame of the rig.
    rig.sensors.iter().skip(1).filter_map(of).collect()
}

/// Poses that the images contradict. Which of the two is wrong, nothing here can tell.
pub(crate) fn rig_notes<'a>(input: &'a MapInput, found: &'a [RigPoseReport]) -> impl Iterator<Item = String> + 'a {
    found.iter().filter(|r| r.normalised_residual > CRITICAL).map(|r| {
        format!(
            "the images contradict the given pose of {} in the rig: {:.3} degrees and {:.1} mm off, {:.1} standard deviations. Either the \
             mounting has changed, or the interior orientation of a camera is not true and the rig makes up for it: then hold the pose, or \
             give smaller standard deviations",
            input.cameras[r.camera.index()].name,
            r.turned_rad.to_degrees(),
            1e3 * r.moved_m,
            r.normalised_residual
        )
    })
}
