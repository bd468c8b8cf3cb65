//! Grows a model frame by frame.

use crate::adjustment::{Effort, adjust_all, adjust_around};
use crate::error::MapError;
use crate::filter::{filter_frames, filter_points};
use crate::initial::Start;
use crate::lengths::Lengths;
use crate::model::Model;
use crate::options::OrientOptions;
use crate::register::{Registration, candidates, register_frame};
use crate::triangulation::{complete_tracks, merge_tracks, retriangulate, triangulate_frame};
use scene::FrameId;
use solve::adjust::{AdjustSummary, Loss};

/// Frames adjusted together with a new one.
const LOCAL_NEIGHBOURS: usize = 5;
/// The whole model is adjusted when it has grown by this factor since the last time.
const GROWTH: f64 = 1.1;
/// Rounds of adjustment, completion and filtering at most.
const MAX_ROUNDS: usize = 5;
/// Rounds stop when a smaller share of the observations changed.
const SETTLED_SHARE: f64 = 5e-4;
/// A frame that sees fewer points loses its pose.
const MIN_FRAME_OBSERVATIONS: usize = 12;
/// Times that a frame may fail before it is left out.
const MAX_TRIES: u8 = 3;

/// How the last try of each frame went.
pub(crate) type Tries = Vec<(u8, Option<Registration>)>;

/// Poses the first frames, makes points and adjusts. Returns whether enough points stand.
pub(crate) fn begin(model: &mut Model, start: &Start, options: &OrientOptions) -> Result<bool, MapError> {
    for &(frame, pose) in &start.poses {
        model.frames[frame.index()].rig_from_world = Some(pose);
    }
    let narrow = OrientOptions { min_angle_deg: options.min_angle_deg.min(start.angle_rad.to_degrees() / 2.0), ..options.clone() };
    for &(frame, _) in &start.poses {
        triangulate_frame(model, frame, &narrow);
    }
    adjust_all(model, None, Effort { loss: Loss::SoftL1 { scale_px: 1.0 }, max_iterations: 30, function_tolerance: 1e-6 }, options)?;
    filter_points(model, &narrow);
    Ok(model.point_count() >= options.initial_min_inliers / 2)
}

/// Registers all frames that can be, triangulating and adjusting on the way.
pub(crate) fn grow(model: &mut Model, allowed: &[bool], options: &OrientOptions) -> Result<Tries, MapError> {
    let mut tries: Tries = vec![(0, None); model.frames.len()];
    let mut adjusted = Size::of(model);
    loop {
        let Some(frame) = register_next(model, allowed, &mut tries, options) else {
            if adjusted == Size::of(model) {
                return Ok(tries);
            }
            // A better model may see what the frames that failed show.
            refine(model, None, growing(), options)?;
            adjusted = Size::of(model);
            continue;
        };
        triangulate_frame(model, frame, options);
        if adjusted.is_outgrown(model) {
            refine(model, None, growing(), options)?;
            adjusted = Size::of(model);
        } else {
            adjust_around(model, frame, LOCAL_NEIGHBOURS, options)?;
            filter_points(model, options);
        }
    }
}

fn register_next(model: &mut Model, allowed: &[bool], tries: &mut Tries, options: &OrientOptions) -> Option<FrameId> {
    for frame in candidates(model, allowed, options) {
        let (failures, outcome) = &mut tries[frame.index()];
        if *failures >= MAX_TRIES {
            continue;
        }
        let registration = register_frame(model, frame, options);
        *outcome = Some(registration);
        if registration == Registration::Done {
            return Some(frame);
        }
        *failures += 1;
    }
    None
}

/// Effort while frames are missing.
fn growing() -> Effort {
    Effort { loss: Loss::Trivial, max_iterations: 20, function_tolerance: 1e-5 }
}

/// Adjusts, completes, merges and filters until nothing changes much. Returns the last adjustment.
pub(crate) fn refine(
    model: &mut Model,
    lengths: Option<&Lengths>,
    effort: Effort,
    options: &OrientOptions,
) -> Result<AdjustSummary, MapError> {
    complete_tracks(model, options);
    merge_tracks(model, options);
    let mut rounds = 0;
    loop {
        let summary = adjust_all(model, lengths, effort, options)?;
        rounds += 1;
        let mut changed = complete_tracks(model, options) + merge_tracks(model, options);
        changed += filter_points(model, options);
        filter_frames(model, MIN_FRAME_OBSERVATIONS);
        if rounds >= MAX_ROUNDS || changed as f64 <= SETTLED_SHARE * model.observation_count() as f64 {
            return Ok(summary);
        }
    }
}

/// The last adjustments: everything that can be triangulated is, and the optimum is reached.
pub(crate) fn finish(model: &mut Model, lengths: Option<&Lengths>, options: &OrientOptions) -> Result<AdjustSummary, MapError> {
    retriangulate(model, options);
    refine(model, lengths, Effort { loss: options.loss, max_iterations: 50, function_tolerance: 1e-6 }, options)?;
    retriangulate(model, options);
    refine(model, lengths, Effort { loss: options.loss, max_iterations: 50, function_tolerance: 1e-6 }, options)?;
    let summary = adjust_all(model, lengths, Effort { loss: options.loss, max_iterations: 100, function_tolerance: 1e-10 }, options)?;
    filter_points(model, options);
    Ok(summary)
}

#[derive(Clone, Copy, PartialEq)]
struct Size {
    frames: usize,
    points: usize,
}

impl Size {
    fn of(model: &Model) -> Self {
        Self { frames: model.oriented_frames().len(), points: model.point_count() }
    }

    fn is_outgrown(self, model: &Model) -> bool {
        let now = Self::of(model);
        now.frames as f64 >= GROWTH * self.frames as f64 || now.points as f64 >= GROWTH * self.points as f64
    }
}
