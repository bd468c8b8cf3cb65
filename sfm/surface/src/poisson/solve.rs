//! The equations of one level: conjugate gradients with a diagonal preconditioner.

use super::level::Level;
use super::screen::Pulls;
use crate::lattice::{EDGE, HALO, NODES, load_halo};
use rayon::prelude::*;

/// What a level's solver did.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Steps {
    pub(super) iterations: u32,
    /// Norm of the residual at the end, as a share of that at the start.
    pub(super) residual: f64,
}

/// Bricks a piece of parallel work.
const PIECE: usize = 16;

type Halo = [f32; HALO * HALO * HALO];

/// The matrix of one level: stiffness of trilinear elements, edge of a cell 1, plus the pulls.
pub(super) struct Matrix<'a> {
    pub(super) level: &'a Level,
    pub(super) pulls: &'a Pulls,
}

/// Stiffness of the eight nodes along x and their mass, from ten values.
#[inline]
fn line(v: &[f32]) -> ([f32; EDGE], [f32; EDGE]) {
    let stiff = std::array::from_fn(|i| 2.0 * v[i + 1] - v[i] - v[i + 2]);
    let mass = std::array::from_fn(|i| (4.0 * v[i + 1] + v[i] + v[i + 2]) * (1.0 / 6.0));
    (stiff, mass)
}

impl Matrix<'_> {
    /// The product on the unknowns of one brick; 0 elsewhere. The stiffness is K x M x M + M x K x M + M x M x K with K = (-1, 2, -1) and
    /// M = (1, 4, 1) / 6 along the axes.
    fn brick(&self, field: &[f32], brick: usize, halo: &mut Halo, pulled: &mut Halo, out: &mut [f32]) {
        let unknown = &self.level.unknown[brick];
        if unknown.iter().all(|bits| *bits == 0) {
            out.fill(0.0);
            return;
        }
        load_halo(field, &self.level.bricks.near[brick], 0.0, halo);
        // By slice: what needs mass along z, what needs stiffness.
        let mut slices = [[[0.0f32; EDGE * EDGE]; 2]; HALO];
        for (z, slice) in slices.iter_mut().enumerate() {
            let rows: [_; HALO] = std::array::from_fn(|y| line(&halo[(z * HALO + y) * HALO..][..HALO]));
            for y in 0..EDGE {
                for x in 0..EDGE {
                    let k = |row: usize| rows[row].0[x];
                    let m = |row: usize| rows[row].1[x];
                    slice[0][y * EDGE + x] = (4.0 * k(y + 1) + k(y) + k(y + 2)) * (1.0 / 6.0) + 2.0 * m(y + 1) - m(y) - m(y + 2);
                    slice[1][y * EDGE + x] = (4.0 * m(y + 1) + m(y) + m(y + 2)) * (1.0 / 6.0);
                }
            }
        }
        for z in 0..EDGE {
            for i in 0..EDGE * EDGE {
                let a = |s: usize| slices[s][0][i];
                let m = |s: usize| slices[s][1][i];
                out[z * EDGE * EDGE + i] = (4.0 * a(z + 1) + a(z) + a(z + 2)) * (1.0 / 6.0) + 2.0 * m(z + 1) - m(z) - m(z + 2);
            }
        }
        let pulls = self.pulls.of(brick);
        if !pulls.is_empty() {
            pulled.fill(0.0);
            for pull in pulls {
                pull.apply(halo, pulled);
            }
            for z in 0..EDGE {
                for y in 0..EDGE {
                    let row = &pulled[((z + 1) * HALO + y + 1) * HALO + 1..][..EDGE];
                    out[(z * EDGE + y) * EDGE..][..EDGE].iter_mut().zip(row).for_each(|(out, p)| *out += p);
                }
            }
        }
        for (z, bits) in unknown.iter().enumerate() {
            for (i, out) in out[z * EDGE * EDGE..][..EDGE * EDGE].iter_mut().enumerate() {
                if bits >> i & 1 == 0 {
                    *out = 0.0;
                }
            }
        }
    }

    /// The product; the sum of `field` times it on the unknowns, in fixed order.
    fn times(&self, field: &[f32], out: &mut [f32]) -> f64 {
        let sums: Vec<f64> = out
            .par_chunks_mut(PIECE * NODES)
            .enumerate()
            .map_init(
                || ([0.0; HALO * HALO * HALO], [0.0; HALO * HALO * HALO]),
                |(halo, pulled), (piece, out)| {
                    let mut sum = 0.0;
                    for (k, out) in out.chunks_mut(NODES).enumerate() {
                        let brick = piece * PIECE + k;
                        self.brick(field, brick, halo, pulled, out);
                        sum += dot(&field[brick * NODES..][..NODES], out);
                    }
                    sum
                },
            )
            .collect();
        sums.iter().sum()
    }

    fn inverse_diagonal(&self) -> Vec<f32> {
        let mut out = vec![0.0; self.level.bricks.len() * NODES];
        out.par_chunks_mut(NODES).enumerate().for_each(|(brick, out)| {
            // K x M x M has 2 (4/6)^2 on its diagonal, three times.
            let mut halo = [8.0 / 3.0; HALO * HALO * HALO];
            self.pulls.of(brick).iter().for_each(|pull| pull.diagonal(&mut halo));
            for (i, out) in out.iter_mut().enumerate() {
                let (x, y, z) = (i % EDGE, i / EDGE % EDGE, i / (EDGE * EDGE));
                *out = 1.0 / halo[((z + 1) * HALO + y + 1) * HALO + x + 1];
            }
        });
        out
    }

    /// Solves for the correction to `start` (NaN counts as 0 away from the unknowns), added to it where there are unknowns; returns the
    /// correction, 0 elsewhere.
    pub(super) fn solve(&self, start: &[f32], right: &[f32], max_iterations: u32, tolerance: f64) -> (Vec<f32>, Steps) {
        let n = self.level.bricks.len() * NODES;
        let (mut r, mut x, mut q) = (vec![0.0f32; n], vec![0.0f32; n], vec![0.0f32; n]);
        // NaN in nodes that no unknown needs would spoil whole rows of the separable sums.
        let known: Vec<f32> = start.par_iter().map(|v| if v.is_nan() { 0.0 } else { *v }).collect();
        self.times(&known, &mut q);
        let inverse = self.inverse_diagonal();
        r.par_iter_mut().zip(right).zip(&q).for_each(|((r, b), q)| *r = b - q);
        self.mask(&mut r);
        let mut p: Vec<f32> = r.par_iter().zip(&inverse).map(|(r, d)| r * d).collect();
        let mut rz = sum_of(&r, &p);
        let first = rz;
        let mut steps = Steps { iterations: 0, residual: 1.0 };
        while steps.iterations < max_iterations && first > 0.0 {
            let pq = self.times(&p, &mut q);
            if pq <= 0.0 {
                break;
            }
            let alpha = (rz / pq) as f32;
            let sums: Vec<f64> = x
                .par_chunks_mut(PIECE * NODES)
                .zip(r.par_chunks_mut(PIECE * NODES))
                .enumerate()
                .map(|(k, (x, r))| {
                    let at = k * PIECE * NODES;
                    let (p, q, d) = (&p[at..at + x.len()], &q[at..at + x.len()], &inverse[at..at + x.len()]);
                    let mut sum = 0.0;
                    for i in 0..x.len() {
                        x[i] += alpha * p[i];
                        r[i] -= alpha * q[i];
                        sum += f64::from(r[i]) * f64::from(r[i] * d[i]);
                    }
                    sum
                })
                .collect();
            let next: f64 = sums.iter().sum();
            let beta = (next / rz) as f32;
            rz = next;
            steps.iterations += 1;
            steps.residual = (rz / first).sqrt();
            if steps.residual <= tolerance {
                break;
            }
            p.par_iter_mut().zip(&r).zip(&inverse).for_each(|((p, r), d)| *p = r * d + beta * *p);
        }
        (x, steps)
    }

    fn mask(&self, field: &mut [f32]) {
        field.par_chunks_mut(EDGE * EDGE).enumerate().for_each(|(slice, values)| {
            let bits = self.level.unknown[slice / EDGE][slice % EDGE];
            values.iter_mut().enumerate().filter(|(i, _)| bits >> i & 1 == 0).for_each(|(_, v)| *v = 0.0);
        });
    }
}

/// A sum in lanes of fixed order.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut lanes = [0.0f64; EDGE];
    for (a, b) in a.chunks_exact(EDGE).zip(b.chunks_exact(EDGE)) {
        for i in 0..EDGE {
            lanes[i] += f64::from(a[i]) * f64::from(b[i]);
        }
    }
    lanes.iter().sum()
}

fn sum_of(a: &[f32], b: &[f32]) -> f64 {
    let sums: Vec<f64> = a.par_chunks(PIECE * NODES).zip(b.par_chunks(PIECE * NODES)).map(|(a, b)| dot(a, b)).collect();
    sums.iter().sum()
}
