//! Known lengths in the scene.

use super::movers::plate;
use super::part::{Label, Material, Part};
use nalgebra::Vector3;

/// Width of the bands, metres.
const BAND_M: f64 = 0.1;
/// Half the thickness of a bar, metres.
const HALF_M: f64 = 0.02;

/// A bar of known length.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Name, for the report.
    pub name: &'static str,
    /// Its ends in the world, metres: middles of the edges that face where the cameras come from.
    pub ends: [Vector3<f64>; 2],
}

impl Bar {
    /// Distance of the ends, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }
}

/// A bar along an axis (0: x, 2: z) whose near edge begins at `end`; cameras come from -y.
pub(super) fn bar(name: &'static str, end: [f64; 3], axis: usize, length_m: f64) -> (Bar, Part) {
    let mut other = end;
    other[axis] += length_m;
    // A bar that lies shows its upper near edge, a standing one the middle of its near side.
    let lies = axis != 2;
    let (mut low, mut high) = (end, other);
    for k in 0..3 {
        if k == axis {
            continue;
        }
        match (k, lies) {
            (1, _) => high[k] += 2.0 * HALF_M,
            (2, true) => low[k] -= 2.0 * HALF_M,
            _ => {
                low[k] -= HALF_M;
                high[k] += HALF_M;
            }
        }
    }
    let mut direction = [0.0; 3];
    direction[axis] = 1.0;
    let material = Material::Bar { origin: end, axis: direction, band_m: BAND_M };
    (Bar { name, ends: [end.into(), other.into()] }, Part::new(name, Label::Target, material, plate(low, high)))
}
