//! An ellipse, and the signed distance from its edge.

use nalgebra::{Matrix2, SymmetricEigen, Vector2};

/// The points x with `|shape (x - centre)| = 1`; `shape` is symmetric, one over the semi-axes along its eigenvectors. Pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipse {
    pub centre: Vector2<f64>,
    pub shape: Matrix2<f64>,
}

/// Distance from the edge with its derivatives.
pub(super) struct Distance {
    /// Pixels, negative inside.
    pub value: f64,
    /// By the centre.
    pub d_centre: Vector2<f64>,
    /// By the elements (0, 0), (0, 1) and (1, 1) of the shape.
    pub d_shape: [f64; 3],
}

impl Ellipse {
    /// The ellipse with the covariance of a filled region: its semi-axes are twice the deviations along them. `None` for a region without
    /// width.
    pub(super) fn from_moments(centre: Vector2<f64>, covariance: &Matrix2<f64>) -> Option<Self> {
        let eigen = SymmetricEigen::new(*covariance);
        if eigen.eigenvalues.min() <= 0.0 {
            return None;
        }
        let inverse = eigen.eigenvalues.map(|v| 0.5 / v.sqrt());
        let shape = eigen.eigenvectors * Matrix2::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
        Some(Self { centre, shape })
    }

    /// Semi-axes as vectors from the centre, the longer one first; `None` where an axis is endless.
    pub(super) fn axes(&self) -> Option<[Vector2<f64>; 2]> {
        let eigen = SymmetricEigen::new(self.shape * self.shape);
        let [p, q] = [0, 1].map(|k| eigen.eigenvectors.column(k) / eigen.eigenvalues[k].max(0.0).sqrt());
        let axes = if p.norm() >= q.norm() { [p, q] } else { [q, p] };
        axes.iter().all(|a| a.iter().all(|v| v.is_finite())).then_some(axes)
    }

    /// Half the width and height of the upright box about it.
    pub(super) fn half_box(&self) -> Option<Vector2<f64>> {
        let [a, b] = self.axes()?;
        Some(Vector2::new(a.x.hypot(b.x), a.y.hypot(b.y)))
    }

    /// Signed distance of a point from the edge, to first order: `f / |grad f|` with `f = |shape x| - 1` (Taubin, *Estimation of planar
    /// curves, surfaces, and nonplanar space curves*, IEEE TPAMI 13, 1991). Exact for circles.
    pub(super) fn distance(&self, point: &Vector2<f64>) -> Distance {
        let x = point - self.centre;
        let m = self.shape;
        let mx = m * x;
        let mmx = m * mx;
        // Inside, where both vanish, the distance is of no importance: it is far from the edge.
        let (u, v) = (mx.norm().max(1e-9), mmx.norm().max(1e-12));
        let value = (u - 1.0) * u / v;
        let (by_u, by_v) = ((2.0 * u - 1.0) / v, -(u - 1.0) * u / (v * v));
        let (unit_u, unit_v) = (mx / u, mmx / v);
        let by_x = m * unit_u * by_u + m * (m * unit_v) * by_v;
        let of = |dm: Matrix2<f64>| by_u * unit_u.dot(&(dm * x)) + by_v * unit_v.dot(&(dm * mx + m * (dm * x)));
        let d_shape = [of(Matrix2::new(1.0, 0.0, 0.0, 0.0)), of(Matrix2::new(0.0, 1.0, 1.0, 0.0)), of(Matrix2::new(0.0, 0.0, 0.0, 1.0))];
        Distance { value, d_centre: -by_x, d_shape }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ellipse() -> Ellipse {
        Ellipse { centre: Vector2::new(10.2, 7.9), shape: Matrix2::new(0.21, 0.04, 0.04, 0.13) }
    }

    #[test]
    fn distance_from_a_circle_is_exact() {
        let circle = Ellipse { centre: Vector2::new(1.0, 2.0), shape: Matrix2::identity() / 4.0 };
        for point in [Vector2::new(8.0, 3.0), Vector2::new(1.5, 2.5), Vector2::new(1.0, 6.0)] {
            assert!((circle.distance(&point).value - ((point - circle.centre).norm() - 4.0)).abs() < 1e-12);
        }
    }

    #[test]
    fn derivatives_of_the_distance_are_those_of_differences() {
        let (base, step) = (ellipse(), 1e-6);
        for point in [Vector2::new(16.0, 9.0), Vector2::new(9.0, 15.5), Vector2::new(12.0, 7.0)] {
            let found = base.distance(&point);
            let slope = |change: &dyn Fn(&mut Ellipse, f64)| {
                let [mut plus, mut minus] = [base; 2];
                change(&mut plus, step);
                change(&mut minus, -step);
                (plus.distance(&point).value - minus.distance(&point).value) / (2.0 * step)
            };
            for k in 0..2 {
                assert!((slope(&|e, h| e.centre[k] += h) - found.d_centre[k]).abs() < 1e-7);
            }
            let places: [&[(usize, usize)]; 3] = [&[(0, 0)], &[(0, 1), (1, 0)], &[(1, 1)]];
            for (places, derivative) in places.iter().zip(found.d_shape) {
                assert!((slope(&|e, h| places.iter().for_each(|&p| e.shape[p] += h)) - derivative).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_region_has_the_axes_of_its_moments() {
        // A filled ellipse has variances of a^2 / 4 along its axes.
        let covariance = Matrix2::new(9.0, 0.0, 0.0, 4.0);
        let found = Ellipse::from_moments(Vector2::zeros(), &covariance).expect("wide");
        let [a, b] = found.axes().expect("finite");
        assert!((a.norm() - 6.0).abs() < 1e-12 && (b.norm() - 4.0).abs() < 1e-12);
        assert!((found.half_box().expect("finite") - Vector2::new(6.0, 4.0)).norm() < 1e-12);
        assert!(Ellipse::from_moments(Vector2::zeros(), &Matrix2::new(1.0, 0.0, 0.0, 0.0)).is_none());
    }
}
