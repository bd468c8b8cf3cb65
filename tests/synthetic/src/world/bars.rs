//! Known lengths in the scene.

use super::movers::plate;
use super::panel::{Art, Panel};
use super::part::{Label, Material, Part};
use nalgebra::{Matrix3, Vector3};
use scene::Rigid3;

/// Width of the bands, metres.
const BAND_M: f64 = 0.1;
/// Half the thickness of a bar, metres.
const HALF_M: f64 = 0.02;
/// Radius of the dark disc at each end, metres.
const TARGET_RADIUS_M: f64 = 0.03;
/// Half the side of the white plate that it is printed on, and its thickness, metres.
const PLATE_HALF_M: f64 = 0.06;
const PLATE_M: f64 = 0.01;
/// How far a bar reaches beyond the centres of its targets, metres.
const BEYOND_M: f64 = 0.1;

/// A bar of known length between the centres of two circular targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Name, for the report.
    pub name: &'static str,
    /// Its ends in the world, metres: the centres of the targets.
    pub ends: [Vector3<f64>; 2],
    /// Unit normal of the targets, towards those who look at them.
    pub normal: Vector3<f64>,
    /// Radius of the targets, metres.
    pub target_radius_m: f64,
}

impl Bar {
    /// Distance of the ends, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    /// Unit vectors in the plane of the targets: along the bar, and across it.
    #[must_use]
    pub fn target_axes(&self) -> [Vector3<f64>; 2] {
        let along = (self.ends[1] - self.ends[0]).normalize();
        [along, self.normal.cross(&along)]
    }
}

/// A bar and what it looks like.
pub(super) struct BuiltBar {
    pub bar: Bar,
    pub parts: Vec<Part>,
    pub panels: Vec<Panel>,
}

/// A bar along an axis (0: x, 2: z) whose near edge begins at `start`; cameras come from -y. Its targets stand on plates before it: those of a
/// bar that lies face up and forward, those of a standing one forward. Their panels get the numbers from `first_panel` on.
pub(super) fn bar(name: &'static str, start: [f64; 3], axis: usize, length_m: f64, first_panel: usize) -> BuiltBar {
    let mut other = start;
    other[axis] += length_m + 2.0 * BEYOND_M;
    // A bar that lies shows its upper near edge, a standing one the middle of its near side.
    let lies = axis != 2;
    let (mut low, mut high) = (start, other);
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
    let mut along = Vector3::zeros();
    along[axis] = 1.0;
    let normal = if lies { Vector3::new(0.0, -1.0, 1.0).normalize() } else { -Vector3::y() };
    // The edge of a tilted plate stays above the bottom.
    let before = if lies { PLATE_HALF_M } else { PLATE_M };
    let first = Vector3::from(start) + along * BEYOND_M + normal * before;
    let bar = Bar { name, ends: [first, first + along * length_m], normal, target_radius_m: TARGET_RADIUS_M };
    let material = Material::Bar { origin: start, axis: along.into(), band_m: BAND_M };
    let mut built = BuiltBar { parts: vec![Part::new(name, Label::Target, material, plate(low, high))], panels: Vec::new(), bar };
    for (k, end) in built.bar.ends.into_iter().enumerate() {
        let (part, panel) = target(end, &built.bar, first_panel + k);
        built.parts.push(part);
        built.panels.push(panel);
    }
    built
}

/// A white plate with a dark disc whose centre is at `end`.
fn target(end: Vector3<f64>, bar: &Bar, panel: usize) -> (Part, Panel) {
    let [u, v] = bar.target_axes();
    let h = PLATE_HALF_M;
    // In the frame of the plate, z is the normal and the front is at 0.
    let world_from_plate = Rigid3::from_matrix(&Matrix3::from_columns(&[u, v, bar.normal]), end);
    let part = Part::new("target", Label::Target, Material::Panel(panel), plate([-h, -h, -PLATE_M], [h, h, 0.0])).moved(&world_from_plate);
    let art = Art::Dots { radius_m: bar.target_radius_m, centres: vec![[h, h]] };
    (part, Panel { origin: end - (u + v) * h, u, v, size_m: [2.0 * h; 2], art })
}
