//! Triangulation of tracks that hold wrong observations.

use super::point::{angle, nearest_to_rays, refine_point, triangulate_two, triangulation_angle};
use super::view::View;
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Up to this many pairs of views all are tried (15 views), beyond as many are drawn.
const MAX_PAIRS: usize = 105;
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
/// If the least-squares point of all views fits all of them, it is taken. Else every pair of views whose rays differ by at least
/// `min_angle_rad` makes a hypothesis (long tracks: 105 pairs drawn with a fixed seed); the one with the least truncated squared
/// error wins, and is refined on its inliers, which are chosen anew. The result has at least two inliers within `max_error_px`,
/// lies in front of them, and two of them see it under `min_angle_rad` or more; else `None`. The flags stand in the order of `views`. Two
/// wrong observations that agree with each other by chance can outvote a track of two good ones, and two views alone tell
/// outliers only across the epipolar line.
#[must_use]
pub fn triangulate_robust(views: &[View], max_error_px: f64, min_angle_rad: f64) -> Option<(Vector3<f64>, Vec<bool>)> {
    let limit = max_error_px * max_error_px;
    if let Some(x) = nearest_to_rays(views.iter()).and_then(|start| refine_point(views.iter(), &start))
        && views.iter().all(|v| v.squared_error(&x) <= limit)
    {
        let wide = max_triangulation_angle(views.iter().map(View::centre), &x) >= min_angle_rad;
        return wide.then(|| (x, vec![true; views.len()]));
    }
    if views.len() < 3 {
        return None;
    }
    let mut best: Option<(f64, Vector3<f64>)> = None;
    for_each_pair(views.len(), |i, j| {
        if angle(views[i].ray_in_world(), views[j].ray_in_world()) < min_angle_rad {
            return;
        }
        let Some(x) = triangulate_two(&views[i], &views[j]) else {
            return;
        };
        let bound = best.map_or(f64::INFINITY, |b| b.0);
        let mut cost = 0.0;
        for view in views {
            cost += view.squared_error(&x).min(limit);
            if cost >= bound {
                return;
            }
        }
        best = Some((cost, x));
    });
    let (_, x) = best?;
    refined_on_inliers(views, x, limit, min_angle_rad)
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

/// All pairs in order, or a fixed random choice of them.
fn for_each_pair(len: usize, mut f: impl FnMut(usize, usize)) {
    if len * (len - 1) / 2 <= MAX_PAIRS {
        for i in 0..len {
            for j in i + 1..len {
                f(i, j);
            }
        }
        return;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(len as u64);
    let mut below = |bound: usize| ((u64::from(rng.next_u32()) * bound as u64) >> 32) as usize;
    for _ in 0..MAX_PAIRS {
        let i = below(len);
        let j = below(len - 1);
        f(i, if j < i { j } else { j + 1 });
    }
}
