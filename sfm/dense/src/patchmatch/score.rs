//! How well a plane explains what the neighbours see.

use super::grey::GreyView;
use super::offsets::LevelOffsets;
use super::patch::{DX, DY, Patch, RADIUS, SAMPLES, reduce};
use super::plane::{Pinhole, Plane};
use crate::view::{ACTIVE, INSIDE};
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
    /// What an offset of the reference's ray adds to b: rows, by its two components.
    turn: [[f32; 2]; 3],
    /// Focal lengths, and where the rays of this view pass if it is behind a port.
    focal: [f32; 2],
    offsets: Option<LevelOffsets>,
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
        let turned = matrix(other) * other_from_reference.rotation_matrix();
        let turn = |i: usize| [turned[(i, 0)] as f32, turned[(i, 1)] as f32];
        Self {
            grey,
            a: [row(0), row(1), row(2)],
            b: [b.x as f32, b.y as f32, b.z as f32],
            turn: [turn(0), turn(1), turn(2)],
            focal: [other.fx, other.fy],
            offsets: None,
        }
    }

    /// The same view behind a port.
    pub fn with_offsets(self, offsets: Option<LevelOffsets>) -> Self {
        Self { offsets, ..self }
    }

    /// b for a reference whose ray passes at an offset.
    #[inline(always)]
    fn shifted(&self, offset: &[f32; 2]) -> [f32; 3] {
        [0, 1, 2].map(|i| self.b[i] + (self.turn[i][0] * offset[0] + self.turn[i][1] * offset[1]))
    }

    /// How far the image of a point at homogeneous coordinates `h`, of inverse depth `w` in the reference, is from that of its direction.
    #[inline(always)]
    fn moved_by_port(&self, h: &[f32; 3], w: f32) -> Option<[f32; 2]> {
        let offsets = self.offsets.as_ref()?;
        let inverse = 1.0 / h[2];
        let (u, v, inverse_depth) = (h[0] * inverse, h[1] * inverse, w * inverse);
        let by = |o: [f32; 2]| [-self.focal[0] * o[0] * inverse_depth, -self.focal[1] * o[1] * inverse_depth];
        // The offset belongs to the place that is looked for: a second look there leaves a hundredth of a pixel.
        let first = by(offsets.at(u, v));
        Some(by(offsets.at(u + first[0], v + first[1])))
    }

    /// Length of d(u, v) / d(1/z): how far the pixel of this view moves, pixels for a unit of inverse depth.
    #[inline(always)]
    pub fn sensitivity(&self, x: f32, y: f32, w: f32, offset: &[f32; 2]) -> f32 {
        let b = self.shifted(offset);
        let [hx, hy, hz] = self.homogeneous(x, y, w, &b);
        if hz <= 0.0 {
            return 0.0;
        }
        let inverse = 1.0 / hz;
        let (u, v) = (hx * inverse, hy * inverse);
        let (du, dv) = ((b[0] - u * b[2]) * inverse, (b[1] - v * b[2]) * inverse);
        (du * du + dv * dv).sqrt()
    }

    #[inline(always)]
    fn homogeneous(&self, x: f32, y: f32, w: f32, b: &[f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|i| self.a[i][0] * x + self.a[i][1] * y + self.a[i][2] + b[i] * w)
    }
}

/// What is asked about every plane that is tried at a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Question<'a> {
    pub sources: &'a [SourceView],
    pub patch: &'a Patch,
    /// The pixel.
    pub at: [f32; 2],
    /// Where its ray passes; 0 without a port.
    pub offset: [f32; 2],
    /// Variance of the noise.
    pub noise: f32,
    /// How many neighbours count, 1..=[`MAX_SOURCES`].
    pub best: usize,
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

    /// Mean of the lowest costs, one minus normalised correlation each, of the neighbours: 0 perfect.
    #[inline]
    pub fn score(self, question: &Question, plane: Plane, scratch: &mut Scratch) -> f32 {
        match self {
            Self::Portable => score(question, plane, scratch),
            // SAFETY: this variant is only made by `detect`, after it found AVX2.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { score_avx2(question, plane, scratch) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn score_avx2(question: &Question, plane: Plane, scratch: &mut Scratch) -> f32 {
    score(question, plane, scratch)
}

#[inline(always)]
fn score(question: &Question, plane: Plane, scratch: &mut Scratch) -> f32 {
    let mut costs = [UNSEEN; MAX_SOURCES];
    let mut seen = 0;
    for source in question.sources.iter().take(MAX_SOURCES) {
        let Some(cost) = correlate(source, question, plane, scratch) else { continue };
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
    let best = question.best.min(MAX_SOURCES);
    costs[..best].iter().sum::<f32>() / best as f32
}

/// One minus the normalised correlation between the window and its image in one neighbour; `None` where that does not see it.
#[inline(always)]
fn correlate(source: &SourceView, question: &Question, plane: Plane, scratch: &mut Scratch) -> Option<f32> {
    let Question { patch, at: [x, y], offset, noise, .. } = *question;
    let grey = &source.grey;
    let window = Window::new(source, x, y, &offset, plane);
    // The image of the window is convex: its corners decide. The margin is far above rounding.
    let (right, bottom) = (grey.width as f32 - 1.01, grey.height as f32 - 1.01);
    const R: f32 = RADIUS as f32;
    for (dx, dy) in [(-R, -R), (R, -R), (-R, R), (R, R)] {
        let [hx, hy, hz] = window.homogeneous(dx, dy);
        let inside = hz > 1e-6 && hx >= 0.01 * hz && hy >= 0.01 * hz && hx <= right * hz && hy <= bottom * hz;
        if !inside || window.flags(grey, dx, dy) & INSIDE == 0 {
            return None;
        }
    }
    if window.flags(grey, 0.0, 0.0) & ACTIVE == 0 {
        return None;
    }
    window.sample(grey, scratch);
    // Sums over every eighth sample first: the compiler makes vectors of stores to consecutive places.
    let Scratch { values, weighted, lanes, .. } = scratch;
    for k in 0..SAMPLES {
        values[k] -= patch.mean;
        weighted[k] = patch.weight[k] * values[k];
    }
    let (v, w, r) = (&*values, &*weighted, &patch.weighted_value);
    for l in 0..8 {
        lanes[0][l] = w[l] + w[l + 8] + w[l + 16] + w[l + 24] + w[l + 32];
    }
    for l in 0..8 {
        let p = |k: usize| w[k] * v[k];
        lanes[1][l] = p(l) + p(l + 8) + p(l + 16) + p(l + 24) + p(l + 32);
    }
    for l in 0..8 {
        let p = |k: usize| r[k] * v[k];
        lanes[2][l] = p(l) + p(l + 8) + p(l + 16) + p(l + 24) + p(l + 32);
    }
    let [mean, squares, products] = lanes.map(reduce);
    let variance = (squares - mean * mean).max(0.0);
    Some(1.0 - products / ((patch.variance + noise) * (variance + noise)).sqrt())
}

/// The homography of a plane around one pixel: homogeneous coordinates at the pixel and their changes a pixel along x and y.
struct Window {
    centre: [f32; 3],
    along_x: [f32; 3],
    along_y: [f32; 3],
}

impl Window {
    #[inline(always)]
    fn new(source: &SourceView, x: f32, y: f32, offset: &[f32; 2], plane: Plane) -> Self {
        let b = source.shifted(offset);
        let mut window = Self { centre: source.homogeneous(x, y, plane.w, &b), along_x: [0.0; 3], along_y: [0.0; 3] };
        for i in 0..3 {
            window.along_x[i] = source.a[i][0] + b[i] * plane.gx;
            window.along_y[i] = source.a[i][1] + b[i] * plane.gy;
        }
        if let Some(moved) = source.moved_by_port(&window.centre, plane.w) {
            for h in [&mut window.centre, &mut window.along_x, &mut window.along_y] {
                h[0] += moved[0] * h[2];
                h[1] += moved[1] * h[2];
            }
        }
        window
    }

    #[inline(always)]
    fn homogeneous(&self, dx: f32, dy: f32) -> [f32; 3] {
        let mut out = self.centre;
        for i in 0..3 {
            out[i] += self.along_x[i] * dx + self.along_y[i] * dy;
        }
        out
    }

    /// What is known about the pixel that the offset falls on, 0 outside.
    #[inline(always)]
    fn flags(&self, grey: &GreyView, dx: f32, dy: f32) -> u8 {
        let [hx, hy, hz] = self.homogeneous(dx, dy);
        let inverse = 1.0 / hz;
        grey.valid.get((hx * inverse + 0.5) as usize, (hy * inverse + 0.5) as usize).copied().unwrap_or(0)
    }

    /// Intensities at the window's samples, which all lie inside. Plain loops over fixed lengths: the compiler makes vectors of them, but
    /// for the loads.
    #[inline(always)]
    fn sample(&self, grey: &GreyView, scratch: &mut Scratch) {
        let Scratch { fx, fy, index, top, bottom, values, .. } = scratch;
        let ([cx, cy, cz], [ax, ay, az], [bx, by, bz]) = (self.centre, self.along_x, self.along_y);
        let (width, limit) = (grey.width as u32, ((grey.height - 1) * grey.width - 1) as u32);
        for k in 0..SAMPLES {
            let (dx, dy) = (DX[k], DY[k]);
            let inverse = 1.0 / (cz + (az * dx + bz * dy));
            let u = (cx + (ax * dx + bx * dy)) * inverse;
            let v = (cy + (ay * dx + by * dy)) * inverse;
            let (ru, rv) = (u - 0.5 + ROUND, v - 0.5 + ROUND);
            fx[k] = u - (ru - ROUND);
            fy[k] = v - (rv - ROUND);
            let (iu, iv) = (ru.to_bits() & 0x7f_ffff, rv.to_bits() & 0x7f_ffff);
            index[k] = iv.wrapping_mul(width).wrapping_add(iu).min(limit);
        }
        let (upper, lower) = (&grey.pairs[..], &grey.pairs[grey.width..]);
        assert!((limit as usize) < lower.len());
        for k in 0..SAMPLES {
            // SAFETY: every index is at most `limit`, which the assertion compares with the shorter of both slices.
            unsafe {
                top[k] = *upper.get_unchecked(index[k] as usize);
                bottom[k] = *lower.get_unchecked(index[k] as usize);
            }
        }
        for k in 0..SAMPLES {
            let (tl, tr) = ((top[k] & 0xffff) as i32 as f32, (top[k] >> 16) as i32 as f32);
            let (bl, br) = ((bottom[k] & 0xffff) as i32 as f32, (bottom[k] >> 16) as i32 as f32);
            let (t, b) = (tl + fx[k] * (tr - tl), bl + fx[k] * (br - bl));
            values[k] = t + fy[k] * (b - t);
        }
    }
}

/// Room for intermediate values, so that they need not be cleared each time; what it held before does not matter.
#[derive(Clone)]
pub(crate) struct Scratch {
    fx: [f32; SAMPLES],
    fy: [f32; SAMPLES],
    index: [u32; SAMPLES],
    top: [u32; SAMPLES],
    bottom: [u32; SAMPLES],
    values: [f32; SAMPLES],
    weighted: [f32; SAMPLES],
    lanes: [[f32; 8]; 3],
}

impl Scratch {
    pub fn new() -> Self {
        let (floats, integers) = ([0.0; SAMPLES], [0; SAMPLES]);
        Self {
            fx: floats,
            fy: floats,
            index: integers,
            top: integers,
            bottom: integers,
            values: floats,
            weighted: floats,
            lanes: [[0.0; 8]; 3],
        }
    }
}
