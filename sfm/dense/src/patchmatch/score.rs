//! How well a plane explains what the neighbours see.

use super::grey::GreyView;
use super::patch::{DX, DY, Patch, RADIUS, SAMPLES, reduce};
use super::plane::{Pinhole, Plane};
use nalgebra::{Matrix3, Vector3};
use scene::Rigid3;

/// Cost of a plane that no neighbour can be asked about: more than that of any match.
pub(crate) const NO_MATCH: f32 = 2.0;
/// Cost of a neighbour that does not see the window, where others do: worse than a fair match, better than a contradiction.
const UNSEEN: f32 = 0.8;
/// At most this many neighbours are looked at.
pub(crate) const MAX_SOURCES: usize = 16;
/// Adding this to a float of 0..2^22 rounds it to a whole number, which then stands in the lowest bits of its representation.
const ROUND: f32 = 8_388_608.0;

/// A neighbour, and where the reference's pixels lie in it.
pub(crate) struct SourceView {
    pub grey: GreyView,
    /// Rows of A in (u, v, 1) ~ A (x, y, 1) + b / z, all in index coordinates.
    pub a: [[f32; 3]; 3],
    pub b: [f32; 3],
}

impl SourceView {
    /// `other_from_reference` maps camera frames; both pinholes and `grey` belong to one pyramid level.
    pub fn new(grey: GreyView, reference: &Pinhole, other: &Pinhole, other_from_reference: &Rigid3) -> Self {
        let matrix =
            |k: &Pinhole| Matrix3::new(f64::from(k.fx), 0.0, f64::from(k.cx), 0.0, f64::from(k.fy), f64::from(k.cy), 0.0, 0.0, 1.0);
        let inverse = Matrix3::new(
            1.0 / f64::from(reference.fx),
            0.0,
            -f64::from(reference.cx) / f64::from(reference.fx),
            0.0,
            1.0 / f64::from(reference.fy),
            -f64::from(reference.cy) / f64::from(reference.fy),
            0.0,
            0.0,
            1.0,
        );
        let a = matrix(other) * other_from_reference.rotation_matrix() * inverse;
        let b: Vector3<f64> = matrix(other) * other_from_reference.translation;
        let row = |i: usize| [a[(i, 0)] as f32, a[(i, 1)] as f32, a[(i, 2)] as f32];
        Self { grey, a: [row(0), row(1), row(2)], b: [b.x as f32, b.y as f32, b.z as f32] }
    }

    /// Length of d(u, v) / d(1/z): how far the pixel of this view moves, pixels for a unit of inverse depth.
    #[inline(always)]
    pub fn sensitivity(&self, x: f32, y: f32, w: f32) -> f32 {
        let [hx, hy, hz] = self.homogeneous(x, y, w);
        if hz <= 0.0 {
            return 0.0;
        }
        let inverse = 1.0 / hz;
        let (u, v) = (hx * inverse, hy * inverse);
        let (du, dv) = ((self.b[0] - u * self.b[2]) * inverse, (self.b[1] - v * self.b[2]) * inverse);
        (du * du + dv * dv).sqrt()
    }

    #[inline(always)]
    fn homogeneous(&self, x: f32, y: f32, w: f32) -> [f32; 3] {
        [0, 1, 2].map(|i| self.a[i][0] * x + self.a[i][1] * y + self.a[i][2] + self.b[i] * w)
    }
}

/// Which compiled form of the score runs. All forms give the same bits: no fused multiply-add, fixed order of sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Kernel {
    /// The widest form that this machine runs.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Portable
    }

    /// Mean over the `best` lowest costs, one minus normalised correlation each, of the neighbours: 0 perfect.
    #[inline]
    pub fn score(self, sources: &[SourceView], patch: &Patch, at: [f32; 2], plane: Plane, noise: f32, best: usize) -> f32 {
        match self {
            Self::Portable => score(sources, patch, at, plane, noise, best),
            // SAFETY: this variant is only made by `detect`, after it found AVX2.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { score_avx2(sources, patch, at, plane, noise, best) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn score_avx2(sources: &[SourceView], patch: &Patch, at: [f32; 2], plane: Plane, noise: f32, best: usize) -> f32 {
    score(sources, patch, at, plane, noise, best)
}

#[inline(always)]
fn score(sources: &[SourceView], patch: &Patch, at: [f32; 2], plane: Plane, noise: f32, best: usize) -> f32 {
    let mut costs = [UNSEEN; MAX_SOURCES];
    let mut seen = 0;
    for source in sources.iter().take(MAX_SOURCES) {
        let Some(cost) = correlate(source, patch, at, plane, noise) else { continue };
        // Insertion keeps the list sorted: it is short.
        let mut i = seen;
        while i > 0 && costs[i - 1] > cost {
            costs[i] = costs[i - 1];
            i -= 1;
        }
        costs[i] = cost;
        seen += 1;
    }
    if seen == 0 {
        return NO_MATCH;
    }
    costs[..best].iter().sum::<f32>() / best as f32
}

/// One minus the normalised correlation between the window and its image in one neighbour; `None` where that does not see it.
#[inline(always)]
fn correlate(source: &SourceView, patch: &Patch, [x, y]: [f32; 2], plane: Plane, noise: f32) -> Option<f32> {
    let grey = &source.grey;
    let centre = source.homogeneous(x, y, plane.w);
    let along_x = [0, 1, 2].map(|i| source.a[i][0] + source.b[i] * plane.gx);
    let along_y = [0, 1, 2].map(|i| source.a[i][1] + source.b[i] * plane.gy);
    // The image of the window is convex: its corners decide. The margin is far above rounding.
    let (right, bottom) = (grey.width as f32 - 1.01, grey.height as f32 - 1.01);
    const R: f32 = RADIUS as f32;
    for (dx, dy) in [(-R, -R), (R, -R), (-R, R), (R, R)] {
        let [hx, hy, hz] = [0, 1, 2].map(|i| centre[i] + along_x[i] * dx + along_y[i] * dy);
        if !(hz > 1e-6 && hx >= 0.01 * hz && hy >= 0.01 * hz && hx <= right * hz && hy <= bottom * hz) {
            return None;
        }
    }
    let inverse = 1.0 / centre[2];
    if grey.valid.get((centre[0] * inverse + 0.5) as usize, (centre[1] * inverse + 0.5) as usize) != Some(&1) {
        return None;
    }
    let (width, limit) = (grey.width as u32, ((grey.height - 1) * grey.width - 1) as u32);
    let (mut top, mut bottom) = ([0u32; SAMPLES], [0u32; SAMPLES]);
    let (mut fx, mut fy, mut index) = ([0.0f32; SAMPLES], [0.0f32; SAMPLES], [0u32; SAMPLES]);
    for k in 0..SAMPLES {
        let [hx, hy, hz] = [0, 1, 2].map(|i| centre[i] + along_x[i] * DX[k] + along_y[i] * DY[k]);
        let inverse = 1.0 / hz;
        let (u, v) = (hx * inverse, hy * inverse);
        let (ru, rv) = (u - 0.5 + ROUND, v - 0.5 + ROUND);
        fx[k] = u - (ru - ROUND);
        fy[k] = v - (rv - ROUND);
        let (iu, iv) = (ru.to_bits() & 0x7f_ffff, rv.to_bits() & 0x7f_ffff);
        index[k] = iv.wrapping_mul(width).wrapping_add(iu).min(limit);
    }
    let (upper, lower) = (&grey.pairs[..], &grey.pairs[grey.width..]);
    for k in 0..SAMPLES {
        top[k] = upper[index[k] as usize];
        bottom[k] = lower[index[k] as usize];
    }
    let (mut sum, mut squares, mut products) = ([0.0f32; 8], [0.0f32; 8], [0.0f32; 8]);
    for c in 0..SAMPLES / 8 {
        for l in 0..8 {
            let k = 8 * c + l;
            let left_right = |pair: u32| ((pair & 0xffff) as i32 as f32, (pair >> 16) as i32 as f32);
            let ((tl, tr), (bl, br)) = (left_right(top[k]), left_right(bottom[k]));
            let (t, b) = (tl + fx[k] * (tr - tl), bl + fx[k] * (br - bl));
            let s = t + fy[k] * (b - t) - patch.mean;
            let ws = patch.weight[k] * s;
            sum[l] += ws;
            squares[l] += ws * s;
            products[l] += patch.weighted_value[k] * s;
        }
    }
    let mean = reduce(sum);
    let variance = (reduce(squares) - mean * mean).max(0.0);
    Some(1.0 - reduce(products) / ((patch.variance + noise) * (variance + noise)).sqrt())
}
