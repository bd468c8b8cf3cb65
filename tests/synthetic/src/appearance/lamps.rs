//! The vehicle's lamps.

use super::Water;
use nalgebra::Vector3;
use scene::Rigid3;
use serde::{Deserialize, Serialize};

/// Two lamps, left and right of the rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LampOptions {
    /// Irradiance of one lamp on its axis at a metre, as a share of daylight just below the surface; 0: off.
    pub power: f32,
    /// Half the distance of the lamps, metres.
    pub half_spacing_m: f64,
    /// How far above the rig's first camera, metres.
    pub above_m: f64,
    /// Angle from the axis at which half the light is left, degrees.
    pub half_angle_deg: f32,
}

impl Default for LampOptions {
    fn default() -> Self {
        Self { power: 0.6, half_spacing_m: 0.35, above_m: 0.25, half_angle_deg: 35.0 }
    }
}

/// Lamps at one exposure, in the world.
#[derive(Clone, Debug)]
pub(crate) struct Lamps {
    places: [Vector3<f32>; 2],
    axis: Vector3<f32>,
    /// Exponent of the cosine of the angle to the axis.
    focus: f32,
    power: f32,
}

/// Light of a lamp counts from here on, metres: nothing is nearer to it.
const NEAREST_M: f32 = 0.15;

impl Lamps {
    /// `None` when they are off.
    pub fn new(options: &LampOptions, rig_from_world: &Rigid3) -> Option<Self> {
        if options.power <= 0.0 {
            return None;
        }
        let world_from_rig = rig_from_world.inverse();
        let place = |side: f64| world_from_rig.apply(&Vector3::new(0.2 + side * options.half_spacing_m, -options.above_m, 0.0)).cast();
        let axis = (world_from_rig.rotation * Vector3::z()).cast();
        let focus = -(2f32.ln()) / options.half_angle_deg.to_radians().cos().ln();
        Some(Self { places: [place(-1.0), place(1.0)], axis, focus, power: options.power })
    }

    /// Light that falls on a surface, each channel.
    pub fn on_surface(&self, point: &Vector3<f32>, normal: &Vector3<f32>, water: Option<&Water>) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for place in &self.places {
            let (towards, distance) = direction(place, point);
            let facing = -normal.dot(&towards);
            if facing > 0.0 {
                self.add(&mut sum, &towards, distance, facing, water);
            }
        }
        sum
    }

    /// Light in the water at a point, from all sides.
    pub fn in_water(&self, point: &Vector3<f32>, water: &Water) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for place in &self.places {
            let (towards, distance) = direction(place, point);
            self.add(&mut sum, &towards, distance, 1.0, Some(water));
        }
        sum
    }

    fn add(&self, sum: &mut [f32; 3], towards: &Vector3<f32>, distance: f32, facing: f32, water: Option<&Water>) {
        let on_axis = towards.dot(&self.axis);
        if on_axis <= 0.0 {
            return;
        }
        let beam = self.power * on_axis.powf(self.focus) * facing / (distance * distance);
        // Lamps are broad: what is scattered forwards arrives all the same, as with daylight.
        let left = water.map_or([1.0; 3], |w| w.diffuse_per_m.map(|k| (-k * distance).exp()));
        for c in 0..3 {
            sum[c] += beam * left[c];
        }
    }
}

fn direction(from: &Vector3<f32>, to: &Vector3<f32>) -> (Vector3<f32>, f32) {
    let way = to - from;
    let distance = way.norm().max(1e-6);
    (way / distance, distance.max(NEAREST_M))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_falls_with_the_square_of_the_distance_and_off_the_axis() {
        let options = LampOptions { half_spacing_m: 0.0, above_m: 0.0, ..LampOptions::default() };
        let lamps = Lamps::new(&options, &Rigid3::identity()).expect("on");
        let at = |x: f32, z: f32| lamps.on_surface(&Vector3::new(0.2 + x, 0.0, z), &-Vector3::z(), None)[1];
        assert!((at(0.0, 1.0) / 1.2 - 1.0).abs() < 1e-5, "two lamps of 0.6");
        assert!((at(0.0, 1.0) / at(0.0, 2.0) - 4.0).abs() < 1e-4);
        // At the half angle: half the light, the surface tilted by it, further away by 1 / cosine.
        let angle = 35f32.to_radians();
        assert!((at(angle.tan(), 1.0) / at(0.0, 1.0) - 0.5 * angle.cos().powi(3)).abs() < 1e-4);
        assert_eq!(lamps.on_surface(&Vector3::new(0.0, 0.0, 2.0), &Vector3::z(), None), [0.0; 3], "seen from behind");
    }
}
