//! Chooses the way to a model: all frames at once, or from starts until one leads to a whole model.

use crate::error::MapError;
use crate::global::global_model;
use crate::incremental::{Tries, begin, grow};
use crate::initial::Starts;
use crate::model::Model;
use crate::options::{Mapper, OrientOptions};

/// Starts that are grown at most.
const MAX_GROWN: usize = 3;
/// A model with this share of the frames that have matches at all is not tried again.
const GOOD_SHARE: f64 = 0.9;

/// Fewer frames than this are oriented one after the other: that is quick, and as good.
const GLOBAL_FROM_FRAMES: usize = 30;

/// What [`model_of`] comes to.
pub(crate) enum Attempt<'a> {
    /// A model, the tries of its frames, and how it was made.
    Model(Box<Model<'a>>, Tries, Made),
    /// No start held.
    NoModel(Starts),
}

/// How a model was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Made {
    /// All at once, and not one by one.
    pub global: bool,
    /// Why.
    pub reason: String,
}

/// The best model of the allowed frames; `starts` are looked for where one is needed. `metric` says that the rig gives the unit.
pub(crate) fn model_of<'a>(
    empty: &Model<'a>,
    starts: impl FnOnce() -> Starts,
    allowed: &[bool],
    metric: bool,
    options: &OrientOptions,
) -> Result<Attempt<'a>, MapError> {
    let frames = allowed.iter().filter(|a| **a).count();
    let unknown = empty.input.cameras.iter().find(|c| !c.alternatives.is_empty());
    let (global, reason) = match (options.mapper, unknown) {
        (Mapper::Global, _) => (true, "asked for".to_owned()),
        (Mapper::Incremental, _) => (false, "asked for".to_owned()),
        (Mapper::Auto, Some(camera)) => (false, format!("nothing is known of the interior orientation of {}", camera.name)),
        (Mapper::Auto, None) if frames < GLOBAL_FROM_FRAMES => (false, format!("{frames} frames are few")),
        (Mapper::Auto, None) => (true, format!("{frames} frames, interior orientation known")),
    };
    let mut fallen = None;
    if global {
        let found = global_model(empty, allowed, metric, options)?;
        let reachable = reachable(empty, allowed, options);
        match found {
            Some((model, tries)) if model.oriented_frames().len() as f64 >= GOOD_SHARE * reachable as f64 => {
                return Ok(Attempt::Model(Box::new(model), tries, Made { global, reason }));
            }
            found => fallen = Some(found),
        }
    }
    let starts = starts();
    let grown = best_model(empty, &starts, allowed, options)?;
    let size = |m: &Model| (m.oriented_frames().len(), m.observation_count());
    Ok(match (fallen, grown) {
        (Some(Some((model, tries))), grown) if grown.as_ref().is_none_or(|(g, _)| size(g) <= size(&model)) => {
            Attempt::Model(Box::new(model), tries, Made { global, reason })
        }
        (Some(found), Some((model, tries))) => {
            let oriented = found.map_or(0, |(m, _)| m.oriented_frames().len());
            let reason = format!("all at once oriented only {oriented} of {frames} frames");
            Attempt::Model(Box::new(model), tries, Made { global: false, reason })
        }
        (None, Some((model, tries))) => Attempt::Model(Box::new(model), tries, Made { global: false, reason }),
        (_, None) => Attempt::NoModel(starts),
    })
}

/// Frames that have matches at all.
fn reachable(empty: &Model, allowed: &[bool], options: &OrientOptions) -> usize {
    (0..empty.frames.len())
        .filter(|&f| allowed[f] && empty.frame_images[f].iter().any(|&i| empty.graph.link_count(i) >= options.register_min_inliers))
        .count()
}

/// The model with most oriented frames that grew from one of the starts, or `None` when no start holds.
fn best_model<'a>(
    empty: &Model<'a>,
    starts: &Starts,
    allowed: &[bool],
    options: &OrientOptions,
) -> Result<Option<(Model<'a>, Tries)>, MapError> {
    let options = &options.growing();
    let reachable = reachable(empty, allowed, options);
    let mut best: Option<(Model, Tries)> = None;
    let mut grown = 0;
    for start in &starts.ranked {
        // Two starts that one model holds lead to the same model.
        if best.as_ref().is_some_and(|(m, _)| start.poses.iter().all(|(f, _)| m.frames[f.index()].rig_from_world.is_some())) {
            continue;
        }
        let mut model = empty.clone();
        if !begin(&mut model, start, options)? {
            continue;
        }
        let tries = grow(&mut model, allowed, usize::MAX, options)?;
        grown += 1;
        let size = |m: &Model| (m.oriented_frames().len(), m.observation_count());
        let enough = model.oriented_frames().len() as f64 >= GOOD_SHARE * reachable as f64;
        if best.as_ref().is_none_or(|(b, _)| size(&model) > size(b)) {
            best = Some((model, tries));
        }
        if enough || grown == MAX_GROWN {
            break;
        }
    }
    Ok(best)
}
