//! Preconditioned conjugate gradients on the reduced system, for systems whose factorisation fills up.
//!
//! S = B - W C^-1 W^T is not formed (Agarwal et al., *Bundle adjustment in the large*, ECCV 2010): a product with it walks the points. Only
//! the blocks with sensors, cameras and kept points, which every point meets, are formed, and so are the blocks inside *clusters* of
//! consecutive frames: their factors precondition (Kushal & Agarwal, *Visibility based preconditioning for bundle adjustment*, CVPR 2012).
//! The blocks on the diagonal of a positive definite matrix are positive definite, so the factors exist.

use super::clusters::Clusters;
use super::layout::Layout;
use super::lengths::KeptNormal;
use super::linearise::Linearised;
use super::pattern::Pattern;
use super::pieces::{Sliced, for_each_piece};
use super::schur::Reduced;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, solve};
use faer::{MatMut, MatRef, Par};

/// Stop when the residual, in the norm of the preconditioner, is this share of the right-hand side: a step of an inexact Newton method
/// (Dembo, Eisenstat & Steihaug, 1982).
const FORCING: f64 = 0.03;
const MAX_ITERATIONS: usize = 300;

/// Factors and workspace.
#[derive(Debug)]
pub(super) struct Conjugate {
    /// First unknown of each cluster, of the shared blocks, and the end.
    unknowns: Vec<usize>,
    /// Where each factor begins.
    factor_start: Vec<usize>,
    factors: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    preconditioned: Vec<f64>,
    product: Vec<f64>,
    /// W C^-1 W^T x of frames as far as each piece of work contributes, one after the other.
    piece_products: Vec<f64>,
    piece_products_start: Vec<usize>,
    /// [`FORCING`], less in tests.
    forcing: f64,
}

/// What a product with S is made from.
pub(super) struct System<'a> {
    pub layout: &'a Layout,
    pub linear: &'a Linearised,
    pub kept: &'a KeptNormal,
    pub parallel: bool,
}

impl Conjugate {
    pub fn new(layout: &Layout, clusters: &Clusters) -> Self {
        let n = layout.unknowns();
        let mut unknowns: Vec<usize> = clusters.start.iter().map(|&b| layout.offsets[b]).collect();
        unknowns.push(n);
        let mut factor_start = vec![0];
        for w in unknowns.windows(2) {
            factor_start.push(factor_start[factor_start.len() - 1] + (w[1] - w[0]).pow(2));
        }
        let frames = layout.offsets[clusters.shared()];
        let pieces = layout.piece_count();
        Self {
            factors: vec![0.0; factor_start[factor_start.len() - 1]],
            unknowns,
            factor_start,
            residual: vec![0.0; n],
            direction: vec![0.0; n],
            preconditioned: vec![0.0; n],
            product: vec![0.0; n],
            piece_products: vec![0.0; frames * pieces],
            piece_products_start: (0..=pieces).map(|i| i * frames).collect(),
            forcing: FORCING,
        }
    }

    /// Solves to nearly the last digit from now on.
    #[cfg(test)]
    pub fn solve_exactly(&mut self) {
        self.forcing = 1e-12;
    }

    /// Turns the right-hand side of `reduced` into the step; false when a block is not positive definite.
    pub fn solve(&mut self, system: &System<'_>, reduced: &mut Reduced) -> bool {
        if !self.factorise(system.layout, &reduced.pattern, &reduced.values, system.parallel) {
            return false;
        }
        let n = reduced.rhs.len();
        self.residual.copy_from_slice(&reduced.rhs);
        reduced.rhs.fill(0.0);
        self.precondition(system.parallel);
        self.direction.copy_from_slice(&self.preconditioned);
        let mut rz = dot(&self.residual, &self.preconditioned);
        let enough = self.forcing * self.forcing * rz;
        for _ in 0..MAX_ITERATIONS {
            if rz <= enough {
                break;
            }
            self.multiply(system, reduced);
            let curvature = dot(&self.direction, &self.product);
            if curvature <= 0.0 || !curvature.is_finite() {
                break;
            }
            let alpha = rz / curvature;
            for i in 0..n {
                reduced.rhs[i] += alpha * self.direction[i];
                self.residual[i] -= alpha * self.product[i];
            }
            self.precondition(system.parallel);
            let next = dot(&self.residual, &self.preconditioned);
            let beta = next / rz;
            rz = next;
            for (d, z) in self.direction.iter_mut().zip(&self.preconditioned) {
                *d = z + beta * *d;
            }
        }
        true
    }

    /// Copies the blocks of the clusters out of the panels and factorises them.
    fn factorise(&mut self, layout: &Layout, pattern: &Pattern, values: &[f64], parallel: bool) -> bool {
        let unknowns = &self.unknowns;
        let mut good = vec![true; unknowns.len() - 1];
        let ones: Vec<usize> = (0..unknowns.len()).collect();
        let data = (Sliced::new(&mut self.factors, &self.factor_start), Sliced::new(&mut good, &ones));
        for_each_piece(0..unknowns.len() - 1, data, parallel, &|cluster, (factor, good)| {
            let (matrix, n) = (factor.into_inner(), unknowns[cluster + 1] - unknowns[cluster]);
            if n == 0 {
                return;
            }
            let first = layout.offsets.partition_point(|&o| o < unknowns[cluster]);
            let blocks = (first..layout.block_count()).take_while(|&a| layout.offsets[a] < unknowns[cluster + 1]);
            for a in blocks {
                let top = layout.offsets[a] - unknowns[cluster];
                for j in 0..layout.dim(a) {
                    let from = &values[pattern.panel_start[a] + j * pattern.stride[a]..];
                    matrix[(top + j) * n + top..(top + j + 1) * n].copy_from_slice(&from[..n - top]);
                }
            }
            let mut memory = MemBuffer::new(factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
            let matrix = MatMut::from_column_major_slice_mut(matrix, n, n);
            let stack = MemStack::new(&mut memory);
            good.into_inner()[0] = factor::cholesky_in_place(matrix, Default::default(), Par::Seq, stack, Default::default()).is_ok();
        });
        good.iter().all(|g| *g)
    }

    /// `preconditioned` from `residual`.
    fn precondition(&mut self, parallel: bool) {
        self.preconditioned.copy_from_slice(&self.residual);
        let (unknowns, factors, factor_start) = (&self.unknowns, &self.factors, &self.factor_start);
        let data = Sliced::new(&mut self.preconditioned, unknowns);
        for_each_piece(0..unknowns.len() - 1, data, parallel, &|cluster, part| {
            let part = part.into_inner();
            let n = part.len();
            if n == 0 {
                return;
            }
            let factor = MatRef::from_column_major_slice(&factors[factor_start[cluster]..factor_start[cluster + 1]], n, n);
            let mut memory = MemBuffer::new(solve::solve_in_place_scratch::<f64>(n, 1, Par::Seq));
            solve::solve_in_place(factor, MatMut::from_column_major_slice_mut(part, n, 1), Par::Seq, MemStack::new(&mut memory));
        });
    }

    /// `product` = S `direction`.
    fn multiply(&mut self, system: &System<'_>, reduced: &Reduced) {
        let System { layout, linear, kept, parallel } = *system;
        let frames = self.unknowns[self.unknowns.len() - 2];
        let frame_blocks = layout.offsets.partition_point(|&o| o < frames);
        let x = &self.direction;
        let pieces = &layout.pieces;
        let data = Sliced::new(&mut self.piece_products, &self.piece_products_start);
        for_each_piece(0..layout.piece_count(), data, parallel, &|piece, sums| {
            let sums = sums.into_inner();
            sums.fill(0.0);
            multiply_piece(
                layout,
                linear,
                &reduced.point_inverse,
                frame_blocks as u32,
                pieces.slots[piece]..pieces.slots[piece + 1],
                x,
                sums,
            );
        });
        let y = &mut self.product;
        y.fill(0.0);
        if frames > 0 {
            for piece in self.piece_products.chunks_exact(frames) {
                for (y, sum) in y.iter_mut().zip(piece) {
                    *y -= sum;
                }
            }
        }
        // Residuals of frames alone.
        for (a, normal) in reduced.frame_normals.as_chunks::<36>().0.iter().enumerate() {
            let from = layout.offsets[a];
            for (j, column) in normal.as_chunks::<6>().0.iter().enumerate() {
                for (i, value) in column.iter().enumerate() {
                    y[from + i] += value * x[from + j];
                }
            }
        }
        for &(a, b, start) in kept.pairs.iter().filter(|p| p.0 != p.1 && (p.1 as usize) < frame_blocks) {
            let (a, b) = (layout.offsets[a as usize], layout.offsets[b as usize]);
            for j in 0..6 {
                for i in 0..6 {
                    let value = kept.values[start + j * 6 + i];
                    y[b + i] += value * x[a + j];
                    y[a + j] += value * x[b + i];
                }
            }
        }
        // What is shared, from the panels.
        let (pattern, n) = (&reduced.pattern, x.len());
        for a in 0..layout.block_count() {
            let is_frame = a < frame_blocks;
            for j in 0..layout.dim(a) {
                let column = layout.offsets[a] + j;
                let panel = &reduced.values[pattern.panel_start[a] + j * pattern.stride[a]..][..pattern.stride[a]];
                if is_frame {
                    let below = &panel[pattern.stride[a] - (n - frames)..];
                    y[column] += dot(below, &x[frames..]);
                    add_scaled(&mut y[frames..], below, x[column]);
                } else {
                    y[column] += dot(&panel[j..], &x[column..]);
                    add_scaled(&mut y[column + 1..], &panel[j + 1..], x[column]);
                }
            }
        }
    }
}

/// Adds W C^-1 W^T x of frames, point by point.
fn multiply_piece(
    layout: &Layout,
    linear: &Linearised,
    inverses: &[[f64; 6]],
    frame_blocks: u32,
    slots: std::ops::Range<usize>,
    x: &[f64],
    sums: &mut [f64],
) {
    for s in slots {
        let range = layout.slots[s].first_incidence as usize..layout.slots[s + 1].first_incidence as usize;
        let incidences = &layout.incidences[range];
        let of_frames = &incidences[..incidences.partition_point(|i| i.block < frame_blocks)];
        let mut t = [0.0; 3];
        for incidence in of_frames {
            let x = &x[layout.offsets[incidence.block as usize]..][..6];
            for (t, column) in t.iter_mut().zip(linear.w[incidence.w..incidence.w + 18].as_chunks::<6>().0) {
                *t += column.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
            }
        }
        let [c00, c10, c11, c20, c21, c22] = inverses[s];
        let u = [c00 * t[0] + c10 * t[1] + c20 * t[2], c10 * t[0] + c11 * t[1] + c21 * t[2], c20 * t[0] + c21 * t[1] + c22 * t[2]];
        for incidence in of_frames {
            let y = &mut sums[layout.offsets[incidence.block as usize]..][..6];
            let [w0, w1, w2] = *linear.w[incidence.w..incidence.w + 18].as_chunks::<6>().0 else { continue };
            for (i, y) in y.iter_mut().enumerate() {
                *y += w0[i] * u[0] + w1[i] * u[1] + w2[i] * u[2];
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_scaled(y: &mut [f64], x: &[f64], factor: f64) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}
