//! Distance of a point to a triangle.

use nalgebra::{Point3, Vector3};

/// The part of a triangle that is nearest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Feature {
    Face,
    /// The edge from corner i to corner i + 1.
    Edge(usize),
    Vertex(usize),
}

/// A triangle, prepared for distances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    a: Vector3<f64>,
    ab: Vector3<f64>,
    ac: Vector3<f64>,
    /// Corners on one line: only edges can be nearest.
    flat: bool,
}

/// Sine of the smallest angle at which a triangle still counts as one: below, the barycentric denominators lose all digits.
const MIN_SINE: f64 = 1e-10;

impl Triangle {
    pub fn new([a, b, c]: [Vector3<f64>; 3]) -> Self {
        let (ab, ac, bc) = (b - a, c - a, c - b);
        let longest = ab.norm_squared().max(ac.norm_squared()).max(bc.norm_squared());
        Self { a, ab, ac, flat: ab.cross(&ac).norm() <= MIN_SINE * longest }
    }

    /// Vector from the nearest point of the triangle to `p`, and where that point lies.
    ///
    /// The seven Voronoi regions of the triangle: C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5. Corners
    /// on one line, or in one place, are three segments.
    #[inline]
    pub fn nearest(self, p: &Vector3<f64>) -> (Vector3<f64>, Feature) {
        let Self { a, ab, ac, flat } = self;
        if flat {
            return self.nearest_flat(p);
        }
        let ap = p - a;
        let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return (ap, Feature::Vertex(0));
        }
        let bp = ap - ab;
        let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
        if d3 >= 0.0 && d4 <= d3 {
            return (bp, Feature::Vertex(1));
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return (ap - ab * (d1 / (d1 - d3)), Feature::Edge(0));
        }
        let cp = ap - ac;
        let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
        if d6 >= 0.0 && d5 <= d6 {
            return (cp, Feature::Vertex(2));
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return (ap - ac * (d2 / (d2 - d6)), Feature::Edge(2));
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            return (bp - (ac - ab) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), Feature::Edge(1));
        }
        let normal = ab.cross(&ac);
        (normal * (normal.dot(&ap) / normal.norm_squared()), Feature::Face)
    }

    /// Unit normal, to the side from which the corners run counter-clockwise; `None` for corners on one line.
    pub fn normal(&self) -> Option<Vector3<f64>> {
        if self.flat { None } else { self.ab.cross(&self.ac).try_normalize(0.0) }
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (b, c) = (self.a + self.ab, self.a + self.ac);
        (self.a.inf(&b).inf(&c), self.a.sup(&b).sup(&c))
    }

    #[cold]
    fn nearest_flat(self, p: &Vector3<f64>) -> (Vector3<f64>, Feature) {
        let corners = [self.a, self.a + self.ab, self.a + self.ac];
        let mut best = (p - corners[0], Feature::Vertex(0));
        for i in 0..3 {
            let next = (i + 1) % 3;
            let (along, from) = (corners[next] - corners[i], p - corners[i]);
            let length = along.norm_squared();
            let t = if length > 0.0 { along.dot(&from) / length } else { 0.0 };
            let found = match t {
                t if t >= 1.0 => (p - corners[next], Feature::Vertex(next)),
                t if t > 0.0 => (from - along * t, Feature::Edge(i)),
                _ => (from, Feature::Vertex(i)),
            };
            if found.0.norm_squared() < best.0.norm_squared() {
                best = found;
            }
        }
        best
    }
}

/// Corners of a face relative to `origin`.
pub(super) fn corners(vertices: &[Point3<f64>], face: &[u32; 3], origin: &Point3<f64>) -> [Vector3<f64>; 3] {
    face.map(|v| vertices[v as usize] - origin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-2.0..2.0f64).prop_map(Vector3::from)
    }

    /// Smallest distance over a fine lattice of the triangle: at most `step` of the longest edge too large.
    fn by_sampling([a, b, c]: [Vector3<f64>; 3], p: &Vector3<f64>, n: i32) -> f64 {
        let mut best = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=n - i {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                best = best.min((p - (a + (b - a) * u + (c - a) * v)).norm());
            }
        }
        best
    }

    proptest! {
        #[test]
        fn agrees_with_sampling(a in point(), b in point(), c in point(), p in point(), flat in 0..4) {
            let c = match flat { 0 => a + (b - a) * 0.3, 1 => a, _ => c };
            let found = Triangle::new([a, b, c]).nearest(&p).0.norm();
            let sampled = by_sampling([a, b, c], &p, 60);
            let longest = (b - a).norm().max((c - a).norm()).max((c - b).norm());
            prop_assert!(found <= sampled + 1e-9 && sampled <= found + longest / 60.0, "{found} against {sampled}");
        }
    }

    #[test]
    fn every_region_is_named() {
        let triangle = Triangle::new([Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0)]);
        let cases = [
            ([0.2, 0.2, 3.0], 3.0, Feature::Face),
            ([0.2, 0.2, 0.0], 0.0, Feature::Face),
            ([0.5, -2.0, 0.0], 2.0, Feature::Edge(0)),
            ([1.0, 1.0, 0.0], 0.5f64.sqrt(), Feature::Edge(1)),
            ([-2.0, 0.5, 0.0], 2.0, Feature::Edge(2)),
            ([-3.0, -4.0, 0.0], 5.0, Feature::Vertex(0)),
            ([4.0, -1.0, 0.0], 10f64.sqrt(), Feature::Vertex(1)),
            ([-1.0, 4.0, 0.0], 10f64.sqrt(), Feature::Vertex(2)),
        ];
        for (p, distance, feature) in cases {
            let (to_point, found) = triangle.nearest(&Vector3::from(p));
            assert!((to_point.norm() - distance).abs() < 1e-15, "{p:?}");
            assert_eq!(found, feature, "{p:?}");
        }
    }
}
