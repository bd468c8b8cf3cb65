//! Triangulation of tracks that hold wrong observations.

use super::point::{angle, nearest_to_rays, refine_point, triangulate_two, triangulation_angle};
use super::view::View;
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Up to this many views all pairs are tried (21 pairs).
const MAX_EXHAUSTIVE_VIEWS: usize = 7;
/// Pairs drawn at most beyond.
const MAX_DRAWS: usize = 105;
/// Probability of having drawn a pair of inliers at which drawing ends.
const CONFIDENCE: f64 = 0.999_999;
/// If the point nearest to all rays misses a pixel by more than this many times the limit, the track all but certainly holds a
/// wrong observation, and refinement on all views is not tried: pairs of views decide.
const HOPELESS_FACTOR: f64 = 8.0;
/// Rounds of refinement and reselection of inliers.
const MAX_ROUNDS: usize = 3;

/// Largest angle in radians at `x` between the directions to two of the projection centres.
#[must_use]
pub fn max_triangulation_angle<'a>(centres: impl Iterator<Item = &'a Vector3<f64>> + Clone, x: &Vector3<f64>) -> f64 {
    let mut largest = 0.0f64;
    let mut rest = centres;
    while let Some(c1) = rest.next() {
        for c2 in rest.clone() {
            largest = largest.max(triangulation_angle(c1, c2, x));
        }
    }
    largest
}

/// A point from views of which some are wrong, and which ones agree with it.
///
/// If the least-squares point of all views fits all of them, it is taken. Else pairs of views whose rays differ by at least
/// `min_angle_rad` make hypotheses: all pairs up to seven views, beyond them pairs drawn with a fixed seed until one of two
/// inliers was among them with a probability of 1 - 1e-6 (105 at most). The one with the least truncated squared
/// error wins, and is refined on its inliers, which are chosen anew. The result has at least two inliers within `max_error_px`,
/// lies in front of them, and two of them see it under `min_angle_rad` or more; else `None`. The flags stand in the order of `views`. Two
/// wrong observations that agree with each other by chance can outvote a track of two good ones, and two views alone tell
/// outliers only across the epipolar line.
#[must_use]
pub fn triangulate_robust(views: &[View], max_error_px: f64, min_angle_rad: f64) -> Option<(Vector3<f64>, Vec<bool>)> {
    let limit = max_error_px * max_error_px;
    if let Some(x) = fit_of_all(views, limit) {
        let wide = max_triangulation_angle(views.iter().map(View::centre), &x) >= min_angle_rad;
        return wide.then(|| (x, vec![true; views.len()]));
    }
    if views.len() < 3 {
        return None;
    }
    let mut search = Search { views, limit, min_angle_rad, best: None };
    if views.len() <= MAX_EXHAUSTIVE_VIEWS {
        for i in 0..views.len() {
            for j in i + 1..views.len() {
                search.offer(i, j);
            }
        }
    } else {
        search.draw();
    }
    refined_on_inliers(views, search.best?.1, limit, min_angle_rad)
}

/// The least-squares point, if it agrees with every view.
fn fit_of_all(views: &[View], limit: f64) -> Option<Vector3<f64>> {
    let start = nearest_to_rays(views.iter())?;
    let within = |x: &Vector3<f64>, limit: f64| views.iter().all(|v| v.squared_error(x) <= limit);
    if views.len() > 2 && !within(&start, limit * HOPELESS_FACTOR * HOPELESS_FACTOR) {
        return None;
    }
    refine_point(views.iter(), &start).filter(|x| within(x, limit))
}

/// The best of the hypotheses so far.
struct Search<'a> {
    views: &'a [View],
    limit: f64,
    min_angle_rad: f64,
    best: Option<(f64, Vector3<f64>)>,
}

impl Search<'_> {
    /// Tries the point of two views; whether it is the best.
    fn offer(&mut self, i: usize, j: usize) -> bool {
        let (a, b) = (&self.views[i], &self.views[j]);
        if angle(a.ray_in_world(), b.ray_in_world()) < self.min_angle_rad {
            return false;
        }
        let Some(x) = triangulate_two(a, b) else {
            return false;
        };
        let bound = self.best.map_or(f64::INFINITY, |best| best.0);
        let mut cost = 0.0;
        for view in self.views {
            cost += view.squared_error(&x).min(self.limit);
            if cost >= bound {
                return false;
            }
        }
        self.best = Some((cost, x));
        true
    }

    /// Tries random pairs.
    fn draw(&mut self) {
        let len = self.views.len();
        let mut rng = ChaCha8Rng::seed_from_u64(len as u64);
        let mut below = |bound: usize| ((u64::from(rng.next_u32()) * bound as u64) >> 32) as usize;
        let mut needed = MAX_DRAWS as f64;
        let mut drawn = 0;
        while (drawn as f64) < needed {
            drawn += 1;
            let i = below(len);
            let j = below(len - 1);
            if self.offer(i, if j < i { j } else { j + 1 }) {
                let inliers = self.best.map_or(0, |(_, x)| self.views.iter().filter(|v| v.squared_error(&x) <= self.limit).count());
                let success = (inliers * inliers.saturating_sub(1)) as f64 / (len * (len - 1)) as f64;
                // Infinite for none, negative zero for all.
                needed = needed.min((1.0 - CONFIDENCE).ln() / (-success).ln_1p());
            }
        }
    }
}

fn refined_on_inliers(views: &[View], mut x: Vector3<f64>, limit: f64, min_angle_rad: f64) -> Option<(Vector3<f64>, Vec<bool>)> {
    let select = |x: &Vector3<f64>| -> Vec<bool> { views.iter().map(|v| v.squared_error(x) <= limit).collect() };
    let count = |flags: &[bool]| flags.iter().filter(|f| **f).count();
    let mut inliers = select(&x);
    for _ in 0..MAX_ROUNDS {
        if count(&inliers) < 2 {
            return None;
        }
        let used = views.iter().zip(&inliers).filter(|(_, inlier)| **inlier).map(|(v, _)| v);
        let refined = refine_point(used, &x)?;
        let reselected = select(&refined);
        // Refinement may push a marginal view over the limit; fewer inliers are no progress.
        if count(&reselected) < count(&inliers) {
            break;
        }
        x = refined;
        let settled = reselected == inliers;
        inliers = reselected;
        if settled {
            break;
        }
    }
    let centres = views.iter().zip(&inliers).filter(|(_, inlier)| **inlier).map(|(v, _)| v.centre());
    (count(&inliers) >= 2 && max_triangulation_angle(centres, &x) >= min_angle_rad).then_some((x, inliers))
}
