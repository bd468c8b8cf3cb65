//! Where four squares meet, to a fraction of a pixel.

use crate::sample::{bilinear, inside};
use nalgebra::{Matrix2, Vector2};
use scene::Raster;

/// Steps; each usually leaves a tenth of the error.
const MAX_STEPS: usize = 20;
/// Steps below this, pixels, end the search.
const CONVERGED_PX: f64 = 1e-3;

/// The point to which all gradients about it are orthogonal, from a start within the window; `None` where it leaves the start by more than
/// `half`, the window leaves the image, or the edges do not determine a point.
///
/// Least squares of the distances from the point to the edges through the window's pixels, weighted by the squared gradient and a Gaussian
/// (Foerstner & Guelch, *A fast operator for detection and precise location of distinct points*, ISPRS Intercommission Workshop 1987). For
/// a crossing of two edges the two sides of each edge hold each other in balance: blur moves nothing.
pub(crate) fn refine(image: &Raster<f32>, start: &Vector2<f64>, half: f64) -> Option<Vector2<f64>> {
    let reach = half.ceil() as i32;
    let fall = -2.0 / (half * half);
    let (side, middle) = (2 * reach as usize + 3, f64::from(reach) + 1.0);
    let mut patch = vec![0.0; side * side];
    let mut p = *start;
    for _ in 0..MAX_STEPS {
        if !inside(image, &p, f64::from(reach) + 1.5) {
            return None;
        }
        for (k, value) in patch.iter_mut().enumerate() {
            let (i, j) = (k % side, k / side);
            *value = bilinear(image, p.x + i as f64 - middle, p.y + j as f64 - middle);
        }
        let mut normal = Matrix2::zeros();
        let mut right = Vector2::zeros();
        for j in 1..side - 1 {
            for i in 1..side - 1 {
                let d = Vector2::new(i as f64 - middle, j as f64 - middle);
                let g = sobel(&patch, side, i, j);
                let outer = g * g.transpose() * (fall * d.norm_squared()).exp();
                normal += outer;
                right += outer * d;
            }
        }
        // Two edges: the smaller eigenvalue is a fair share of the larger one.
        let (trace, determinant) = (normal.trace(), normal.determinant());
        if !(determinant > 0.01 * trace * trace * 0.25 && trace > 0.0) {
            return None;
        }
        let step = normal.try_inverse()? * right;
        p += step;
        if (p - start).norm() > half {
            return None;
        }
        if step.norm() < CONVERGED_PX {
            return Some(p);
        }
    }
    Some(p)
}

/// The gradient at (i, j), smoothed across: its noise counts with the distance from the corner.
fn sobel(patch: &[f64], side: usize, i: usize, j: usize) -> Vector2<f64> {
    let at = |di: usize, dj: usize| patch[(j + dj - 1) * side + i + di - 1];
    let column = |di: usize| at(di, 0) + 2.0 * at(di, 1) + at(di, 2);
    let row = |dj: usize| at(0, dj) + 2.0 * at(1, dj) + at(2, dj);
    Vector2::new(column(2) - column(0), row(2) - row(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four squares that meet in `centre`, turned, blurred, sampled at pixel centres with a little noise.
    fn crossing(centre: Vector2<f64>, turn: f64, noise: f64) -> Raster<f32> {
        let mut random = synthetic::Random::new(3);
        let n = 41;
        let edge = |d: f64| (d / 1.2).tanh();
        let value = |x: f64, y: f64| {
            let d = Vector2::new(x, y) - centre;
            let (s, c) = turn.sin_cos();
            0.5 + 0.3 * edge(c * d.x + s * d.y) * edge(-s * d.x * 0.8 + c * d.y)
        };
        let data = (0..n * n).map(|k| (value((k % n) as f64 + 0.5, (k / n) as f64 + 0.5) + noise * random.normal()) as f32);
        Raster::from_vec(n, n, data.collect()).unwrap()
    }

    #[test]
    fn crossings_are_found() {
        for (x, y, turn) in [(20.5, 20.5, 0.0), (20.81, 19.93, 0.4), (19.27, 20.66, 1.1)] {
            let centre = Vector2::new(x, y);
            let found = refine(&crossing(centre, turn, 0.0), &(centre + Vector2::new(1.3, -0.9)), 8.0).expect("a crossing");
            // Interpolation blurs pixels that are off the grid along x and y, which moves crossings that are askew a little.
            assert!((found - centre).norm() < 0.03, "{found} {centre}");
            // 0.01 of noise at a contrast of 0.6 turns gradients by 0.017 radians, which act over 4 pixels and average out over some 10
            // pixels: 0.025 pixels, and three times that at most.
            let noisy = refine(&crossing(centre, turn, 0.01), &centre, 8.0).expect("a crossing");
            assert!((noisy - centre).norm() < 0.075, "{noisy} {centre}");
        }
    }

    #[test]
    fn edges_and_flat_places_are_no_crossings() {
        let flat = Raster::filled(41, 41, 0.5f32);
        assert_eq!(refine(&flat, &Vector2::new(20.0, 20.0), 5.0), None);
        let edge = Raster::from_vec(41, 41, (0..41 * 41).map(|k| if k % 41 < 20 { 0.1f32 } else { 0.9 }).collect()).unwrap();
        assert_eq!(refine(&edge, &Vector2::new(20.0, 20.0), 5.0), None);
    }
}
