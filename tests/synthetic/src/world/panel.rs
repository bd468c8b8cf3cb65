//! Flat panels with printed marks.

use super::tag36h11::CODES;
use nalgebra::Vector3;

const WHITE: f64 = 0.85;
const BLACK: f64 = 0.04;

/// A flat panel: x along `u`, y along `v`, from its top-left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Top-left corner in the frame of the body, metres.
    pub origin: Vector3<f64>,
    /// Unit vector to the right.
    pub u: Vector3<f64>,
    /// Unit vector downwards.
    pub v: Vector3<f64>,
    /// Width and height, metres.
    pub size_m: [f64; 2],
    /// What is printed.
    pub art: Art,
}

/// What is printed on a panel; centres and sides in metres on the panel.
#[derive(Clone, Debug, PartialEq)]
pub enum Art {
    /// AprilTags of the family 36h11 (Olson, ICRA 2011) in rows and columns, ids counting from the first row's left.
    Tags {
        /// Tags in a row.
        columns: u32,
        /// Rows.
        rows: u32,
        /// Side of the black border.
        side_m: f64,
        /// White between tags, and about them.
        gap_m: f64,
        /// Id of the first tag.
        first_id: u32,
    },
    /// White discs within a dark ring and a ring of 12 bits, as coded photogrammetric targets have (Schneider & Sinnreich, ISPRS 1993).
    Rings {
        /// Radius of the disc; the code lies between 2 and 3 radii.
        radius_m: f64,
        /// Centres.
        centres: Vec<[f64; 2]>,
        /// Code of the first target; the others count on.
        first_code: u32,
    },
    /// Dark discs on white.
    Dots {
        /// Radius.
        radius_m: f64,
        /// Centres.
        centres: Vec<[f64; 2]>,
    },
}

impl Panel {
    /// Albedo at a place on the panel, averaged over a footprint so that edges are not ragged.
    #[must_use]
    pub fn albedo(&self, x: f64, y: f64, footprint_m: f64) -> f64 {
        let white = match &self.art {
            Art::Tags { columns, rows, side_m, gap_m, first_id } => {
                let pitch = side_m + gap_m;
                let (i, j) = (((x - gap_m / 2.0) / pitch).floor(), ((y - gap_m / 2.0) / pitch).floor());
                if i < 0.0 || j < 0.0 || i >= f64::from(*columns) || j >= f64::from(*rows) {
                    1.0
                } else {
                    let id = first_id + j as u32 * columns + i as u32;
                    let local = |v: f64, k: f64| (v - gap_m - k * pitch) / side_m * 8.0;
                    tag_white(id, local(x, i), local(y, j), footprint_m / side_m * 8.0)
                }
            }
            Art::Rings { radius_m, centres, first_code } => nearest(centres, x, y)
                .map_or(0.0, |(k, dx, dy)| ring_white(first_code + k as u32, dx / radius_m, dy / radius_m, footprint_m / radius_m)),
            Art::Dots { radius_m, centres } => nearest(centres, x, y).map_or(1.0, |(_, dx, dy)| step(dx.hypot(dy) - radius_m, footprint_m)),
        };
        BLACK + (WHITE - BLACK) * white
    }
}

/// The centre that is nearest, and the place from it.
fn nearest(centres: &[[f64; 2]], x: f64, y: f64) -> Option<(usize, f64, f64)> {
    let from = centres.iter().enumerate().map(|(k, c)| (k, x - c[0], y - c[1]));
    from.min_by(|a, b| a.1.hypot(a.2).total_cmp(&b.1.hypot(b.2)))
}

/// 0 below an edge, 1 above it, and a ramp as wide as the footprint between.
fn step(beyond: f64, footprint: f64) -> f64 {
    (beyond / footprint.max(1e-9) + 0.5).clamp(0.0, 1.0)
}

/// White of a ring target; lengths in radii of the disc.
fn ring_white(code: u32, dx: f64, dy: f64, footprint: f64) -> f64 {
    let radius = dx.hypot(dy);
    let disc = 1.0 - step(radius - 1.0, footprint);
    let sector = ((dy.atan2(dx) / std::f64::consts::TAU).rem_euclid(1.0) * 12.0) as u32 % 12;
    // A multiple of an odd number spreads the codes; no target is all dark or all white.
    let bits = code.wrapping_mul(733) % 4094 + 1;
    let ring = step(radius - 2.0, footprint) * (1.0 - step(radius - 3.0, footprint)) * f64::from(bits >> sector & 1);
    disc.max(ring)
}

/// White of a tag; lengths in cells, (0, 0) is the outer corner of the black border, 8 cells a side.
fn tag_white(id: u32, x: f64, y: f64, footprint: f64) -> f64 {
    // The share of the footprint's square that is white, by its overlap with the cells it touches.
    let span = |v: f64| (v - footprint / 2.0, v + footprint / 2.0);
    let ((x0, x1), (y0, y1)) = (span(x), span(y));
    if x1 - x0 > 8.0 {
        return 0.5;
    }
    let (mut white, mut whole) = (0.0, 0.0);
    for row in y0.floor() as i64..=y1.floor() as i64 {
        let tall = (y1.min(row as f64 + 1.0) - y0.max(row as f64)).max(0.0);
        for column in x0.floor() as i64..=x1.floor() as i64 {
            let area = tall * (x1.min(column as f64 + 1.0) - x0.max(column as f64)).max(0.0);
            whole += area;
            white += area * f64::from(u8::from(tag_cell(id, row, column)));
        }
    }
    if whole > 0.0 { white / whole } else { f64::from(u8::from(tag_cell(id, y.floor() as i64, x.floor() as i64))) }
}

/// Whether a cell of a tag is white: the 6 x 6 cells of the code lie within a black border, and white is about it.
#[must_use]
pub fn tag_cell(id: u32, row: i64, column: i64) -> bool {
    let inside = |v: i64| (0..8).contains(&v);
    if !inside(row) || !inside(column) {
        return true;
    }
    let inner = |v: i64| (1..7).contains(&v);
    inner(row) && inner(column) && CODES[id as usize % CODES.len()] >> (35 - ((row - 1) * 6 + column - 1)) & 1 == 1
}
