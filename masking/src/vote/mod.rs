//! A vote of neighbouring exposures on a mask.

mod motion;

pub use motion::{Affine, Glimpse, motion};

use crate::{BitMask, dilate, erode, keep_components};
use scene::Mask;

/// The mask of a neighbouring exposure of the same camera.
#[derive(Clone, Copy, Debug)]
pub struct Neighbour<'a> {
    /// Of the same size.
    pub mask: &'a Mask,
    /// Where a place of the image that is voted on lies in the neighbour.
    pub motion: Affine,
}

/// How far from the border of structure a neighbour is sure, as a share of the long side: motions are coarse, and what is near moves farther than what is far.
const UNSURE: f64 = 0.02;

/// A mask corrected by those of the exposures before and after it.
///
/// A pixel changes where most of the earlier neighbours and most of the later ones contradict the mask. What the motion between images gets wrong (parallax above all) moves the border
/// to one side in an earlier image and to the other in a later one, so that both together seldom err in the same place. To be safe a change starts only where they are sure, farther than 2 % of
/// the long side from the border of their structure, and spreads from there over what they contradict: hysteresis as in Canny's edge detector (PAMI 1986).
///
/// Without a neighbour on both sides nothing changes. Neighbours of another size have no vote.
#[must_use]
pub fn vote(mask: &Mask, earlier: &[Neighbour<'_>], later: &[Neighbour<'_>]) -> Mask {
    let (width, height) = (mask.width(), mask.height());
    let fits = |n: &&Neighbour<'_>| (n.mask.width(), n.mask.height()) == (width, height);
    let warped = |side: &[Neighbour<'_>]| -> Vec<Seen> { side.iter().filter(fits).map(seen).collect() };
    let sides = [warped(earlier), warped(later)];
    if sides.iter().any(Vec::is_empty) || mask.data().is_empty() {
        return mask.clone();
    }
    let own = BitMask::from_mask(mask);
    let mut corrected = own.clone();
    for structure in [true, false] {
        let [sure, likely] = [true, false].map(|sure| {
            let of_side = |side: &Vec<Seen>| majority(side, structure, sure);
            of_side(&sides[0]).and(&of_side(&sides[1]))
        });
        let against = if structure { own.not() } else { own.clone() };
        let change = keep_components(&likely.and(&against), &sure.and(&against), |_, sure| sure > 0);
        corrected = if structure { united(corrected, &change) } else { corrected.and(&change.not()) };
    }
    corrected.to_mask(width, height, 1)
}

/// What a neighbour says of each pixel of the image: structure or background, likely or for sure; nothing of what lies outside of it.
struct Seen {
    likely: [BitMask; 2],
    sure: [BitMask; 2],
}

fn seen(neighbour: &Neighbour<'_>) -> Seen {
    let (mask, motion) = (neighbour.mask, &neighbour.motion);
    let (width, height) = (mask.width(), mask.height());
    let unsure = (UNSURE * width.max(height) as f64).round().max(1.0) as usize;
    let structure = BitMask::from_mask(mask);
    let sure = [dilate(&structure, unsure).not(), erode(&structure, unsure)];
    let empty = || [BitMask::new(width, height), BitMask::new(width, height)];
    let (mut likely_here, mut sure_here) = (empty(), empty());
    for y in 0..height {
        // Along a row the place moves by a constant step.
        let (start, step) = motion.along_row(y, width, height);
        for x in 0..width {
            let (u, v) = (start[0] + step[0] * x as f64, start[1] + step[1] * x as f64);
            // A place outside turns negative, or too large for the mask.
            if u < 0.0 || v < 0.0 || u >= width as f64 || v >= height as f64 {
                continue;
            }
            let (u, v) = (u as usize, v as usize);
            likely_here[usize::from(structure.get(u, v))].set(x, y);
            for (sure, here) in sure.iter().zip(&mut sure_here) {
                if sure.get(u, v) {
                    here.set(x, y);
                }
            }
        }
    }
    Seen { likely: likely_here, sure: sure_here }
}

/// Where more neighbours say one thing (for sure, if `sure`) than say the other at all.
fn majority(side: &[Seen], structure: bool, sure: bool) -> BitMask {
    let of =
        |seen: &'_ Seen, value: bool, sure: bool| -> BitMask { (if sure { &seen.sure } else { &seen.likely })[usize::from(value)].clone() };
    if let [one] = side {
        return of(one, structure, sure);
    }
    let first = &side[0].likely[0];
    let mut counts = vec![0i8; first.width() * first.height()];
    for seen in side {
        for (value, weight) in [(structure, 1i8), (!structure, -1)] {
            let bits = of(seen, value, sure && value == structure);
            for (y, row) in counts.chunks_exact_mut(first.width()).enumerate() {
                row.iter_mut().enumerate().filter(|(x, _)| bits.get(*x, y)).for_each(|(_, count)| *count += weight);
            }
        }
    }
    BitMask::from_test(first.width(), first.height(), &counts, |count| count > 0)
}

fn united(mut a: BitMask, b: &BitMask) -> BitMask {
    a.or(b);
    a
}

#[cfg(test)]
mod tests;
