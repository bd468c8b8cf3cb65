//! Where points of the scene are seen, as a person would pick them.

use super::scene::DiveScene;
use crate::random::{Random, mix};
use nalgebra::Vector3;

/// Standard deviation of the picks, pixels: as good as a careful person.
pub const PICK_SIGMA_PX: f64 = 0.3;
/// Picks keep away from the border of the frame, pixels.
const BORDER_PX: f64 = 4.0;
/// What stands before a point by more than this hides it, metres: the point may lie on an edge.
const EDGE_M: f64 = 0.005;

/// Where a point of the scene is seen in a frame, measured by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Which camera.
    pub camera: usize,
    /// Which exposure.
    pub exposure: usize,
    /// Pixel; the middle of the top-left one is (0.5, 0.5).
    pub pixel: [f64; 2],
    /// Distance of the point from the camera, metres.
    pub distance_m: f64,
}

impl DiveScene {
    /// Picks of a point on the surface in every frame that shows it, camera after camera.
    #[must_use]
    pub fn picks(&self, point: &Vector3<f64>) -> Vec<Pick> {
        let frames = (0..self.cameras.len()).flat_map(|c| (0..self.exposures()).map(move |e| (c, e)));
        frames.filter_map(|(camera, exposure)| self.pick(point, camera, exposure)).collect()
    }

    fn pick(&self, point: &Vector3<f64>, camera: usize, exposure: usize) -> Option<Pick> {
        let pixel = self.project(point, camera, exposure)?;
        let inside = |v: f64, size: u32| v > BORDER_PX && v < f64::from(size) - BORDER_PX;
        let centre = self.cam_from_world(camera, exposure).centre();
        if !inside(pixel.x, self.options.rig.width) || !inside(pixel.y, self.options.rig.height) || self.is_hidden(point, &centre) {
            return None;
        }
        let key = point.iter().fold((camera as u64) << 32 | exposure as u64, |key, v| mix(key ^ v.to_bits()));
        let mut random = Random::new(key ^ self.options.seed);
        // Written down to a tenth of a pixel, as people do.
        let pixel = [pixel.x, pixel.y].map(|v| (10.0 * (v + PICK_SIGMA_PX * random.normal())).round() / 10.0);
        Some(Pick { camera, exposure, pixel, distance_m: (point - centre).norm() })
    }

    /// Whether something that stays stands before a point of the surface.
    pub(super) fn is_hidden(&self, point: &Vector3<f64>, from: &Vector3<f64>) -> bool {
        let distance = (point - from).norm();
        self.tracer.ray(from, &((point - from) / distance)).is_some_and(|hit| hit.distance < distance - EDGE_M)
    }
}

#[cfg(test)]
mod tests {
    use super::super::DiveOptions;
    use super::*;

    #[test]
    fn ends_of_bars_are_picked_near_their_projections() {
        let dive = DiveScene::new(&DiveOptions::small(16, 640, 400)).expect("possible");
        assert_eq!(dive.world.bars.len(), 2);
        for bar in &dive.world.bars {
            for end in &bar.ends {
                let picks = dive.picks(end);
                assert!(picks.len() >= 4, "{} is seen in {} frames", bar.name, picks.len());
                for pick in &picks {
                    let seen = dive.project(end, pick.camera, pick.exposure).expect("in front");
                    // Five standard deviations and the rounding.
                    assert!((seen.x - pick.pixel[0]).abs() < 1.55 && (seen.y - pick.pixel[1]).abs() < 1.55);
                }
            }
        }
    }

    #[test]
    fn what_stands_behind_the_reef_is_not_picked() {
        let dive = DiveScene::new(&DiveOptions::small(2, 64, 40)).expect("possible");
        // On the sand behind the base slab, seen from low in front of it.
        assert!(dive.is_hidden(&Vector3::new(0.0, 3.0, 0.0), &Vector3::new(0.0, -4.0, 0.15)));
        assert!(!dive.is_hidden(&Vector3::new(0.0, 3.0, 0.5), &Vector3::new(0.0, 3.0, 2.5)));
    }
}
