//! A pair from its features to the verdict.

use super::distance;
use super::image::MatchImage;
use super::motion::Motion;
use super::search::{Band, Where, search};
use crate::matching::{MatchOptions, Nearest, match_descriptors};
use crate::verify::{Guess, PairVerdict, VerifyOptions, guess, verify_from};
use nalgebra::Vector2;
use scene::KeypointIndex;

/// Options of [`match_pair`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidedOptions {
    /// Keypoints of each image that are compared with each other first, the strongest: so many, and where these do not agree so many.
    pub strongest: [usize; 2],
    /// So many of these must agree for their geometry to be believed, not only where they put the rest.
    pub min_trusted: usize,
    /// Half the width of the band about the epipolar line of a believed geometry in which matches are looked for, as a multiple of the largest error
    /// of an inlier: wide enough that right matches have rivals beside the line.
    pub band: f64,
    /// Factor of the largest ratio of the distances to the nearest and the second nearest of what is compared: of few rivals the nearest is farther than
    /// of all.
    pub ratio: f32,
}

impl Default for GuidedOptions {
    fn default() -> Self {
        Self { strongest: [600, 1800], min_trusted: 60, band: 4.0, ratio: 0.92 }
    }
}

/// Matches and verifies a pair.
///
/// The strongest keypoints are matched exhaustively and verified. If enough agree, a keypoint of the image with the lower id is compared with
/// those of the other within a window: where the agreeing matches nearest to it put it, with a margin for what differs in depth. Else every keypoint is
/// compared with every other. The tests of `matching` apply to what is compared. All matches are verified in the end, see [`crate::verify_pair`].
///
/// The window has two dimensions, no epipolar line: right matches have rivals beside it, as they have in an exhaustive scan, and the
/// geometry of the strongest decides nothing but where is looked. The order of the images does not matter. The result depends on the
/// arguments alone. Runs on one thread.
#[must_use]
pub fn match_pair(a: &MatchImage, b: &MatchImage, guided: &GuidedOptions, matching: &MatchOptions, verify: &VerifyOptions) -> PairVerdict {
    let (a, b) = if a.id() > b.id() { (b, a) } else { (a, b) };
    let guess = strongest(a, b, guided, matching, verify);
    let trusted = guess.as_ref().filter(|guess| guess.matches.len() >= guided.min_trusted);
    let matches = match &guess {
        Some(guess) => {
            let band = trusted.and_then(Guess::essential).map(|essential| {
                let focal_px = 0.5 * (a.for_pair().camera.mean_focal() + b.for_pair().camera.mean_focal());
                Band { essential, width: guided.band * verify.max_error_px / focal_px }
            });
            let matching = MatchOptions { max_ratio: guided.ratio * matching.max_ratio, ..*matching };
            near(a, b, &Where { motion: motion(a, b, guess), band }, &matching)
        }
        None => match_descriptors(&a.features().descriptors, &b.features().descriptors, matching),
    };
    verify_from(&a.for_pair(), &b.for_pair(), &matches, trusted, verify)
}

/// What the strongest keypoints say of the pair.
fn strongest(a: &MatchImage, b: &MatchImage, guided: &GuidedOptions, matching: &MatchOptions, verify: &VerifyOptions) -> Option<Guess> {
    let most = a.features().len().max(b.features().len());
    guided.strongest.into_iter().filter(|&n| n < most).find_map(|n| {
        let [first, second] = [a, b].map(|image| &image.features().descriptors[..image.features().len().min(n)]);
        guess(&a.for_pair(), &b.for_pair(), &match_descriptors(first, second, matching), verify)
    })
}

/// The motion of the image by the matches that agree.
fn motion(a: &MatchImage, b: &MatchImage, guess: &Guess) -> Motion {
    let place = |image: &MatchImage, k: KeypointIndex| {
        let keypoint = &image.features().keypoints[k.index()];
        Vector2::new(f64::from(keypoint.x), f64::from(keypoint.y))
    };
    let to: Vec<_> = guess.matches.iter().map(|m| place(b, m.1)).collect();
    Motion::new(guess.matches.iter().map(|m| place(a, m.0)).collect(), &to)
}

/// Matches within the windows.
fn near(a: &MatchImage, b: &MatchImage, place: &Where, options: &MatchOptions) -> Vec<(KeypointIndex, KeypointIndex)> {
    let found = search(&a.cells, &b.cells, place, distance::best());
    let accepted = |nearest: &Nearest| nearest.index != u32::MAX && options.accepts(nearest);
    let mutual = |i: usize, nearest: &Nearest| {
        let back = &found.of_b[nearest.index as usize];
        back.index as usize == i && accepted(back)
    };
    let chosen = found.of_a.iter().enumerate().filter(|(i, nearest)| accepted(nearest) && mutual(*i, nearest));
    chosen.map(|(i, nearest)| (KeypointIndex::new(i), KeypointIndex(nearest.index))).collect()
}
