//! Adjusts a model that another program, or an earlier run, made.

use crate::error::MapError;
use crate::finish::finish_start;
use crate::frames::Layout;
use crate::graph::CorrespondenceGraph;
use crate::input::{MapInput, RigMode};
use crate::model::Model;
use crate::options::OrientOptions;
use crate::orient::orientation;
use crate::summary::Orientation;
use crate::triangulation::view;
use scene::{Reconstruction, Rigid3};
use solve::triangulate::triangulate;

/// Adjusts a model with known lengths, without looking for more of it: no image, point or observation is added, and those that do not fit
/// go.
///
/// Images, cameras and keypoints of the input are those of `start`, index by index; its pairs are not used. With [`RigMode::Rigid`] the rig
/// is the one that the input gives, or where it gives none that of `start`, and an exposure has the pose of its first oriented image. Where
/// `start` has no unit, the known lengths give it. A model that this made comes out as it went in.
///
/// # Errors
/// [`MapError`] when the input contradicts itself or the start, or nothing is left.
pub fn readjust(input: &MapInput, start: &Reconstruction, options: &OrientOptions) -> Result<Orientation, MapError> {
    input.check()?;
    let sizes = |images: usize, cameras: usize| format!("{images} images by {cameras} cameras");
    let (given, wanted) = (sizes(start.images.len(), start.cameras.len()), sizes(input.images.len(), input.cameras.len()));
    if given != wanted || start.keypoints.len() != start.images.len() {
        return Err(MapError::Inconsistent(format!("a model of {given} for an input of {wanted}")));
    }
    let counts: Vec<usize> = input.keypoints.iter().map(Vec::len).collect();
    let graph = CorrespondenceGraph::new(&counts, &[]);
    let layout = match mounting(input, start) {
        Some(cam_from_rig) => Layout::rigid(input, &cam_from_rig),
        None => Layout::independent(input),
    };
    let cameras = input.cameras.iter().map(|c| c.camera).collect();
    let mut model = Model::new(input, &graph, cameras, layout.rigs, layout.frames, layout.images);
    for f in 0..model.frames.len() {
        let pose = model.frame_images[f].iter().find_map(|&i| Some(model.cam_from_rig(i).inverse() * start.cam_from_world(i)?));
        model.frames[f].rig_from_world = pose;
    }
    let moved = (0..model.images.len()).map(scene::ImageId::new).any(|i| model.cam_from_world(i) != start.cam_from_world(i));
    for point in &start.points {
        let track: Vec<_> = point.track.iter().copied().filter(|o| model.is_oriented(o.image)).collect();
        if track.len() < 2 || track.iter().any(|&o| o.keypoint.index() >= counts[o.image.index()] || model.point_of(o).is_some()) {
            continue;
        }
        // Where a rig moved the images, points move with them.
        let xyz = if moved { retriangulated(&model, &track).unwrap_or(point.xyz) } else { point.xyz };
        model.add_point(xyz, &track);
    }
    if model.point_count() == 0 {
        return Err(MapError::Inconsistent("the model has no point that two oriented images see".into()));
    }
    let done = finish_start(model, start.scale, options)?;
    if done.is_empty() {
        return Err(MapError::Inconsistent("no image of the model fits its points".into()));
    }
    Ok(orientation(input, done, Vec::new(), options))
}

/// `cam_from_rig` of each camera, where there is a rig.
fn mounting(input: &MapInput, start: &Reconstruction) -> Option<Vec<Rigid3>> {
    if input.rig.mode != RigMode::Rigid || input.cameras.len() < 2 {
        return None;
    }
    crate::frames::known_rig(input).or_else(|| {
        let rig = start.rigs.iter().find(|r| r.sensors.len() == input.cameras.len())?;
        (0..input.cameras.len()).map(|c| rig.cam_from_rig(scene::CameraId::new(c))).collect()
    })
}

fn retriangulated(model: &Model, track: &[scene::Observation]) -> Option<nalgebra::Vector3<f64>> {
    triangulate(&track.iter().filter_map(|&o| view(model, o)).collect::<Vec<_>>())
}
