//! Grows a model frame by frame.

use crate::adjustment::{Effort, adjust_all, adjust_around};
use crate::error::MapError;
use crate::filter::{filter_frames, filter_points};
use crate::initial::Start;
use crate::lengths::Known;
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
/// Tries of a frame before it has to wait for a model that it sees more of. A frame that was registered and lost its pose
/// again has had its try, too: else it could come and go forever.
const MAX_TRIES: u8 = 3;
/// A frame that sees this many times the points that it saw at any try before may be tried once more.
const RETRY_GROWTH: f64 = 1.2;

/// The tries of each frame.
pub(crate) type Tries = Vec<Try>;

/// How often a frame was tried, and how the last try went.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Try {
    count: u8,
    /// Most points that it saw at a try.
    seen: usize,
    pub outcome: Option<Registration>,
}

impl Try {
    /// Whether the frame, which now sees `seen` points, may be tried.
    fn begin(&mut self, seen: usize) -> bool {
        let allowed = self.count < MAX_TRIES || seen as f64 >= RETRY_GROWTH * self.seen as f64;
        if allowed {
            self.count = self.count.saturating_add(1);
            self.seen = self.seen.max(seen);
        }
        allowed
    }
}

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

/// Registers frames as long as there are any that can be and the model has fewer than `max_frames`, triangulating and adjusting on the
/// way; the last step is an adjustment of the whole.
pub(crate) fn grow(model: &mut Model, allowed: &[bool], max_frames: usize, options: &OrientOptions) -> Result<Tries, MapError> {
    let mut tries: Tries = vec![Try::default(); model.frames.len()];
    let mut adjusted = Size::of(model);
    loop {
        let is_full = model.oriented_frames().len() >= max_frames;
        let next = if is_full { None } else { register_next(model, allowed, &mut tries, options) };
        let Some(frame) = next else {
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
        let seen = model.frame_images[frame.index()].iter().map(|&i| model.visibility(i).count()).sum();
        if !tries[frame.index()].begin(seen) {
            continue;
        }
        let registration = register_frame(model, frame, options);
        tries[frame.index()].outcome = Some(registration);
        if registration == Registration::Done {
            return Some(frame);
        }
    }
    None
}

/// Effort while frames are missing.
fn growing() -> Effort {
    Effort { loss: Loss::Trivial, max_iterations: 20, function_tolerance: 1e-5 }
}

/// Adjusts, completes, merges and filters until nothing changes much. Returns the last adjustment.
pub(crate) fn refine(model: &mut Model, known: Option<&Known>, effort: Effort, options: &OrientOptions) -> Result<AdjustSummary, MapError> {
    complete_tracks(model, options);
    merge_tracks(model, options);
    let mut rounds = 0;
    loop {
        let summary = adjust_all(model, known, effort, options)?;
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
pub(crate) fn finish(model: &mut Model, known: Option<&Known>, options: &OrientOptions) -> Result<AdjustSummary, MapError> {
    retriangulate(model, options);
    refine(model, known, Effort { loss: options.loss, max_iterations: 50, function_tolerance: 1e-6 }, options)?;
    retriangulate(model, options);
    refine(model, known, Effort { loss: options.loss, max_iterations: 50, function_tolerance: 1e-6 }, options)?;
    settle(model, known, options)
}

/// Adjusts until nothing moves and nothing is left to filter.
pub(crate) fn settle(model: &mut Model, known: Option<&Known>, options: &OrientOptions) -> Result<AdjustSummary, MapError> {
    let mut rounds = 0;
    loop {
        let summary = adjust_all(model, known, Effort::last(options), options)?;
        rounds += 1;
        let mut removed = filter_points(model, options);
        // What goes with one frame may have been what held another.
        loop {
            let frames = filter_frames(model, MIN_FRAME_OBSERVATIONS);
            removed += frames;
            if frames == 0 {
                break;
            }
        }
        if removed == 0 {
            return Ok(summary);
        }
        if rounds >= MAX_ROUNDS {
            // What is told of the adjustment is of what is left.
            return adjust_all(model, known, Effort::last(options), options);
        }
    }
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
