//! Known lengths in the scene, and where their ends are seen.

use super::scene::DiveScene;
use super::surface::{Block, Material, trace};
use crate::random::{Random, mix};
use nalgebra::Vector3;

/// Standard deviation of the picks, pixels: as good as a careful person.
const PICK_SIGMA_PX: f64 = 0.3;
/// Picks keep away from the border of the frame, pixels.
const BORDER_PX: f64 = 4.0;

/// A bar of known length.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleBar {
    /// Name, for the report.
    pub name: &'static str,
    /// Its ends in the world, metres.
    pub ends: [Vector3<f64>; 2],
}

impl ScaleBar {
    /// Distance of the ends, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }
}

/// Where a point of the scene is seen in a frame, measured by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Which camera.
    pub camera: usize,
    /// Which exposure.
    pub exposure: usize,
    /// Pixel; the middle of the top-left one is (0.5, 0.5).
    pub pixel: [f64; 2],
}

/// One bar lies on the sand in front of the reef, one hangs on a post (its length as in Rofallski et al. 2020).
pub(super) fn scale_bars() -> Vec<ScaleBar> {
    vec![
        ScaleBar { name: "bar on the sand", ends: [Vector3::new(-0.55, -1.88, 0.0), Vector3::new(0.45, -1.88, 0.0)] },
        ScaleBar { name: "bar on the post", ends: [Vector3::new(-1.03, -1.24, 0.5), Vector3::new(-1.03, -1.24, 1.325_222)] },
    ]
}

/// The bars as boxes; the ends are the middles of edges that face the cameras.
pub(super) fn bar_blocks() -> [Block; 2] {
    let block = |low: [f64; 3], high: [f64; 3]| Block { low: low.into(), high: high.into(), material: Material::Bar };
    [block([-0.55, -1.90, -0.2], [0.45, -1.86, 0.0]), block([-1.05, -1.24, 0.5], [-1.01, -1.20, 1.325_222])]
}

impl DiveScene {
    /// Picks of a point on the surface in every frame that shows it, camera after camera.
    #[must_use]
    pub fn picks(&self, point: &Vector3<f64>) -> Vec<Pick> {
        let frames = (0..self.cameras.len()).flat_map(|c| (0..self.rig_from_world.len()).map(move |e| (c, e)));
        frames.filter_map(|(camera, exposure)| self.pick(point, camera, exposure)).collect()
    }

    fn pick(&self, point: &Vector3<f64>, camera: usize, exposure: usize) -> Option<Pick> {
        let pose = self.cam_from_world(camera, exposure);
        let pixel = self.cameras[camera].project(&pose.apply(point))?;
        let (width, height) = (f64::from(self.options.width), f64::from(self.options.height));
        let inside = |v: f64, size: f64| v > BORDER_PX && v < size - BORDER_PX;
        if !inside(pixel.x, width) || !inside(pixel.y, height) || self.is_hidden(point, &pose.centre()) {
            return None;
        }
        let key = point.iter().fold((camera as u64) << 32 | exposure as u64, |key, v| mix(key ^ v.to_bits()));
        let mut random = Random::new(key ^ self.options.seed);
        // Written down to a tenth of a pixel, as people do.
        let pixel = [pixel.x, pixel.y].map(|v| (10.0 * (v + PICK_SIGMA_PX * random.normal())).round() / 10.0);
        Some(Pick { camera, exposure, pixel })
    }

    /// Whether something stands before a point of the surface. 5 mm: the point may lie on an edge.
    fn is_hidden(&self, point: &Vector3<f64>, from: &Vector3<f64>) -> bool {
        let distance = (point - from).norm();
        trace(&self.blocks, from, &((point - from) / distance)).is_some_and(|hit| hit.distance < distance - 0.005)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DiveOptions, DiveScene};
    use super::*;

    #[test]
    fn ends_are_picked_near_their_projections_in_most_frames() {
        let scene = DiveScene::new(&DiveOptions { cameras: 3, exposures: 10, ..DiveOptions::default() });
        for bar in &scene.scale_bars {
            for end in &bar.ends {
                let picks = scene.picks(end);
                assert!(picks.len() >= 10, "{} is seen in {} frames", bar.name, picks.len());
                for pick in &picks {
                    let seen = scene.cam_from_world(pick.camera, pick.exposure).apply(end);
                    let true_pixel = scene.cameras[pick.camera].project(&seen).expect("in front");
                    // Five standard deviations and the rounding.
                    assert!((true_pixel.x - pick.pixel[0]).abs() < 1.55 && (true_pixel.y - pick.pixel[1]).abs() < 1.55);
                }
            }
        }
        assert!((scene.scale_bars[0].length_m() - 1.0).abs() < 1e-12 && (scene.scale_bars[1].length_m() - 0.825_222).abs() < 1e-12);
    }

    #[test]
    fn what_stands_behind_the_reef_is_not_picked() {
        let scene = DiveScene::new(&DiveOptions { exposures: 5, ..DiveOptions::default() });
        // On the wall at the back, seen from the front through a post.
        assert!(scene.is_hidden(&Vector3::new(-1.1, 1.1, 1.0), &Vector3::new(-1.1, -4.0, 1.0)));
        assert!(!scene.is_hidden(&Vector3::new(-1.03, -1.24, 1.0), &Vector3::new(-1.03, -4.0, 1.0)));
    }
}
