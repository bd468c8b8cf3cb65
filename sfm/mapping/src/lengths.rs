//! Known lengths: baselines between cameras and scale bars in the scene.

use crate::input::{BaselineInput, ImagePick, RigMode, ScaleBarInput};
use crate::model::Model;
use crate::summary::{BaselineReport, ScaleBarReport};
use crate::ties::Ties;
use nalgebra::{Matrix3, Vector2, Vector3};
use scene::{ImageId, Scale, Similarity3};
use solve::adjust::{Baseline, ImageObservation, PointBlock, Problem, ScaleBar};
use solve::triangulate::{View, triangulate};
use std::collections::BTreeMap;

/// Steps of a weighted intersection: two or three are usual.
const WEIGHTED_STEPS: usize = 10;

/// A known length, by its position in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LengthId {
    /// A baseline.
    Baseline(usize),
    /// A scale bar.
    ScaleBar(usize),
}

/// What is known of a model besides its images, and takes part in its adjustment.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    /// What ties it to the world.
    pub ties: Ties,
    baselines: Vec<KnownBaseline>,
    bars: Vec<KnownBar>,
}

#[derive(Clone, Debug)]
struct KnownBaseline {
    /// Position in the input.
    given: usize,
    images: (ImageId, ImageId),
    length: f64,
    sigma: f64,
}

#[derive(Clone, Debug)]
struct KnownBar {
    /// Position in the input.
    given: usize,
    ends: [Vec<ImagePick>; 2],
    start: [Vector3<f64>; 2],
    length: f64,
    sigma: f64,
}

impl Known {
    /// The lengths that the oriented images of the model measure.
    pub(crate) fn lengths_of(model: &Model) -> Self {
        let rig = &model.input.rig;
        let baselines = match rig.mode {
            RigMode::None => Vec::new(),
            // One pose a frame: a baseline is one and the same in every exposure and counts once.
            RigMode::Rigid if model.rigs.len() == 1 => {
                let first = |(i, b): (usize, &BaselineInput)| Some(known(i, b, *simultaneous(model, b.cameras).first()?));
                rig.baselines.iter().enumerate().filter_map(first).collect()
            }
            // A rig that could not be solved leaves every image its own pose.
            RigMode::Rigid | RigMode::Baselines => rig
                .baselines
                .iter()
                .enumerate()
                .flat_map(|(i, b)| simultaneous(model, b.cameras).into_iter().map(move |images| known(i, b, images)))
                .collect(),
        };
        let bars = model
            .input
            .scale_bars
            .iter()
            .enumerate()
            .filter(|(_, bar)| !bar.check)
            .filter_map(|(given, bar)| {
                let start = bar_ends(model, bar)?;
                Some(KnownBar { given, ends: bar.ends.clone(), start, length: bar.length_m, sigma: bar.sigma_m })
            })
            .collect();
        Self { baselines, bars, ties: Ties::default() }
    }

    /// For each given baseline that is observed, its position in the input and those of its observations in the problem.
    pub(crate) fn baseline_groups(&self) -> Vec<(usize, Vec<usize>)> {
        let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
        for (i, b) in self.baselines.iter().enumerate() {
            match groups.last_mut().filter(|(given, _)| *given == b.given) {
                Some((_, members)) => members.push(i),
                None => groups.push((b.given, vec![i])),
            }
        }
        groups
    }

    /// Position in the input of each scale bar that takes part.
    pub(crate) fn bars_given(&self) -> Vec<usize> {
        self.bars.iter().map(|bar| bar.given).collect()
    }

    /// Forgets baselines of images that lost their pose: what remains stands in the problem one by one.
    pub(crate) fn keep_oriented(&mut self, model: &Model) {
        self.baselines.retain(|b| model.is_oriented(b.images.0) && model.is_oriented(b.images.1));
    }

    /// Puts picked points where the poses as they are now see them.
    pub(crate) fn update_picked(&mut self, model: &Model) {
        for bar in &mut self.bars {
            bar.start = bar_ends(model, &model.input.scale_bars[bar.given]).unwrap_or(bar.start);
        }
        self.ties.update_picked(model);
    }

    /// Takes a length out of the adjustment.
    pub(crate) fn without(&self, which: LengthId) -> Self {
        let mut rest = self.clone();
        match which {
            LengthId::Baseline(given) => rest.baselines.retain(|b| b.given != given),
            LengthId::ScaleBar(given) => rest.bars.retain(|b| b.given != given),
        }
        rest
    }

    /// Metres in one unit of the model: the weighted mean over all lengths of given / found.
    pub(crate) fn scale(&self, model: &Model) -> Option<f64> {
        let found = self
            .baselines
            .iter()
            .filter_map(|b| Some((distance(model, b.images)?, b.length, b.sigma)))
            .chain(self.bars.iter().map(|bar| ((bar.start[0] - bar.start[1]).norm(), bar.length, bar.sigma)));
        // Least squares of length = scale * found, each with its sigma.
        let (mut up, mut down) = (0.0, 0.0);
        for (found, given, sigma) in found {
            up += given * found / (sigma * sigma);
            down += found * found / (sigma * sigma);
        }
        (down > 0.0).then(|| up / down).filter(|s| s.is_finite() && *s > 0.0)
    }

    /// Adds the lengths to an adjustment; `sensor_of` gives frame and sensor of an image.
    pub(crate) fn add_to(
        &self,
        problem: &mut Problem,
        sensor_of: impl Fn(ImageId) -> Option<(u32, u32)>,
        observe: impl Fn(&ImagePick, u32) -> Option<ImageObservation>,
    ) {
        for b in &self.baselines {
            if let (Some(a), Some(b_end)) = (sensor_of(b.images.0), sensor_of(b.images.1)) {
                problem.baselines.push(Baseline { a, b: b_end, length: b.length, sigma: b.sigma });
            }
        }
        for bar in &self.bars {
            let first = problem.points.len() as u32;
            for (end, start) in bar.ends.iter().zip(bar.start) {
                let point = problem.points.len() as u32;
                problem.points.push(PointBlock { xyz: start, free: true });
                problem.observations.extend(end.iter().filter_map(|pick| observe(pick, point)));
            }
            problem.scale_bars.push(ScaleBar { a: first, b: first + 1, length: bar.length, sigma: bar.sigma });
        }
    }
}

fn known(given: usize, baseline: &BaselineInput, images: (ImageId, ImageId)) -> KnownBaseline {
    KnownBaseline { given, images, length: baseline.length_m, sigma: baseline.sigma_m }
}

/// Oriented images of both cameras in the same exposure.
fn simultaneous(model: &Model, cameras: (scene::CameraId, scene::CameraId)) -> Vec<(ImageId, ImageId)> {
    let mut by_exposure: BTreeMap<u32, [Option<ImageId>; 2]> = BTreeMap::new();
    for image in model.oriented_images() {
        let camera = model.images[image.index()].camera;
        let exposure = model.frames[model.images[image.index()].frame.index()].exposure;
        let slots = by_exposure.entry(exposure).or_default();
        if camera == cameras.0 {
            slots[0] = Some(image);
        }
        if camera == cameras.1 {
            slots[1] = Some(image);
        }
    }
    by_exposure.into_values().filter_map(|[a, b]| Some((a?, b?))).collect()
}

fn distance(model: &Model, images: (ImageId, ImageId)) -> Option<f64> {
    Some((model.cam_from_world(images.0)?.centre() - model.cam_from_world(images.1)?.centre()).norm())
}

/// A point from the images in which it was picked.
pub(crate) fn triangulated(model: &Model, picks: &[ImagePick]) -> Option<Vector3<f64>> {
    let views: Vec<View> = picks
        .iter()
        .filter_map(|pick| {
            let cam_from_world = model.cam_from_world(pick.image)?;
            View::new(*model.camera(pick.image), &cam_from_world, Vector2::from(pick.pixel))
        })
        .collect();
    let start = if views.len() < 2 { None } else { triangulate(&views) }?;
    // Where all weigh alike, that was it.
    let weigh_alike = picks.windows(2).all(|p| p[0].sigma_px == p[1].sigma_px);
    if weigh_alike { Some(start) } else { Some(weighted(model, picks, start)) }
}

/// The point of least weighted squares of the pixel errors, from one that is near it: Gauss-Newton.
fn weighted(model: &Model, picks: &[ImagePick], start: Vector3<f64>) -> Vector3<f64> {
    let mut xyz = start;
    for _ in 0..WEIGHTED_STEPS {
        let (normal, right) = picked_normal(model, picks, &xyz);
        let Some(factor) = normal.cholesky() else { return start };
        let step = factor.solve(&right);
        xyz -= step;
        if step.norm() <= 1e-12 * xyz.norm() {
            break;
        }
    }
    if xyz.iter().all(|v| v.is_finite()) { xyz } else { start }
}

/// Normal equations of a point in its picks.
fn picked_normal(model: &Model, picks: &[ImagePick], xyz: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for pick in picks {
        let Some(cam_from_world) = model.cam_from_world(pick.image) else { continue };
        let Some(p) = model.camera(pick.image).project_with_jacobians(&cam_from_world.apply(xyz)) else { continue };
        let j = p.d_point * cam_from_world.rotation_matrix() / pick.sigma_px;
        normal += j.transpose() * j;
        right += j.transpose() * ((p.pixel - Vector2::from(pick.pixel)) / pick.sigma_px);
    }
    (normal, right)
}

/// Both ends of a scale bar.
fn bar_ends(model: &Model, bar: &ScaleBarInput) -> Option<[Vector3<f64>; 2]> {
    Some([triangulated(model, &bar.ends[0])?, triangulated(model, &bar.ends[1])?])
}

/// Changes the unit of the world.
pub(crate) fn rescale(model: &mut Model, scale: f64) {
    move_world(model, &Similarity3::from_scale(scale));
}

/// Moves the model into another world.
pub(crate) fn move_world(model: &mut Model, new_from_old: &Similarity3) {
    for frame in &mut model.frames {
        frame.rig_from_world = frame.rig_from_world.map(|pose| pose.in_new_world(new_from_old));
    }
    for rig in &mut model.rigs {
        for sensor in &mut rig.sensors {
            sensor.cam_from_rig.translation *= new_from_old.scale;
        }
    }
    let moved: Vec<_> = model.points().map(|(id, p)| (id, new_from_old.apply(&p.xyz))).collect();
    for (id, xyz) in moved {
        model.set_xyz(id, xyz);
    }
}

/// Given and found baselines; none where the world has no metres.
pub(crate) fn report_baselines(model: &Model, scale: Scale) -> Vec<BaselineReport> {
    if scale == Scale::Arbitrary {
        return Vec::new();
    }
    let rig = &model.input.rig;
    rig.baselines
        .iter()
        .enumerate()
        .filter_map(|(index, b)| {
            let found: Vec<f64> = simultaneous(model, b.cameras).into_iter().filter_map(|images| distance(model, images)).collect();
            let n = found.len() as f64;
            (!found.is_empty()).then(|| BaselineReport {
                index,
                cameras: b.cameras,
                given_m: b.length_m,
                found_m: found.iter().sum::<f64>() / n,
                sigma_m: b.sigma_m,
                normalised_residual: (found.iter().map(|f| ((f - b.length_m) / b.sigma_m).powi(2)).sum::<f64>() / n).sqrt(),
                exposures: found.len(),
            })
        })
        .collect()
}

/// Given and found scale bars.
pub(crate) fn report_bars(model: &Model, scale: Scale, normalised: &[(LengthId, Option<f64>)]) -> Vec<ScaleBarReport> {
    let bars = model.input.scale_bars.iter().enumerate();
    bars.map(|(index, bar)| {
        let ends = bar_ends(model, bar).filter(|_| scale == Scale::Metric);
        let found_m = ends.map(|[a, b]| (a - b).norm());
        let of_check = || Some((found_m? - bar.length_m) / bar.sigma_m.hypot(picked_sigma(model, bar, &ends?)));
        let of_used = || normalised.iter().find(|(id, _)| *id == LengthId::ScaleBar(index)).and_then(|(_, w)| *w);
        let normalised_residual = if bar.check { of_check() } else { of_used() };
        ScaleBarReport { index, given_m: bar.length_m, found_m, check: bar.check, normalised_residual }
    })
    .collect()
}

/// Standard deviation of the length between the ends of a bar that comes from the picks alone.
fn picked_sigma(model: &Model, bar: &ScaleBarInput, ends: &[Vector3<f64>; 2]) -> f64 {
    let along = (ends[1] - ends[0]).normalize();
    let variance = |(picks, end): (&Vec<ImagePick>, &Vector3<f64>)| {
        picked_covariance(model, picks, end).map_or(f64::INFINITY, |c| along.dot(&(c * along)))
    };
    bar.ends.iter().zip(ends).map(variance).sum::<f64>().sqrt()
}

/// Covariance of a point that comes from its picks alone.
pub(crate) fn picked_covariance(model: &Model, picks: &[ImagePick], xyz: &Vector3<f64>) -> Option<Matrix3<f64>> {
    picked_normal(model, picks, xyz).0.try_inverse()
}
