//! The motion between two images as a whole.

use crate::random::SplitMix64;
use nalgebra::{Matrix3, Vector2, Vector3};
use scene::Keypoint;

/// Draws of three matches.
const DRAWS: usize = 400;
/// Matches that agree about a motion, at least.
const FEWEST: usize = 12;

/// An affine map of pixels, and how well the matches that it was made from follow it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// Distance that nine of ten of the agreeing matches keep, pixels: parallax of what is nearer or further.
    pub spread_px: f64,
}

impl Motion {
    /// Where a keypoint of the first image should be in the second.
    pub fn apply(&self, k: &Keypoint) -> Vector2<f64> {
        let at = Vector3::new(f64::from(k.x), f64::from(k.y), 1.0);
        Vector2::new(self.x.dot(&at), self.y.dot(&at))
    }
}

/// The affine map that most matches follow to within `tolerance_px`: three at a time, then least squares over those that agree. `None` where few
/// agree.
pub(super) fn estimate(matches: &[(Keypoint, Keypoint)], tolerance_px: f64, seed: u64) -> Option<Motion> {
    if matches.len() < FEWEST {
        return None;
    }
    let mut random = SplitMix64(seed);
    let mut best: Vec<usize> = Vec::new();
    for _ in 0..DRAWS {
        let three: [usize; 3] = std::array::from_fn(|_| random.below(matches.len()));
        let Some(motion) = fit(matches, &three) else { continue };
        // A camera under water neither mirrors nor doubles what it sees from one frame to the next.
        let area = motion.x.x * motion.y.y - motion.x.y * motion.y.x;
        if !(0.25..4.0).contains(&area) {
            continue;
        }
        let agreeing: Vec<usize> = (0..matches.len()).filter(|&i| miss(&motion, &matches[i]) < tolerance_px).collect();
        if agreeing.len() > best.len() {
            best = agreeing;
        }
    }
    if best.len() < FEWEST.max(matches.len() / 10) {
        return None;
    }
    let motion = fit(matches, &best)?;
    let mut misses: Vec<f64> = best.iter().map(|&i| miss(&motion, &matches[i])).collect();
    misses.sort_by(f64::total_cmp);
    Some(Motion { spread_px: misses[misses.len() * 9 / 10], ..motion })
}

fn miss(motion: &Motion, (a, b): &(Keypoint, Keypoint)) -> f64 {
    (motion.apply(a) - Vector2::new(f64::from(b.x), f64::from(b.y))).norm()
}

fn fit(matches: &[(Keypoint, Keypoint)], chosen: &[usize]) -> Option<Motion> {
    let (mut normal, mut rx, mut ry) = (Matrix3::zeros(), Vector3::zeros(), Vector3::zeros());
    for &i in chosen {
        let (a, b) = &matches[i];
        let at = Vector3::new(f64::from(a.x), f64::from(a.y), 1.0);
        normal += at * at.transpose();
        rx += at * f64::from(b.x);
        ry += at * f64::from(b.y);
    }
    let inverse = normal.cholesky()?.inverse();
    let (x, y) = (inverse * rx, inverse * ry);
    x.iter().chain(y.iter()).all(|v| v.is_finite()).then_some(Motion { x, y, spread_px: 0.0 })
}
