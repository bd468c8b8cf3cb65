//! What of the scene a camera can tell from the water before it.

use super::blur::blur;
use super::shade::Arriving;
use crate::appearance::Response;
use rayon::prelude::*;
use scene::{Mask, Raster};

/// What a ray brings home, taken apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Apart {
    /// Light that comes straight from the surface; nothing where there is none.
    pub own: [f32; 3],
    /// Light of endless water along the same ray.
    pub water: [f32; 3],
}

/// Standard deviation of the neighbourhood that is looked at, as a share of the width: a single dark pixel of a surface that shows all around is seen.
const NEIGHBOURHOOD: f32 = 0.004;
/// Standard deviation of rounding to whole grey values.
const ROUNDING: f32 = 0.289;

/// 255 where `is_static` holds and the surface can be told from water, 0 elsewhere.
///
/// A surface is told by its own light, which carries all detail on it, or by its difference from the water that would be seen in its place (a black body before bright
/// water; Duntley, *The visibility of submerged objects*, 1952). Either has to change some channel by one standard deviation of the noise: then a detail of 5 x 5 pixels,
/// about the smallest that is matched, reaches a signal to noise ratio of 5, from which details are told with certainty (Rose, *J. Opt. Soc. Am.* 38, 1948). Light that the
/// water adds, and surface light that it spreads, show nothing.
pub(super) fn visible(light: &[Arriving], apart: &[Apart], is_static: &[bool], width: usize, response: &Response) -> Mask {
    let contrast = |((light, apart), &is_static): ((&Arriving, &Apart), &bool)| {
        if !is_static {
            return [0.0; 3];
        }
        let seen: [f32; 3] = std::array::from_fn(|c| light.straight[c] + light.spread[c]);
        let without: [f32; 3] = std::array::from_fn(|c| (seen[c] - apart.own[c]).max(0.0));
        let [seen, without, water] = [seen, without, apart.water].map(|l| response.grey(l));
        let most = (0..3).fold(0f32, |most, c| most.max((seen[c] - without[c]).abs()).max((seen[c] - water[c]).abs()));
        [most, 1.0, 0.0]
    };
    let mut sums: Vec<[f32; 3]> = light.par_iter().zip(apart).zip(is_static).map(contrast).collect();
    blur(&mut sums, width, (NEIGHBOURHOOD * width as f32).max(1.0));
    let least = response.noise.hypot(ROUNDING);
    let values = sums.iter().zip(is_static).map(|(sum, &is)| if is && sum[0] >= least * sum[1] { 255 } else { 0 }).collect();
    Raster::from_vec(width, is_static.len() / width, values).expect("one value a pixel")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Full scale at light 1.
    const RESPONSE: Response = Response { gain: [1.0; 3], crosstalk: 0.0, noise: 2.0 };

    /// Whether a wall of that own light is seen, `veil` before it and `water` in its place.
    fn seen(own: f32, veil: f32, water: f32) -> bool {
        let light = vec![Arriving { straight: [own + veil; 3], spread: [0.0; 3] }; 400];
        let apart = vec![Apart { own: [own; 3], water: [water; 3] }; 400];
        let mask = visible(&light, &apart, &[true; 400], 20, &RESPONSE);
        assert!(mask.data().iter().all(|v| *v == mask.data()[0]));
        mask.data()[0] == 255
    }

    #[test]
    fn a_surface_shows_by_its_own_light_or_before_the_water() {
        // At the grey of 118 (light 0.18) a grey value is 0.0034 of light: 255 d(sRGB)/dv = 255 * 1.055 / 2.4 * 0.18^(-1.4/2.4) = 305.
        assert!(seen(0.01, 0.17, 0.18), "3 grey values of its own, none from the water");
        assert!(!seen(0.003, 0.177, 0.18), "less than one grey value");
        assert!(seen(0.0, 0.05, 0.18), "a black body near by, before bright water");
        assert!(!seen(0.0, 0.18, 0.18), "a black body far away");
    }

    #[test]
    fn what_moves_and_water_is_not_structure_and_dark_specks_of_a_wall_are() {
        let light = vec![Arriving { straight: [0.2; 3], spread: [0.0; 3] }; 400];
        let mut apart = vec![Apart { own: [0.05; 3], water: [0.2; 3] }; 400];
        apart[210].own = [0.0; 3];
        let is_static: Vec<bool> = (0..400).map(|i| i % 20 < 15).collect();
        let mask = visible(&light, &apart, &is_static, 20, &RESPONSE);
        for (i, &value) in mask.data().iter().enumerate() {
            assert_eq!(value == 255, is_static[i], "{i}");
        }
    }
}
