//! Point pairs laid out for scoring.

use nalgebra::{Matrix3, Vector2, Vector3};

/// Finite point pairs as one array a coordinate, with their positions in the input.
pub(super) struct Matches {
    pub x1: Vec<f64>,
    pub y1: Vec<f64>,
    pub x2: Vec<f64>,
    pub y2: Vec<f64>,
    /// Index in the caller's lists; rising.
    pub source: Vec<usize>,
}

/// Translation and common scale that take raw coordinates to conditioned ones.
pub(super) struct Conditioning {
    pub centre1: Vector2<f64>,
    pub centre2: Vector2<f64>,
    pub scale: f64,
}

impl Matches {
    /// Pairs with a coordinate that is not finite are left out; a longer list is cut to the length of the other.
    pub(super) fn new(x1: &[Vector2<f64>], x2: &[Vector2<f64>]) -> Self {
        let finite = |p: &Vector2<f64>| p.x.is_finite() && p.y.is_finite();
        let mut out = Self { x1: Vec::new(), y1: Vec::new(), x2: Vec::new(), y2: Vec::new(), source: Vec::new() };
        for (i, (a, b)) in x1.iter().zip(x2).enumerate().filter(|(_, (a, b))| finite(a) && finite(b)) {
            out.x1.push(a.x);
            out.y1.push(a.y);
            out.x2.push(b.x);
            out.y2.push(b.y);
            out.source.push(i);
        }
        out
    }

    /// Moves both images' centroids to the origin and scales both by one factor, so that the mean distance is sqrt 2
    /// (Hartley, *In defence of the 8-point algorithm*, PAMI 1997, there with a factor an image): errors keep their ratio.
    ///
    /// `None` when all points are in one place.
    pub(super) fn conditioned(mut self) -> Option<(Self, Conditioning)> {
        let n = self.len() as f64;
        let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
        let centre1 = Vector2::new(mean(&self.x1), mean(&self.y1));
        let centre2 = Vector2::new(mean(&self.x2), mean(&self.y2));
        let mut spread = 0.0;
        for i in 0..self.len() {
            spread += (self.first(i).xy() - centre1).norm() + (self.second(i).xy() - centre2).norm();
        }
        let scale = 2.0 * n * std::f64::consts::SQRT_2 / spread;
        if !(scale.is_finite() && scale > 0.0) {
            return None;
        }
        let shifts = [centre1.x, centre1.y, centre2.x, centre2.y];
        for (values, shift) in [&mut self.x1, &mut self.y1, &mut self.x2, &mut self.y2].into_iter().zip(shifts) {
            values.iter_mut().for_each(|v| *v = (*v - shift) * scale);
        }
        Some((self, Conditioning { centre1, centre2, scale }))
    }

    pub(super) fn len(&self) -> usize {
        self.source.len()
    }

    /// Homogeneous point in the first image.
    #[inline]
    pub(super) fn first(&self, i: usize) -> Vector3<f64> {
        Vector3::new(self.x1[i], self.y1[i], 1.0)
    }

    /// Homogeneous point in the second image.
    #[inline]
    pub(super) fn second(&self, i: usize) -> Vector3<f64> {
        Vector3::new(self.x2[i], self.y2[i], 1.0)
    }

    /// The points of a minimal sample.
    pub(super) fn sample<const N: usize>(&self, sample: &[usize]) -> ([Vector2<f64>; N], [Vector2<f64>; N]) {
        (std::array::from_fn(|k| self.first(sample[k]).xy()), std::array::from_fn(|k| self.second(sample[k]).xy()))
    }
}

impl Conditioning {
    fn matrix(&self, centre: &Vector2<f64>) -> Matrix3<f64> {
        let s = self.scale;
        Matrix3::new(s, 0.0, -s * centre.x, 0.0, s, -s * centre.y, 0.0, 0.0, 1.0)
    }

    /// Raw to conditioned, first image.
    pub(super) fn first(&self) -> Matrix3<f64> {
        self.matrix(&self.centre1)
    }

    /// Raw to conditioned, second image.
    pub(super) fn second(&self) -> Matrix3<f64> {
        self.matrix(&self.centre2)
    }
}
