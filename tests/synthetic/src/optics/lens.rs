//! The lens in air.

use rayon::prelude::*;

/// A lens of one focal length, with radial and decentring distortion (Brown 1971): a direction whose tangents are (u, v) is imaged at
/// axis + f (u (1 + a1 r2 + a2 r4) + b1 (r2 + 2 u2) + 2 b2 u v, ...).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Where the axis meets the image, pixels.
    pub axis_px: [f64; 2],
    /// Radial terms a1, a2.
    pub radial: [f64; 2],
    /// Decentring terms b1, b2.
    pub tangential: [f64; 2],
}

impl Lens {
    /// Tangents (u, v) of the direction that is imaged at a point; the middle of the top-left pixel is (0.5, 0.5).
    #[must_use]
    pub fn tangents(&self, x: f64, y: f64) -> [f64; 2] {
        let seen = [(x - self.axis_px[0]) / self.focal_px, (y - self.axis_px[1]) / self.focal_px];
        let [b1, b2] = self.tangential;
        let [mut u, mut v] = self.without_radial(seen);
        // The decentring is a ten-thousandth of the radius: each round gains four digits.
        for _ in 0..4 {
            let r2 = u * u + v * v;
            let du = b1 * (r2 + 2.0 * u * u) + 2.0 * b2 * u * v;
            let dv = b2 * (r2 + 2.0 * v * v) + 2.0 * b1 * u * v;
            [u, v] = self.without_radial([seen[0] - du, seen[1] - dv]);
        }
        [u, v]
    }

    /// The root of r (1 + a1 r2 + a2 r4) = seen: bisection to a thousandth, then false position within the bracket.
    fn without_radial(&self, seen: [f64; 2]) -> [f64; 2] {
        let bent = seen[0].hypot(seen[1]);
        if bent == 0.0 {
            return seen;
        }
        let image_radius = |r: f64| r * (1.0 + r * r * (self.radial[0] + r * r * self.radial[1]));
        let (mut low, mut high) = (0.0, self.largest_radius().min(4.0 * bent + 1.0));
        for _ in 0..12 {
            let r = f64::midpoint(low, high);
            if image_radius(r) < bent { low = r } else { high = r }
        }
        let (mut below, mut above) = (image_radius(low) - bent, image_radius(high) - bent);
        // The curve is nearly straight over the bracket: each round gains three digits.
        for _ in 0..6 {
            let r = low - below * (high - low) / (above - below);
            if !(r > low && r < high) {
                break;
            }
            let miss = image_radius(r) - bent;
            if miss < 0.0 { (low, below) = (r, miss) } else { (high, above) = (r, miss) }
        }
        let r = if below.abs() < above.abs() { low } else { high };
        let scale = r / bent;
        [seen[0] * scale, seen[1] * scale]
    }

    /// The radius up to which the image radius grows.
    fn largest_radius(&self) -> f64 {
        let [a1, a2] = self.radial;
        // 1 + 3 a1 r2 + 5 a2 r4 = 0.
        let root = if a2.abs() < 1e-12 {
            -1.0 / (3.0 * a1)
        } else {
            let discriminant = 9.0 * a1 * a1 - 20.0 * a2;
            let roots = [(-3.0 * a1 - discriminant.sqrt()) / (10.0 * a2), (-3.0 * a1 + discriminant.sqrt()) / (10.0 * a2)];
            roots.into_iter().filter(|r2| *r2 > 0.0).fold(f64::INFINITY, f64::min)
        };
        if root > 0.0 { root.sqrt() } else { f64::INFINITY }
    }
}

/// The tangents at the corners of all pixels: bilinear in between, which is exact to a thousandth of a pixel.
#[derive(Clone, Debug)]
pub struct RayTable {
    columns: usize,
    tangents: Vec<[f32; 2]>,
}

impl RayTable {
    /// The table of a lens for a frame of `width` x `height` pixels.
    #[must_use]
    pub fn new(lens: &Lens, width: u32, height: u32) -> Self {
        let columns = width as usize + 1;
        let mut tangents = vec![[0.0; 2]; columns * (height as usize + 1)];
        tangents.par_chunks_mut(columns).enumerate().for_each(|(y, row)| {
            for (x, at) in row.iter_mut().enumerate() {
                *at = lens.tangents(x as f64, y as f64).map(|t| t as f32);
            }
        });
        Self { columns, tangents }
    }

    /// The tangents at a point within pixel (`x`, `y`); `fx` and `fy` from 0 to 1 say where in it.
    #[must_use]
    pub fn at(&self, x: usize, y: usize, fx: f64, fy: f64) -> [f64; 2] {
        let corner = |i: usize, j: usize| self.tangents[(y + j) * self.columns + x + i].map(f64::from);
        let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
        std::array::from_fn(|k| (a[k] * (1.0 - fx) + b[k] * fx) * (1.0 - fy) + (c[k] * (1.0 - fx) + d[k] * fx) * fy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use scene::{Camera, CameraModel};

    const LENS: Lens = Lens { focal_px: 340.0, axis_px: [322.0, 199.0], radial: [-0.11, 0.012], tangential: [2e-4, -1e-4] };

    #[test]
    fn agrees_with_the_camera_model() {
        let params = [340.0, 322.0, 199.0, -0.11, 0.012, 0.0, 2e-4, -1e-4, 0.0, 0.0];
        let camera = Camera::new(CameraModel::Brown, 640, 400, &params).expect("valid");
        for i in 0..=20 {
            for j in 0..=20 {
                let (x, y) = (32.0 * f64::from(i), 20.0 * f64::from(j));
                let [u, v] = LENS.tangents(x, y);
                let pixel = camera.project(&Vector3::new(3.0 * u, 3.0 * v, 3.0)).expect("in front");
                assert!((pixel.x - x).abs() < 1e-9 && (pixel.y - y).abs() < 1e-9, "{x} {y} became {pixel}");
            }
        }
    }

    #[test]
    fn the_table_is_exact_to_a_thousandth_of_a_pixel() {
        let table = RayTable::new(&LENS, 640, 400);
        for (x, y, fx, fy) in [(0, 0, 0.5, 0.5), (639, 399, 0.9, 0.1), (320, 2, 0.25, 0.75), (5, 200, 0.5, 0.5)] {
            let (exact, found) = (LENS.tangents(x as f64 + fx, y as f64 + fy), table.at(x, y, fx, fy));
            for k in 0..2 {
                assert!((exact[k] - found[k]).abs() * LENS.focal_px < 1e-3, "{exact:?} {found:?}");
            }
        }
    }
}
