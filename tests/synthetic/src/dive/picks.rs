//! Where the targets of bars are seen, as a person would point at them.

use super::moving::Moving;
use super::scene::DiveScene;
use crate::random::{Random, mix};
use crate::trace::Tracer;
use crate::world::Bar;
use nalgebra::{Vector2, Vector3};

/// Standard deviation of the picks, pixels: pointed at quickly, for something else to measure.
pub const PICK_SIGMA_PX: f64 = 1.0;
/// Picks keep away from the border of the frame, pixels.
const BORDER_PX: f64 = 4.0;
/// What stands before a point by more than this hides it, metres: the point may lie on an edge.
const EDGE_M: f64 = 0.005;
/// A target is whole when so much of its radius is seen about its centre.
const SEEN: f64 = 1.7;
/// Least cosine of the angle between the normal of a target and the way to the camera: 60 degrees.
const MIN_COSINE: f64 = 0.5;

/// Where a target is seen in a frame, pointed at by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Which camera.
    pub camera: usize,
    /// Which exposure.
    pub exposure: usize,
    /// Pixel; the middle of the top-left one is (0.5, 0.5).
    pub pixel: [f64; 2],
    /// The shorter axis of the target, pixels.
    pub width_px: f64,
}

impl DiveScene {
    /// Picks of the target at an end (0 or 1) of a bar in every frame that shows it whole and not too much from the side, camera after camera.
    ///
    /// # Panics
    /// When there is no such end.
    #[must_use]
    pub fn picks(&self, bar: &Bar, end: usize) -> Vec<Pick> {
        let frames = (0..self.cameras.len()).flat_map(|c| (0..self.exposures()).map(move |e| (c, e)));
        frames.filter_map(|(camera, exposure)| self.pick(bar, &bar.ends[end], camera, exposure)).collect()
    }

    fn pick(&self, bar: &Bar, end: &Vector3<f64>, camera: usize, exposure: usize) -> Option<Pick> {
        let pixel = self.project(end, camera, exposure)?;
        let eye = self.cam_from_world(camera, exposure).centre();
        if (eye - end).normalize().dot(&bar.normal) < MIN_COSINE {
            return None;
        }
        let size = Vector2::new(f64::from(self.options.rig.width), f64::from(self.options.rig.height));
        let is_inside = |p: Vector2<f64>| p.min() > BORDER_PX && (size - p).min() > BORDER_PX;
        // The whole disc and the plate about it, from eight sides.
        let [u, v] = bar.target_axes().map(|a| a * (SEEN * bar.target_radius_m));
        let around = (0..8).map(|i| (std::f64::consts::FRAC_PI_4 * f64::from(i)).sin_cos()).map(|(sin, cos)| end + u * cos + v * sin);
        let whole: Vec<Vector3<f64>> = around.chain([*end]).collect();
        let seen: Vec<Vector2<f64>> = whole.iter().map(|p| self.project(p, camera, exposure)).collect::<Option<_>>()?;
        if !seen.iter().all(|&p| is_inside(p)) || whole.iter().any(|p| self.is_hidden(p, &eye)) {
            return None;
        }
        let moving = Moving::at(&self.world, self.motion.frame_time_s(exposure)).tracer;
        if moving.is_some_and(|tracer| whole.iter().any(|p| stands_before(&tracer, p, &eye))) {
            return None;
        }
        let width_px = (0..4).map(|i| (seen[i] - seen[i + 4]).norm() / SEEN).fold(f64::INFINITY, f64::min);
        let key = end.iter().fold((camera as u64) << 32 | exposure as u64, |key, v| mix(key ^ v.to_bits()));
        let mut random = Random::new(key ^ self.options.seed);
        // Written down to a tenth of a pixel, as people do.
        let pixel = [pixel.x, pixel.y].map(|v| (10.0 * (v + PICK_SIGMA_PX * random.normal())).round() / 10.0);
        Some(Pick { camera, exposure, pixel, width_px })
    }

    /// Whether something that stays stands before a point of the surface.
    pub(super) fn is_hidden(&self, point: &Vector3<f64>, from: &Vector3<f64>) -> bool {
        stands_before(&self.tracer, point, from)
    }
}

/// Whether something stands before a point.
fn stands_before(tracer: &Tracer, point: &Vector3<f64>, from: &Vector3<f64>) -> bool {
    let distance = (point - from).norm();
    tracer.ray(from, &((point - from) / distance)).is_some_and(|hit| hit.distance < distance - EDGE_M)
}

#[cfg(test)]
mod tests {
    use super::super::{DiveOptions, PortKind};
    use super::*;

    #[test]
    fn targets_of_bars_are_picked_near_their_projections() {
        let dive = DiveScene::new(&DiveOptions::small(16, 640, 400)).expect("possible");
        assert_eq!(dive.world.bars.len(), 2);
        for bar in &dive.world.bars {
            for end in 0..2 {
                let picks = dive.picks(bar, end);
                assert!(picks.len() >= 4, "{} is seen in {} frames", bar.name, picks.len());
                for pick in &picks {
                    let seen = dive.project(&bar.ends[end], pick.camera, pick.exposure).expect("in front");
                    // Five standard deviations and the rounding.
                    assert!((seen.x - pick.pixel[0]).abs() < 5.05 && (seen.y - pick.pixel[1]).abs() < 5.05);
                    assert!(pick.width_px > 1.0, "{} px", pick.width_px);
                }
            }
        }
    }

    /// What a measurement of the targets reaches in rendered frames, in water and with noise, against the true projection, without the window and
    /// with it.
    #[test]
    fn targets_are_measured_where_they_are_seen() {
        for port in [PortKind::None, PortKind::Flat] {
            let mut options = DiveOptions::small(24, 960, 600);
            options.rig.port.kind = port;
            if port == PortKind::Flat {
                options.rig.cameras.iter_mut().for_each(|camera| camera.focal_mm /= 1.34);
            }
            let dive = DiveScene::new(&options).expect("possible");
            let mut picks: Vec<(Vector3<f64>, Pick)> = Vec::new();
            for bar in &dive.world.bars {
                for end in 0..2 {
                    let all = dive.picks(bar, end);
                    picks.extend(all.iter().filter(|p| p.width_px >= 8.0).take(6).map(|p| (bar.ends[end], *p)));
                }
            }
            picks.sort_by_key(|(_, p)| (p.camera, p.exposure));
            let mut frames: Vec<(usize, usize)> = picks.iter().map(|(_, p)| (p.camera, p.exposure)).collect();
            frames.dedup();
            frames.truncate(6);
            let (mut squares, mut count, mut worst, mut stated) = (0.0, 0.0, 0.0f64, 0.0);
            for (camera, exposure) in frames {
                let grey = imaging::grey_from_rgb(&dive.render(camera, exposure).rgb);
                for (end, pick) in picks.iter().filter(|(_, p)| (p.camera, p.exposure) == (camera, exposure)) {
                    let target = imaging::measure_circle(&grey, pick.pixel, 10.0).expect("whole, and 8 px wide");
                    let truth = dive.project(end, camera, exposure).expect("in front");
                    let error = Vector2::from(target.centre) - truth;
                    let shape = &dive.cameras[camera].calibrated.camera;
                    let eccentricity = target.eccentricity_px(shape).expect("seen");
                    squares += error.norm_squared() / 2.0;
                    stated += target.mean_sigma_px().powi(2) + eccentricity * eccentricity / 2.0;
                    worst = worst.max(error.norm());
                    count += 1.0;
                }
            }
            let (rms, stated) = ((squares / f64::max(count, 1.0)).sqrt(), (stated / f64::max(count, 1.0)).sqrt());
            println!("{port:?}: {count} targets, {rms:.3} px RMS a coordinate, {stated:.3} stated, {worst:.3} px at most");
            assert!(count >= 6.0, "{count} targets");
            assert!(rms < 0.05 && worst < 0.15, "{port:?}: {rms} px RMS, {worst} px at most");
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
