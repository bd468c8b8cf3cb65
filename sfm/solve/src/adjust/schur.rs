//! The reduced system: elimination of the points.
//!
//! A step (d, e) of kept blocks and points solves the damped normal equations
//!
//! ```text
//! [ B   W ] [d]     [g]        B = F^T F + D_B,  W = F^T E,  C = E^T E + D_C,
//! [ W^T C ] [e] = - [h]        g = F^T r,        h = E^T r.
//! ```
//!
//! C is block-diagonal with a 3x3 block C_p for each point, since no residual meets two eliminated points. From the second
//! row e = -C^-1 (h + W^T d), and the first becomes S d = -(g - W C^-1 h) with the Schur complement S = B - W C^-1 W^T:
//!
//! ```text
//! S_ba = B_ba - sum over the points p that meet a and b of W_pb C_p^-1 W_pa^T.
//! ```
//!
//! S is stored as *panels*: panel a holds the columns of kept block a, by columns, with the rows of the blocks b >= a
//! that a meets. Threads share the panels out; each walks the points in order and, for every block a of p that is its
//! own, computes Y = C_p^-1 W_pa^T and subtracts W_pb Y for each b from a on in the list of p. Every element is summed by
//! one thread in the order of the points, so no bit depends on the number of threads.
//!
//! Damping as in Ceres: D = diag(F^T F) / radius, after the scaled diagonal was clamped; see [`damping`].

use super::clusters::Clusters;
use super::kernels::subtract_product;
use super::layout::{Layout, NONE};
use super::lengths::KeptNormal;
use super::linearise::{Linearised, PointNormal};
use super::pattern::Pattern;
use super::pieces::{Sliced, for_each_piece};
use scene::camera::MAX_CAMERA_PARAMS;

/// The smallest share of a diagonal element that may remain as a pivot of a point's 3x3 matrix.
const MIN_PIVOT: f64 = 1e-14;
/// A group of panels is not made much larger than this, 2 MiB: the points scatter into it.
const GROUP_VALUES: usize = 256 * 1024;
/// Nor are there many more groups than this for their size: each walks all points.
const SIZE_GROUPS: usize = 64;

/// What is added to the diagonal element h = |column|^2 of the normal matrix.
///
/// Columns are thought of as scaled by s = 1 / (1 + |column|) (Jacobi scaling), the scaled diagonal h s^2 is kept within
/// [1e-6, 1e32], divided by the radius, and scaled back: h / radius, but for columns below 1e-3. The scaling itself would
/// not change a step beyond rounding (Cholesky's error does not depend on it: van der Sluis, 1969), so nothing is scaled.
pub(super) fn damping(h: f64, radius: f64) -> f64 {
    let norm = 1.0 + h.sqrt();
    h.max(1e-6 * norm * norm).min(1e32 * norm * norm) / radius
}

/// The reduced system.
#[derive(Debug)]
pub(super) struct Reduced {
    pub pattern: Pattern,
    /// S; factorised in place where it is dense.
    pub values: Vec<f64>,
    /// -(g - W C^-1 h); becomes the step.
    pub rhs: Vec<f64>,
    /// g, of the kept blocks.
    pub gradient: Vec<f64>,
    /// Diagonal of D_B.
    pub damping: Vec<f64>,
    /// B of the diagonal blocks of frames, by columns, where conjugate gradients need them.
    pub frame_normals: Vec<f64>,
    /// C_p^-1, lower triangle by rows, by slot.
    pub point_inverse: Vec<[f64; 6]>,
    groups: Groups,
    /// Whether to use the copy of the elimination for AVX2; only true where the processor has it.
    avx2: bool,
}

impl Reduced {
    /// `threads` is how many will work on it; no bit depends on that.
    pub fn new(layout: &Layout, kept: &KeptNormal, threads: usize) -> Self {
        Self::with_pattern(layout, Pattern::new(layout, kept), threads)
    }

    pub fn with_pattern(layout: &Layout, pattern: Pattern, threads: usize) -> Self {
        // Some more groups than threads, since their work is only estimated.
        let groups = if threads > 1 { 4 * threads } else { 1 };
        let n = layout.unknowns();
        Self {
            values: vec![0.0; pattern.len()],
            rhs: vec![0.0; n],
            gradient: vec![0.0; n],
            damping: vec![0.0; n],
            frame_normals: vec![0.0; 36 * pattern.clusters().map_or(0, Clusters::shared)],
            point_inverse: vec![[0.0; 6]; layout.slot_count()],
            groups: Groups::new(layout, &pattern, groups),
            avx2: has_avx2(),
            pattern,
        }
    }

    /// Does without AVX2 from now on.
    #[cfg(test)]
    pub fn use_portable(&mut self) {
        self.avx2 = false;
    }

    /// Eliminates the points for a trust region of the given radius.
    pub fn build(&mut self, layout: &Layout, linear: &Linearised, kept: &KeptNormal, radius: f64, parallel: bool) {
        let inverses = Sliced::new(&mut self.point_inverse, &layout.pieces.slots);
        for_each_piece(0..layout.piece_count(), inverses, parallel, &|piece, inverses| {
            for (inverse, normal) in inverses.into_inner().iter_mut().zip(&linear.points[layout.pieces.slots[piece]..]) {
                *inverse = damped_inverse(&normal.h, radius);
            }
        });
        let avx2 = self.avx2;
        let (pattern, groups, inverses) = (&self.pattern, &self.groups, &self.point_inverse);
        let input = Input { layout, pattern, linear, kept, inverses, radius };
        let data = (
            Sliced::new(&mut self.values, &groups.values),
            Sliced::new(&mut self.rhs, &groups.unknowns),
            Sliced::new(&mut self.gradient, &groups.unknowns),
            (Sliced::new(&mut self.damping, &groups.unknowns), Sliced::new(&mut self.frame_normals, &groups.normals)),
        );
        for_each_piece(0..groups.blocks.len() - 1, data, parallel, &|group, (values, rhs, gradient, (added, normals))| {
            let panels = Panels {
                blocks: groups.blocks[group]..groups.blocks[group + 1],
                values: values.into_inner(),
                rhs: rhs.into_inner(),
                gradient: gradient.into_inner(),
                added: added.into_inner(),
                normals: normals.into_inner(),
            };
            panels.build(&input, avx2);
        });
    }
}

fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    let has = std::arch::is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    let has = false;
    has
}

/// Runs of kept blocks whose panels one thread makes, and where each begins.
#[derive(Debug)]
struct Groups {
    blocks: Vec<usize>,
    values: Vec<usize>,
    unknowns: Vec<usize>,
    /// Into [`Reduced::frame_normals`].
    normals: Vec<usize>,
}

impl Groups {
    /// At least `count` groups of about the same work where there are that many blocks, and more where the panels of a
    /// group would not fit the cache. The grouping decides which thread sums an element, not in which order it is summed.
    fn new(layout: &Layout, pattern: &Pattern, count: usize) -> Self {
        let frames = pattern.clusters().map_or(0, Clusters::shared);
        let mut groups = Self { blocks: vec![0], values: vec![0], unknowns: vec![0], normals: vec![0] };
        let most_work = layout.block_products.iter().sum::<usize>() / count.max(1);
        let most_values = GROUP_VALUES.max(pattern.len() / SIZE_GROUPS);
        let mut work = 0;
        for a in 0..layout.block_count() {
            work += layout.block_products[a];
            let values = pattern.panel_start[a + 1] - groups.values[groups.values.len() - 1];
            if (count > 1 && work >= most_work) || values >= most_values || a + 1 == layout.block_count() {
                groups.blocks.push(a + 1);
                groups.values.push(pattern.panel_start[a + 1]);
                groups.unknowns.push(layout.offsets[a + 1]);
                groups.normals.push(36 * frames.min(a + 1));
                work = 0;
            }
        }
        groups
    }
}

/// What panels are made from.
struct Input<'a> {
    layout: &'a Layout,
    pattern: &'a Pattern,
    linear: &'a Linearised,
    kept: &'a KeptNormal,
    inverses: &'a [[f64; 6]],
    radius: f64,
}

/// The panels of a group.
struct Panels<'a> {
    blocks: std::ops::Range<usize>,
    values: &'a mut [f64],
    rhs: &'a mut [f64],
    gradient: &'a mut [f64],
    added: &'a mut [f64],
    normals: &'a mut [f64],
}

impl Panels<'_> {
    fn build(mut self, input: &Input<'_>, avx2: bool) {
        for a in self.blocks.clone() {
            self.panel(input, a).start(input, a);
        }
        let (stride, first) = (&input.pattern.stride, self.blocks.start);
        for (i, normal) in self.normals.as_chunks_mut::<36>().0.iter_mut().enumerate() {
            let panel = &self.values[input.pattern.panel_start[first + i] - input.pattern.panel_start[first]..];
            for (j, column) in normal.as_chunks_mut::<6>().0.iter_mut().enumerate() {
                column.copy_from_slice(&panel[j * stride[first + i]..][..6]);
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        debug_assert!(!avx2);
        #[cfg(target_arch = "x86_64")]
        if avx2 {
            // SAFETY: `avx2` is only true where the processor has it.
            unsafe { self.eliminate_avx2(input) };
            return;
        }
        self.eliminate(input);
    }

    /// [`Panels::eliminate`] compiled for wider registers. Each element sees the same operations in the same order, and
    /// none is fused, so the bits are the same.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn eliminate_avx2(&mut self, input: &Input<'_>) {
        self.eliminate(input);
    }

    /// Subtracts what the points contribute, point by point as they lie in memory.
    #[inline(always)]
    fn eliminate(&mut self, input: &Input<'_>) {
        let Input { layout, pattern, linear, inverses, .. } = *input;
        let mut y = [[0.0; 3]; MAX_CAMERA_PARAMS];
        for (s, slots) in layout.slots.windows(2).enumerate() {
            let incidences = &layout.incidences[slots[0].first_incidence as usize..slots[1].first_incidence as usize];
            let mut product = slots[0].first_product;
            for (i, incidence) in incidences.iter().enumerate() {
                let (a, others) = (incidence.block as usize, &incidences[i..]);
                if a >= self.blocks.end {
                    break;
                }
                if a >= self.blocks.start {
                    let panel = self.panel(input, a);
                    let dim_a = panel.rhs.len();
                    let [c00, c10, c11, c20, c21, c22] = inverses[s];
                    let h = &linear.points[s].g;
                    let w = &linear.w[incidence.w..][..3 * dim_a];
                    for j in 0..dim_a {
                        let (w0, w1, w2) = (w[j], w[dim_a + j], w[2 * dim_a + j]);
                        y[j] = [c00 * w0 + c10 * w1 + c20 * w2, c10 * w0 + c11 * w1 + c21 * w2, c20 * w0 + c21 * w1 + c22 * w2];
                        panel.rhs[j] += y[j][0] * h[0] + y[j][1] * h[1] + y[j][2] * h[2];
                    }
                    for (k, other) in others.iter().enumerate() {
                        let Some(row) = pattern.product_row(product + k, a, other.block) else { continue };
                        let dim_b = layout.dim(other.block as usize);
                        subtract_product(
                            dim_b,
                            &mut panel.values[row..],
                            pattern.stride[a],
                            &linear.w[other.w..][..3 * dim_b],
                            &y[..dim_a],
                        );
                    }
                }
                product += others.len();
            }
        }
    }

    #[inline(always)]
    fn panel(&mut self, input: &Input<'_>, a: usize) -> Panel<'_> {
        let first_value = input.pattern.panel_start[self.blocks.start];
        let values = input.pattern.panel_start[a] - first_value..input.pattern.panel_start[a + 1] - first_value;
        let offsets = &input.layout.offsets;
        let unknowns = offsets[a] - offsets[self.blocks.start]..offsets[a + 1] - offsets[self.blocks.start];
        Panel {
            values: &mut self.values[values],
            rhs: &mut self.rhs[unknowns.clone()],
            gradient: &mut self.gradient[unknowns.clone()],
            added: &mut self.added[unknowns],
        }
    }
}

/// The columns of one kept block.
struct Panel<'a> {
    values: &'a mut [f64],
    rhs: &'a mut [f64],
    gradient: &'a mut [f64],
    added: &'a mut [f64],
}

impl Panel<'_> {
    /// B and -g, before the points.
    fn start(&mut self, input: &Input<'_>, a: usize) {
        self.sum_kept(input, a);
        self.damp(input.pattern, a, input.radius);
        for (rhs, g) in self.rhs.iter_mut().zip(&*self.gradient) {
            *rhs = -g;
        }
    }

    /// F^T F and g: the views and the residuals that meet kept blocks only.
    fn sum_kept(&mut self, input: &Input<'_>, a: usize) {
        let Input { layout, pattern, linear, kept, .. } = *input;
        let (dim_a, stride) = (self.rhs.len(), pattern.stride[a]);
        self.values.fill(0.0);
        self.gradient.copy_from_slice(&kept.gradient[layout.offsets[a]..][..dim_a]);
        for &(v, segment) in &layout.block_views[layout.block_views_start[a]..layout.block_views_start[a + 1]] {
            let view = &layout.views[v as usize];
            let d = view.row_len();
            let (h, g) = linear.views[linear.view_start[v as usize]..linear.view_start[v as usize + 1]].split_at(d * d);
            let first = view.start[segment as usize] as usize;
            for (sum, g) in self.gradient.iter_mut().zip(&g[first..]) {
                *sum += g;
            }
            for below in (segment as usize..3).filter(|&k| view.block[k] != NONE) {
                let Some(row) = pattern.row(a, view.block[below]) else { continue };
                let (start, dim_b) = (view.start[below] as usize, view.dim(below));
                for j in 0..dim_a {
                    let from = &h[(first + j) * d + start..][..dim_b];
                    for (sum, h) in self.values[j * stride + row..][..dim_b].iter_mut().zip(from) {
                        *sum += h;
                    }
                }
            }
        }
        let first_pair = kept.pairs.partition_point(|&(c, _, _)| (c as usize) < a);
        for &(_, b, start) in kept.pairs[first_pair..].iter().take_while(|&&(c, _, _)| c as usize == a) {
            let (Some(row), dim_b) = (pattern.row(a, b), layout.dim(b as usize)) else { continue };
            for j in 0..dim_a {
                for i in 0..dim_b {
                    self.values[j * stride + row + i] += kept.values[start + j * dim_b + i];
                }
            }
        }
    }

    fn damp(&mut self, pattern: &Pattern, a: usize, radius: f64) {
        let row = pattern.diagonal_row(a);
        for (j, added) in self.added.iter_mut().enumerate() {
            let diagonal = &mut self.values[j * pattern.stride[a] + row + j];
            *added = damping(*diagonal, radius);
            *diagonal += *added;
        }
    }
}

/// (h + D)^-1 of a point. A direction in which the point is not determined at all gets a tiny pivot instead of none: the
/// trust region then rejects a wild step, and the other points do not suffer.
pub(super) fn damped_inverse(h: &[f64; 6], radius: f64) -> [f64; 6] {
    let [h00, h10, h11, h20, h21, h22] = *h;
    let (d0, d1, d2) = (h00 + damping(h00, radius), h11 + damping(h11, radius), h22 + damping(h22, radius));
    let l00 = d0.sqrt();
    let (l10, l20) = (h10 / l00, h20 / l00);
    let l11 = (d1 - l10 * l10).max(MIN_PIVOT * d1).sqrt();
    let l21 = (h21 - l20 * l10) / l11;
    let l22 = (d2 - l20 * l20 - l21 * l21).max(MIN_PIVOT * d2).sqrt();
    // M = L^-1, the inverse is M^T M.
    let (m00, m11, m22) = (1.0 / l00, 1.0 / l11, 1.0 / l22);
    let m10 = -l10 * m00 * m11;
    let m21 = -l21 * m11 * m22;
    let m20 = -(l20 * m00 + l21 * m10) * m22;
    [m00 * m00 + m10 * m10 + m20 * m20, m11 * m10 + m21 * m20, m11 * m11 + m21 * m21, m22 * m20, m22 * m21, m22 * m22]
}

/// The step of a point given W^T d: -C^-1 (h + W^T d).
pub(super) fn point_step(normal: &PointNormal, inverse: &[f64; 6], w_step: &[f64; 3]) -> [f64; 3] {
    let [c00, c10, c11, c20, c21, c22] = *inverse;
    let [a, b, c] = [normal.g[0] + w_step[0], normal.g[1] + w_step[1], normal.g[2] + w_step[2]];
    [-(c00 * a + c10 * b + c20 * c), -(c10 * a + c11 * b + c21 * c), -(c20 * a + c21 * b + c22 * c)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn damped_inverse_is_the_inverse() {
        let e = Matrix3::new(3.0, 1.0, -2.0, 0.5, 4.0, 1.0, 0.1, -1.0, 2.0);
        let h = e.transpose() * e;
        let lower = [h[(0, 0)], h[(1, 0)], h[(1, 1)], h[(2, 0)], h[(2, 1)], h[(2, 2)]];
        let damped = h + Matrix3::from_diagonal(&h.diagonal().map(|d| damping(d, 10.0)));
        let [a, b, c, d, e, f] = damped_inverse(&lower, 10.0);
        let inverse = Matrix3::new(a, b, d, b, c, e, d, e, f);
        assert!((damped * inverse - Matrix3::identity()).norm() < 1e-14);
    }

    #[test]
    fn points_without_depth_stay_finite() {
        // E^T E of two observations along one ray.
        let inverse = damped_inverse(&[2.0, 0.0, 2.0, 0.0, 0.0, 0.0], 1e16);
        assert!(inverse.iter().all(|x| x.is_finite()));
    }
}
