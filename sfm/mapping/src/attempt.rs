//! Tries starts until one leads to a whole model.

use crate::error::MapError;
use crate::incremental::{Tries, begin, grow};
use crate::initial::Starts;
use crate::model::Model;
use crate::options::OrientOptions;

/// Starts that are grown at most.
const MAX_GROWN: usize = 3;
/// A model with this share of the frames that have matches at all is not tried again.
const GOOD_SHARE: f64 = 0.9;

/// The model with most oriented frames that grew from one of the starts, or `None` when no start holds.
pub(crate) fn best_model<'a>(
    empty: &Model<'a>,
    starts: &Starts,
    allowed: &[bool],
    options: &OrientOptions,
) -> Result<Option<(Model<'a>, Tries)>, MapError> {
    let options = &options.growing();
    let reachable = (0..empty.frames.len())
        .filter(|&f| allowed[f] && empty.frame_images[f].iter().any(|&i| empty.graph.link_count(i) >= options.register_min_inliers))
        .count();
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
