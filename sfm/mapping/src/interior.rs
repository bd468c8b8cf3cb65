//! Which of several start values of the interior orientation holds.

use crate::error::MapError;
use crate::incremental::{begin, grow};
use crate::initial::from_pairs;
use crate::model::Model;
use crate::options::OrientOptions;
use nalgebra::Vector2;
use scene::camera::ParamKind;
use scene::{Camera, CameraModel};

/// Frames that a trial model is grown to.
const TRIAL_FRAMES: usize = 8;
/// A trial with fewer observations than this share of the richest one's fits only because it left out what did not.
const RICH_SHARE: f64 = 0.5;
/// Largest factor by which the lens may move the corner of an image, seen from the middle.
const MAX_CORNER_STRETCH: f64 = 2.5;
/// Focal lengths of lenses, over the longer side of the image.
const FOCALS: std::ops::RangeInclusive<f64> = 0.2..=20.0;
/// Largest ratio of the two focal lengths of a camera.
const MAX_ASPECT: f64 = 1.2;

/// What a small model from one start tells.
struct Trial {
    /// What it started from.
    cameras: Vec<Camera>,
    plausible: bool,
    observations: usize,
    mean_square_px: f64,
}

/// Cameras to start from: of those in the model and the alternatives of the input, the ones with which a small model fits best.
///
/// A wrong focal length often has an adjustment run off to an absurd one that fits passably; only a start near the right one comes to
/// it, and then fits far better. Cameras are tried together: the first alternatives of all, then the second ones, and so on.
pub(crate) fn best_interior(empty: &Model, allowed: &[bool], options: &OrientOptions) -> Result<Vec<Camera>, MapError> {
    let inputs = &empty.input.cameras;
    let count = inputs.iter().map(|c| c.alternatives.len()).max().unwrap_or(0);
    if count == 0 {
        return Ok(empty.cameras.clone());
    }
    let mut trials = Vec::new();
    for k in 0..=count {
        let mut model = empty.clone();
        if k > 0 {
            for (camera, input) in model.cameras.iter_mut().zip(inputs) {
                *camera = input.alternatives.get(k - 1).copied().unwrap_or(*camera);
            }
        }
        trials.extend(trial(&model, allowed, options)?);
    }
    // One that ran off to what cannot be may fit more, loosely.
    let any_plausible = trials.iter().any(|t| t.plausible);
    trials.retain(|t| t.plausible || !any_plausible);
    let richest = trials.iter().map(|t| t.observations).max().unwrap_or(0);
    let best = trials
        .into_iter()
        .filter(|t| t.observations as f64 >= RICH_SHARE * richest as f64)
        .min_by(|a, b| a.mean_square_px.total_cmp(&b.mean_square_px));
    Ok(best.map_or_else(|| empty.cameras.clone(), |t| t.cameras))
}

/// Grows a small model, or `None` when there is none.
fn trial(empty: &Model, allowed: &[bool], options: &OrientOptions) -> Result<Option<Trial>, MapError> {
    let options = &options.growing();
    let mut model = empty.clone();
    let mut begun = false;
    for start in &from_pairs(empty, allowed, options).ranked {
        if begin(&mut model, start, options)? {
            begun = true;
            break;
        }
        model = empty.clone();
    }
    if !begun {
        return Ok(None);
    }
    grow(&mut model, allowed, TRIAL_FRAMES, options)?;
    let (mut sum, mut count) = (0.0, 0usize);
    for (_, point) in model.points() {
        for &o in &point.track {
            if let Some(error) = model.reprojection_error(&point.xyz, o) {
                sum += error * error;
                count += 1;
            }
        }
    }
    let used = |c: usize| model.oriented_images().iter().any(|i| model.images[i.index()].camera.index() == c);
    let plausible = model.cameras.iter().enumerate().all(|(c, camera)| !used(c) || is_plausible(camera));
    Ok((count > 0).then(|| Trial { cameras: empty.cameras.clone(), plausible, observations: count, mean_square_px: sum / count as f64 }))
}

/// Whether a lens can be like this.
pub(crate) fn is_plausible(camera: &Camera) -> bool {
    let camera = camera.in_air();
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    let focal = camera.mean_focal();
    let focals: Vec<f64> =
        camera.model().param_kinds().iter().zip(camera.params()).filter(|(kind, _)| **kind == ParamKind::Focal).map(|(_, f)| *f).collect();
    let square = focals.iter().all(|f| (1.0 / MAX_ASPECT..=MAX_ASPECT).contains(&(f / focal)));
    // Its image is proportional to the angle from the axis, that of the others to the tangent.
    let is_fisheye = camera.model() == CameraModel::Fisheye;
    let centre = Vector2::from(camera.principal_point());
    // A fisheye's corners may lie outside of what it images.
    let edge = if is_fisheye {
        [[0.0, height / 2.0], [width, height / 2.0], [width / 2.0, 0.0], [width / 2.0, height]]
    } else {
        [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]]
    };
    let straight = edge.iter().all(|corner| {
        let corner = Vector2::from(*corner);
        let from_axis = camera.unproject(&corner).map(|ray| if is_fisheye { ray.norm().atan() } else { ray.norm() });
        let stretch = from_axis.map(|x| x * focal / (corner - centre).norm());
        stretch.is_some_and(|s| (1.0 / MAX_CORNER_STRETCH..=MAX_CORNER_STRETCH).contains(&s))
    });
    square && straight && FOCALS.contains(&(focal / width.max(height)))
}
