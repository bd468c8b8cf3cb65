//! The rig from images that were oriented one by one.

use crate::frames::Layout;
use crate::model::Model;
use nalgebra::{UnitQuaternion, Vector3};
use scene::{CameraId, ImageId, Rigid3};
use std::collections::BTreeMap;

/// Poses in the rig are averaged over those within this angle of their median.
const MAX_DEVIATION_RAD: f64 = 0.05;
/// Exposures in which a camera must be oriented together with the reference.
const MIN_EXPOSURES: usize = 2;

/// `cam_from_rig` of every camera, or the cameras that are never oriented together with the reference (camera 0).
pub(crate) fn solve_rig(model: &Model) -> Result<Vec<Rigid3>, Vec<CameraId>> {
    let mut poses = vec![Rigid3::identity()];
    let mut missing = Vec::new();
    for c in 1..model.cameras.len() {
        let camera = CameraId::new(c);
        let relative: Vec<Rigid3> = exposures(model)
            .values()
            .filter_map(|images| {
                let pose = |c: CameraId| images.iter().find(|(camera, _)| *camera == c).map(|&(_, pose)| pose);
                Some(pose(camera)? * pose(CameraId(0))?.inverse())
            })
            .collect();
        match (relative.len() >= MIN_EXPOSURES).then(|| average(&relative)) {
            Some(pose) => poses.push(pose),
            None => missing.push(camera),
        }
    }
    if missing.is_empty() { Ok(poses) } else { Err(missing) }
}

/// Poses of the oriented images of each exposure.
fn exposures(model: &Model) -> BTreeMap<u32, Vec<(CameraId, Rigid3)>> {
    let mut out: BTreeMap<u32, Vec<_>> = BTreeMap::new();
    for image in model.oriented_images() {
        let exposure = model.frames[model.images[image.index()].frame.index()].exposure;
        if let Some(pose) = model.cam_from_world(image) {
            out.entry(exposure).or_default().push((model.images[image.index()].camera, pose));
        }
    }
    out
}

/// Robust mean: the rotation with the least sum of angles to all others, then the mean of what is close to it; the
/// median of each component of the translation.
fn average(poses: &[Rigid3]) -> Rigid3 {
    let spread = |p: &Rigid3| poses.iter().map(|q| p.rotation.angle_to(&q.rotation)).sum::<f64>();
    let centre = poses.iter().min_by(|a, b| spread(a).total_cmp(&spread(b))).copied().unwrap_or_default();
    let near = poses.iter().filter(|p| p.rotation.angle_to(&centre.rotation) <= MAX_DEVIATION_RAD);
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for pose in near {
        sum += (pose.rotation * centre.rotation.inverse()).scaled_axis();
        count += 1.0;
    }
    let rotation = UnitQuaternion::from_scaled_axis(sum / f64::max(count, 1.0)) * centre.rotation;
    let component = |i: usize| {
        let mut values: Vec<f64> = poses.iter().map(|p| p.translation[i]).collect();
        values.sort_by(f64::total_cmp);
        (values[values.len() / 2] + values[(values.len() - 1) / 2]) / 2.0
    };
    Rigid3::new(rotation, Vector3::new(component(0), component(1), component(2)))
}

/// The same model with one pose an exposure. Images whose exposure is oriented through another camera get a pose.
pub(crate) fn with_rig<'a>(model: &Model<'a>, cam_from_rig: &[Rigid3]) -> Model<'a> {
    let layout = Layout::rigid(model.input, cam_from_rig);
    let mut out = Model::new(model.input, model.graph, model.cameras.clone(), layout.rigs, layout.frames, layout.images);
    for f in 0..out.frames.len() {
        // The reference camera is the lowest id; it decides where it is oriented.
        let pose = out.frame_images[f].iter().find_map(|&image: &ImageId| {
            let cam_from_world = model.cam_from_world(image)?;
            Some(out.cam_from_rig(image).inverse() * cam_from_world)
        });
        out.frames[f].rig_from_world = pose;
    }
    for (_, point) in model.points() {
        out.add_point(point.xyz, &point.track);
    }
    out
}
