//! Where a part of one image lies in the other.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

/// Matches about a place that say where it lies.
const NEIGHBOURS: usize = 6;
/// A window is wider than what its neighbours span by this many pixels to each side,
const MARGIN_PX: f64 = 8.0;
/// by this share of what they span,
const MARGIN_SPAN: f64 = 0.25;
/// and by this share of the distance to the nearest of them.
const MARGIN_DISTANCE: f64 = 0.1;

/// The motion of the image: an affine map, and how far each of some sure matches is from it.
pub(super) struct Motion {
    linear: Matrix2<f64>,
    shift: Vector2<f64>,
    /// Places in the first image.
    places: Vec<Vector2<f64>>,
    /// In the second, less the map's.
    residuals: Vec<Vector2<f64>>,
}

/// Corners of a box of pixels.
pub(super) struct Window {
    pub low: [f64; 2],
    pub high: [f64; 2],
}

impl Motion {
    /// From sure matches, at least one.
    pub(super) fn new(a: Vec<Vector2<f64>>, b: &[Vector2<f64>]) -> Self {
        let n = a.len() as f64;
        let centre = a.iter().sum::<Vector2<f64>>() / n;
        let (mut normal, mut right) = (Matrix3::zeros(), SMatrix::<f64, 3, 2>::zeros());
        for (x, y) in a.iter().zip(b) {
            let row = Vector3::new(x.x - centre.x, x.y - centre.y, 1.0);
            normal += row * row.transpose();
            right += row * y.transpose();
        }
        // Matches in line leave the map open across it: there the image is taken to keep its size and direction.
        let mean_only = || (Matrix2::identity(), b.iter().sum::<Vector2<f64>>() / n);
        let spread = normal.fixed_view::<2, 2>(0, 0).into_owned();
        let thin = spread.determinant() < 1e-3 * spread.trace().powi(2);
        let solved = if thin { None } else { normal.try_inverse().map(|inverse| inverse * right) };
        let (linear, mean) =
            solved.map_or_else(mean_only, |s| (s.fixed_view::<2, 2>(0, 0).transpose(), s.fixed_view::<1, 2>(2, 0).transpose()));
        let shift = mean - linear * centre;
        let residuals = a.iter().zip(b).map(|(x, y)| y - (linear * x + shift)).collect();
        Self { linear, shift, places: a, residuals }
    }

    /// Where to look for what lies in a square of the first image.
    pub(super) fn window(&self, left_top: Vector2<f64>, side: f64) -> Window {
        let centre = left_top + Vector2::repeat(0.5 * side);
        let mut nearest = [(f64::INFINITY, 0usize); NEIGHBOURS];
        for (i, place) in self.places.iter().enumerate() {
            let distance = (place - centre).norm_squared();
            if distance < nearest[NEIGHBOURS - 1].0 {
                let at = nearest.partition_point(|(d, _)| *d <= distance);
                nearest[at..].rotate_right(1);
                nearest[at] = (distance, i);
            }
        }
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (_, i) in nearest.iter().filter(|(d, _)| d.is_finite()) {
            for axis in 0..2 {
                low[axis] = low[axis].min(self.residuals[*i][axis]);
                high[axis] = high[axis].max(self.residuals[*i][axis]);
            }
        }
        let predicted = self.linear * centre + self.shift;
        for axis in 0..2 {
            let reach = 0.5 * side * (self.linear[(axis, 0)].abs() + self.linear[(axis, 1)].abs());
            let margin = MARGIN_PX + MARGIN_SPAN * (high[axis] - low[axis]) + MARGIN_DISTANCE * nearest[0].0.sqrt() + reach;
            low[axis] += predicted[axis] - margin;
            high[axis] += predicted[axis] + margin;
        }
        Window { low, high }
    }
}
