//! The coarsest level: all nodes of the cube, free at its faces or outside there.

use super::samples::{Samples, cell_of};
use super::solve::Steps;
use crate::lattice::{Bricks, EDGE, NODES, encode};

/// Depth of the coarsest level where the surface is at least as fine.
pub(super) const DEPTH: u32 = 5;

/// Along one axis.
#[derive(Clone, Copy)]
enum Line {
    Stiffness,
    Mass,
}

/// Applies stiffness or mass along an axis; at the faces the elements end.
fn along(kind: Line, axis: usize, n: usize, from: &[f64], to: &mut [f64]) {
    let stride = n.pow(axis as u32);
    for (i, out) in to.iter_mut().enumerate() {
        let at = i / stride % n;
        let here = from[i];
        let (mut count, mut sum) = (0.0, 0.0);
        if at > 0 {
            (count, sum) = (count + 1.0, sum + from[i - stride]);
        }
        if at + 1 < n {
            (count, sum) = (count + 1.0, sum + from[i + stride]);
        }
        *out = match kind {
            Line::Stiffness => count * here - sum,
            Line::Mass => (2.0 * count * here + sum) / 6.0,
        };
    }
}

/// A sample on the dense level: its corners and what they weigh.
struct Pull {
    corners: [usize; 8],
    weights: [f64; 8],
    weight: f64,
}

fn pulls(samples: &Samples, depth: u32, weight: f64) -> Vec<Pull> {
    let n = (1usize << depth) + 1;
    let cells = f64::from(1u32 << depth);
    let of_cell = |(code, run): (u64, std::ops::Range<usize>)| {
        let cell = crate::lattice::decode(code);
        let (mut sum, mut area) = ([0.0; 3], 0.0);
        for sample in &samples.all[run] {
            debug_assert_eq!(cell_of(&sample.position, depth), cell);
            let w = f64::from(sample.area);
            (0..3).for_each(|a| sum[a] += w * (sample.position[a] * cells - f64::from(cell[a])));
            area += w;
        }
        let at = sum.map(|s| s / area);
        let step = |k: usize| [k & 1, k >> 1 & 1, k >> 2];
        Pull {
            corners: std::array::from_fn(|k| {
                let c: [usize; 3] = std::array::from_fn(|a| cell[a] as usize + step(k)[a]);
                (c[2] * n + c[1]) * n + c[0]
            }),
            weights: std::array::from_fn(|k| (0..3).map(|a| if step(k)[a] == 1 { at[a] } else { 1.0 - at[a] }).product()),
            weight: area * weight,
        }
    };
    samples.cells(0..samples.all.len(), depth).map(of_cell).collect()
}

/// The indicator outside, where it is given.
const OUTSIDE: f64 = 0.5;

/// Solves the coarsest level to the last digits that matter. `weight` is the screening of a unit of area, edge of a cell 1; `closed` puts the
/// faces of the cube outside.
pub(super) fn solve(samples: &Samples, depth: u32, weight: f64, right: &[f32], closed: bool) -> (Vec<f32>, Steps) {
    let n = (1usize << depth) + 1;
    let on_face = |i: usize| [i % n, i / n % n, i / (n * n)].iter().any(|&c| c == 0 || c == n - 1);
    let given: Vec<usize> = if closed { (0..n * n * n).filter(|&i| on_face(i)).collect() } else { Vec::new() };
    let pulls = if weight > 0.0 { pulls(samples, depth, weight) } else { Vec::new() };
    let mut scratch = [vec![0.0; n * n * n], vec![0.0; n * n * n], vec![0.0; n * n * n], vec![0.0; n * n * n]];
    let mut times = |p: &[f64], q: &mut [f64]| {
        let [kx, mx, a, b] = &mut scratch;
        along(Line::Stiffness, 0, n, p, kx);
        along(Line::Mass, 0, n, p, mx);
        along(Line::Mass, 1, n, kx, a);
        along(Line::Stiffness, 1, n, mx, b);
        a.iter_mut().zip(b.iter()).for_each(|(a, b)| *a += b);
        along(Line::Mass, 1, n, mx, b);
        along(Line::Mass, 2, n, a, kx);
        along(Line::Stiffness, 2, n, b, mx);
        q.iter_mut().zip(kx.iter().zip(mx.iter())).for_each(|(q, (a, b))| *q = a + b);
        for pull in &pulls {
            let value: f64 = pull.corners.iter().zip(pull.weights).map(|(&c, w)| w * p[c]).sum::<f64>() * pull.weight;
            pull.corners.iter().zip(pull.weights).for_each(|(&c, w)| q[c] += w * value);
        }
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut r: Vec<f64> = right.iter().map(|&b| f64::from(b)).collect();
    let (mut x, mut q) = (vec![0.0; r.len()], vec![0.0; r.len()]);
    given.iter().for_each(|&i| x[i] = OUTSIDE);
    times(&x, &mut q);
    r.iter_mut().zip(&q).for_each(|(r, q)| *r -= q);
    given.iter().for_each(|&i| r[i] = 0.0);
    let mut p = r.clone();
    let first = dot(&r, &r);
    let mut rr = first;
    let mut steps = Steps { iterations: 0, residual: 1.0 };
    while steps.iterations < 500 && rr > first * 1e-12 {
        times(&p, &mut q);
        given.iter().for_each(|&i| q[i] = 0.0);
        let pq = dot(&p, &q);
        if pq <= 0.0 {
            break;
        }
        let alpha = rr / pq;
        for i in 0..x.len() {
            x[i] += alpha * p[i];
            r[i] -= alpha * q[i];
        }
        let next = dot(&r, &r);
        let beta = next / rr;
        rr = next;
        p.iter_mut().zip(&r).for_each(|(p, r)| *p = r + beta * *p);
        steps = Steps { iterations: steps.iterations + 1, residual: (rr / first).sqrt() };
    }
    (x.iter().map(|&v| v as f32).collect(), steps)
}

/// The dense values in bricks; NaN in nodes outside of the cube.
pub(super) fn in_bricks(depth: u32, values: &[f32]) -> (Bricks, Vec<f32>) {
    let n = (1usize << depth) + 1;
    let side = n.div_ceil(EDGE);
    let at = |k: usize| [k % side, k / side % side, k / (side * side)];
    let bricks = Bricks::new((0..side * side * side).map(|k| encode(at(k).map(|v| v as u32))).collect());
    let mut out = vec![f32::NAN; bricks.len() * NODES];
    for (k, out) in out.iter_mut().enumerate() {
        let (first, i) = (bricks.at(k / NODES), k % NODES);
        let local = [i % EDGE, i / EDGE % EDGE, i / (EDGE * EDGE)];
        let c: [usize; 3] = std::array::from_fn(|a| first[a] as usize * EDGE + local[a]);
        if c.iter().all(|&v| v < n) {
            *out = values[(c[2] * n + c[1]) * n + c[0]];
        }
    }
    (bricks, out)
}
