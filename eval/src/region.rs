//! The part of space that is measured.

use nalgebra::Point3;

/// A region of interest, the same for every cloud and for the reference: a box, a polygon seen from above, or both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    /// Smallest and largest coordinates, the borders included, metres.
    pub bounds: Option<(Point3<f64>, Point3<f64>)>,
    /// Corners x, y of a simple polygon, upright along z, metres; empty for none.
    pub polygon: Vec<[f64; 2]>,
}

impl Region {
    /// Whether a point lies within. The polygon is that of the crossing rule (M. Shimrat, *Algorithm 112*, CACM, 1962).
    #[must_use]
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        if let Some((low, high)) = &self.bounds
            && (0..3).any(|i| p[i] < low[i] || p[i] > high[i])
        {
            return false;
        }
        if self.polygon.is_empty() {
            return true;
        }
        let mut inside = false;
        let mut previous = self.polygon[self.polygon.len() - 1];
        for &corner in &self.polygon {
            let ([x0, y0], [x1, y1]) = (previous, corner);
            if (y0 > p.y) != (y1 > p.y) && p.x < x0 + (p.y - y0) / (y1 - y0) * (x1 - x0) {
                inside = !inside;
            }
            previous = corner;
        }
        inside
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_and_polygon_both_hold() {
        let l = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let region = Region { bounds: Some((Point3::new(-9.0, -9.0, 0.0), Point3::new(9.0, 9.0, 1.0))), polygon: l };
        for (p, inside) in [
            ([0.5, 1.5, 0.5], true),
            ([1.5, 0.5, 0.0], true),
            ([1.5, 1.5, 0.5], false),
            ([0.5, 0.5, 1.1], false),
            ([-0.1, 0.5, 0.5], false),
        ] {
            assert_eq!(region.contains(&Point3::from(p)), inside, "{p:?}");
        }
        assert!(Region::default().contains(&Point3::new(1e9, 0.0, 0.0)));
    }
}
