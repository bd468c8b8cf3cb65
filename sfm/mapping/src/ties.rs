//! What ties a model to the world: positions, depths and attitudes that instruments measured, and control points.

use crate::adjustment::{ProblemMap, observe};
use crate::input::ControlPointInput;
use crate::lengths::{move_world, triangulated};
use crate::model::Model;
use crate::placement::{Attitude, MAX_ROTATION_SIGMA_RAD, Place, Placement, place};
use nalgebra::Vector3;
use scene::{FrameId, Scale};
use solve::adjust::{ControlPoint, DirectionObservation, HeadingObservation, PointBlock, PositionObservation, Problem};
use std::collections::BTreeMap;

/// A unit that is known worse than this, as a share of it, is none.
const MAX_SCALE_SIGMA: f64 = 0.05;

/// Which observations of the world take part in an adjustment.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ties {
    /// Directions and headings take part.
    pub attitude: bool,
    /// Positions take part, and the control points below.
    pub places: bool,
    /// Position in the input and start of each control point that takes part.
    control: Vec<(usize, Vector3<f64>)>,
    /// They fix the whole pose of the world: which way is up and north, and where its origin is.
    pub fix_world: bool,
    /// What a user should know.
    pub notes: Vec<String>,
}

impl Ties {
    pub(crate) fn is_empty(&self) -> bool {
        !self.attitude && !self.places
    }

    /// Puts control points where the poses as they are now see them.
    pub(crate) fn update_picked(&mut self, model: &Model) {
        for (given, start) in &mut self.control {
            *start = triangulated(model, &model.input.world.control_points[*given].picks).unwrap_or(*start);
        }
    }

    /// Adds the observations to an adjustment.
    pub(crate) fn add_to(&self, problem: &mut Problem, model: &Model, map: &ProblemMap) {
        let frames = frame_of_exposure(model);
        let frame_of = |exposure: u32| map.frame(frames.get(&exposure)?.index());
        let world = &model.input.world;
        if self.attitude {
            problem.directions.extend(world.ups.iter().filter_map(|o| {
                let (in_rig, in_world) = (o.up_in_rig, Vector3::z());
                Some(DirectionObservation { frame: frame_of(o.exposure)?, in_rig, in_world, sigma_rad: o.sigma_rad })
            }));
            problem.headings.extend(world.headings.iter().filter_map(|o| {
                let (axis_in_rig, heading_rad) = (o.axis_in_rig, o.heading_rad);
                Some(HeadingObservation { frame: frame_of(o.exposure)?, axis_in_rig, heading_rad, sigma_rad: o.sigma_rad })
            }));
        }
        if self.places {
            problem.positions.extend(world.positions.iter().filter_map(|o| {
                Some(PositionObservation { frame: frame_of(o.exposure)?, in_rig: o.in_rig, xyz: o.xyz, sigma: o.sigma_m })
            }));
        }
        for &(given, start) in &self.control {
            let known = &world.control_points[given];
            let point = problem.points.len() as u32;
            problem.points.push(PointBlock { xyz: start, free: true });
            let picks = known.picks.iter().filter_map(|p| observe(model, map, p.image, point, p.pixel.into(), p.sigma_px));
            problem.observations.extend(picks);
            problem.control_points.push(ControlPoint { point, xyz: known.xyz, sigma: known.sigma_m });
        }
    }
}

/// The frame of each exposure whose pose is that of the rig: the one with the first camera.
pub(crate) fn frame_of_exposure(model: &Model) -> BTreeMap<u32, FrameId> {
    let has_reference = |f: FrameId| {
        let rig = &model.rigs[model.frames[f.index()].rig.index()];
        rig.sensors.first().is_some_and(|s| s.camera.index() == 0)
    };
    model.oriented_frames().into_iter().filter(|&f| has_reference(f)).map(|f| (model.frames[f.index()].exposure, f)).collect()
}

/// Moves the model into the world, as far as the instruments and control points tell where that is; a model without a unit gets metres
/// where they tell it.
pub(crate) fn tie(model: &mut Model, scale: &mut Scale) -> Ties {
    if model.input.world.is_empty() || model.oriented_frames().is_empty() {
        return Ties::default();
    }
    let mut ties = Ties::default();
    // Lever arms are in metres: where the unit comes from here, they count from the second time on.
    for _ in 0..2 {
        let (attitude, places) = (attitude(model), places(model, *scale));
        if attitude.is_empty() && places.is_empty() {
            return ties;
        }
        let Some(found) = place(&attitude, &places, *scale == Scale::Arbitrary) else {
            let why = "positions and control points are not used: they are fewer than three or too near a line, and nothing tells which way is up";
            return Ties { notes: vec![why.to_owned()], ..Ties::default() };
        };
        ties = taken(model, &attitude, &places, &found, scale);
    }
    let starts = model.input.world.control_points.iter().enumerate().filter(|(_, c)| ties.places && !c.check);
    ties.control = starts.filter_map(|(i, c)| Some((i, triangulated(model, &c.picks)?))).collect();
    ties
}

/// Moves the model as it was found to lie; says what of it takes part from now on.
fn taken(model: &mut Model, attitude: &Attitude, places: &[Place], found: &Placement, scale: &mut Scale) -> Ties {
    let mut notes = Vec::new();
    let is_known = |axis: usize| places.iter().any(|p| p.sigma[axis].is_finite());
    let metric = *scale == Scale::Metric || found.scale_sigma <= MAX_SCALE_SIGMA;
    let mut motion = found.world_from_model;
    if metric {
        *scale = Scale::Metric;
    } else {
        motion.scale = 1.0;
        motion.translation = Vector3::zeros();
        if !places.is_empty() {
            let percent = 100.0 * found.scale_sigma;
            notes.push(format!(
                "positions and control points are not used: they tell the unit to {percent:.0} % only; give a baseline or a scale bar"
            ));
        }
    }
    let heading = !attitude.headings.is_empty() || (metric && found.yaw_sigma_rad <= MAX_ROTATION_SIGMA_RAD);
    if !heading && metric && is_known(0) {
        notes.push("which way is north cannot be told: there is no heading, and the positions are too near each other".to_owned());
    }
    move_world(model, &motion);
    let fix_world = metric && heading && (0..3).all(is_known);
    Ties { attitude: !attitude.is_empty(), places: metric && !places.is_empty(), control: Vec::new(), fix_world, notes }
}

/// What instruments tell of directions, in the model.
fn attitude(model: &Model) -> Attitude {
    let frames = frame_of_exposure(model);
    let in_model = |exposure: u32, v: &Vector3<f64>| {
        let pose = model.frames[frames.get(&exposure)?.index()].rig_from_world?;
        Some(pose.rotation.inverse() * v)
    };
    let world = &model.input.world;
    Attitude {
        ups: world.ups.iter().filter_map(|o| Some((in_model(o.exposure, &o.up_in_rig)?, o.sigma_rad))).collect(),
        headings: world.headings.iter().filter_map(|o| Some((in_model(o.exposure, &o.axis_in_rig)?, o.heading_rad, o.sigma_rad))).collect(),
    }
}

/// Places whose coordinates are known in both.
fn places(model: &Model, scale: Scale) -> Vec<Place> {
    let frames = frame_of_exposure(model);
    let world = &model.input.world;
    let of_positions = world.positions.iter().filter_map(|o| {
        let pose = model.frames[frames.get(&o.exposure)?.index()].rig_from_world?;
        let in_rig = if scale == Scale::Metric { o.in_rig } else { Vector3::zeros() };
        Some(Place { in_model: pose.inverse().apply(&in_rig), in_world: o.xyz, sigma: o.sigma_m })
    });
    let of_control =
        world.control_points.iter().filter(|c| !c.check).filter_map(|c: &ControlPointInput| {
            Some(Place { in_model: triangulated(model, &c.picks)?, in_world: c.xyz, sigma: c.sigma_m })
        });
    of_positions.chain(of_control).collect()
}
