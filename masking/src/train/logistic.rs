//! Logistic regression.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Rows that one task works on: fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 4096;
/// Newton's method settles within ten steps; a class that can be told without any error needs the regularisation to stop it.
const MAX_STEPS: usize = 50;
/// A step that lowers the loss by less than this share is the last.
const CONVERGED: f64 = 1e-9;

/// Weights and bias that minimise the mean logistic loss, both classes weighted alike, plus `regularisation` times half the squared weights of the features
/// brought to mean 0 and standard deviation 1. By Newton's method (iteratively reweighted least squares) with halved steps where needed.
///
/// `rows` are the features of one sample after the other. Without samples of one class all weights are zero.
pub(super) fn fit(rows: &[f32], structure: &[bool], regularisation: f64) -> (Vec<f32>, f32) {
    let width = rows.len() / structure.len().max(1);
    let problem = Problem::new(rows, structure, width, regularisation);
    let mut at = DVector::zeros(width + 1);
    let mut loss = problem.loss(&at);
    for _ in 0..MAX_STEPS {
        let (gradient, hessian) = problem.normal_equations(&at);
        let Some(factor) = hessian.cholesky() else { break };
        let step = factor.solve(&gradient);
        let tried = (0..20).map(|halvings| &at - &step * 0.5f64.powi(halvings)).map(|p| (problem.loss(&p), p));
        let Some((lower, next)) = tried.into_iter().find(|(l, _)| *l < loss) else { break };
        let gained = (loss - lower) / loss;
        (at, loss) = (next, lower);
        if gained < CONVERGED {
            break;
        }
    }
    problem.for_raw_features(&at)
}

struct Problem<'a> {
    rows: &'a [f32],
    structure: &'a [bool],
    width: usize,
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// Weight of a sample of background and of structure.
    class_weight: [f64; 2],
    regularisation: f64,
}

impl<'a> Problem<'a> {
    fn new(rows: &'a [f32], structure: &'a [bool], width: usize, regularisation: f64) -> Self {
        let count = structure.len().max(1) as f64;
        let of = |s: bool| structure.iter().filter(|x| **x == s).count().max(1) as f64;
        let sums = |centre: &[f64], square: bool| {
            let parts: Vec<Vec<f64>> = rows
                .par_chunks(CHUNK * width.max(1))
                .map(|chunk| {
                    let mut sums = vec![0.0; width];
                    for row in chunk.chunks_exact(width) {
                        for ((sum, &v), c) in sums.iter_mut().zip(row).zip(centre) {
                            let d = f64::from(v) - c;
                            *sum += if square { d * d } else { d };
                        }
                    }
                    sums
                })
                .collect();
            parts.iter().fold(vec![0.0; width], |mut all, part| {
                all.iter_mut().zip(part).for_each(|(a, p)| *a += p);
                all
            })
        };
        let mean: Vec<f64> = sums(&vec![0.0; width], false).iter().map(|s| s / count).collect();
        // A feature that never changes says nothing: its weight stays zero.
        let scale = sums(&mean, true).iter().map(|s| (s / count).sqrt()).map(|s| if s > 1e-9 { 1.0 / s } else { 0.0 }).collect();
        Self { rows, structure, width, mean, scale, class_weight: [0.5 / of(false), 0.5 / of(true)], regularisation }
    }

    /// Standardised features of a chunk with a last row of ones: a column a sample.
    fn columns(&self, chunk: &[f32]) -> DMatrix<f64> {
        let count = chunk.len() / self.width;
        let mut columns = DMatrix::zeros(self.width + 1, count);
        for (mut column, row) in columns.column_iter_mut().zip(chunk.chunks_exact(self.width)) {
            for (i, &v) in row.iter().enumerate() {
                column[i] = (f64::from(v) - self.mean[i]) * self.scale[i];
            }
            column[self.width] = 1.0;
        }
        columns
    }

    fn chunks(&self) -> impl IndexedParallelIterator<Item = (&[f32], &[bool])> {
        self.rows.par_chunks(CHUNK * self.width.max(1)).zip(self.structure.par_chunks(CHUNK))
    }

    fn penalty(&self, at: &DVector<f64>) -> f64 {
        0.5 * self.regularisation * at.rows(0, self.width).norm_squared()
    }

    fn loss(&self, at: &DVector<f64>) -> f64 {
        let parts: Vec<f64> = self
            .chunks()
            .map(|(chunk, labels)| {
                let logits = self.columns(chunk).tr_mul(at);
                let one = |(z, &s): (&f64, &bool)| {
                    let margin = if s { *z } else { -z };
                    // log(1 + exp(-m)) without overflow.
                    self.class_weight[usize::from(s)] * ((-margin.abs()).exp().ln_1p() + (-margin).max(0.0))
                };
                logits.iter().zip(labels).map(one).sum()
            })
            .collect();
        parts.iter().sum::<f64>() + self.penalty(at)
    }

    fn normal_equations(&self, at: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.width + 1;
        let parts: Vec<(DVector<f64>, DMatrix<f64>)> = self
            .chunks()
            .map(|(chunk, labels)| {
                let mut columns = self.columns(chunk);
                let logits = columns.tr_mul(at);
                let mut residuals = DVector::zeros(labels.len());
                let mut roots = vec![0.0; labels.len()];
                for (i, (&z, &s)) in logits.iter().zip(labels).enumerate() {
                    let p = 1.0 / (1.0 + (-z).exp());
                    let weight = self.class_weight[usize::from(s)];
                    residuals[i] = weight * (p - f64::from(u8::from(s)));
                    roots[i] = (weight * p * (1.0 - p)).sqrt();
                }
                let gradient = &columns * residuals;
                columns.column_iter_mut().zip(roots).for_each(|(mut column, root)| column *= root);
                let hessian = &columns * columns.transpose();
                (gradient, hessian)
            })
            .collect();
        let mut gradient = DVector::zeros(n);
        let mut hessian = DMatrix::zeros(n, n);
        for (g, h) in parts {
            gradient += g;
            hessian += h;
        }
        for i in 0..self.width {
            gradient[i] += self.regularisation * at[i];
            hessian[(i, i)] += if self.scale[i] > 0.0 { self.regularisation } else { 1.0 };
        }
        // The bias is not drawn to zero; this only keeps the matrix definite where all samples are told for certain.
        hessian[(self.width, self.width)] += 1e-12;
        (gradient, hessian)
    }

    fn for_raw_features(&self, at: &DVector<f64>) -> (Vec<f32>, f32) {
        let weights: Vec<f64> = (0..self.width).map(|i| at[i] * self.scale[i]).collect();
        let bias = at[self.width] - weights.iter().zip(&self.mean).map(|(w, m)| w * m).sum::<f64>();
        (weights.iter().map(|w| *w as f32).collect(), bias as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::samples::hash;
    use super::*;

    fn uniform(i: u64) -> f64 {
        (hash(5, i) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Samples whose classes follow the logistic model: logit = 1.5 x - 2 y + 0.5, over a third feature that never changes.
    fn drawn(count: u64) -> (Vec<f32>, Vec<bool>) {
        let (mut rows, mut labels) = (Vec::new(), Vec::new());
        for i in 0..count {
            let (x, y) = (4.0 * uniform(3 * i) - 2.0, 4.0 * uniform(3 * i + 1) - 2.0);
            let p = 1.0 / (1.0 + (-(1.5 * x - 2.0 * y + 0.5)).exp());
            rows.extend([x as f32, y as f32, 3.0]);
            labels.push(uniform(3 * i + 2) < p);
        }
        (rows, labels)
    }

    #[test]
    fn the_model_that_drew_the_samples_is_found() {
        let (rows, labels) = drawn(40_000);
        let (weights, bias) = fit(&rows, &labels, 0.0);
        // Classes weighted alike move the bias by the logarithm of their odds and nothing else (Prentice and Pyke, Biometrika 1979).
        let structure = labels.iter().filter(|s| **s).count() as f64;
        let expected = 0.5 - (structure / (labels.len() as f64 - structure)).ln();
        // Three standard deviations: each weight is known to some 0.02 from 40,000 samples.
        for (found, expected) in [(weights[0], 1.5), (weights[1], -2.0), (weights[2], 0.0), (bias, expected)] {
            assert!((f64::from(found) - expected).abs() < 0.07, "{weights:?} {bias}, {expected}");
        }
    }

    #[test]
    fn classes_without_overlap_stay_finite_and_regularisation_shrinks() {
        let rows: Vec<f32> = (0..200).map(|i| i as f32).collect();
        let labels: Vec<bool> = (0..200).map(|i| i >= 100).collect();
        let [loose, tight] = [1e-4, 1e-1].map(|l| fit(&rows, &labels, l));
        assert!(loose.0[0].is_finite() && loose.0[0] > tight.0[0] && tight.0[0] > 0.0);
        assert!((-loose.1 / loose.0[0] - 99.5).abs() < 0.5, "the border lies in the middle");
    }

    #[test]
    fn weights_are_the_same_with_any_number_of_threads() {
        let (rows, labels) = drawn(9000);
        let with = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool").install(|| fit(&rows, &labels, 1e-3));
        assert_eq!(with(1), with(3));
    }
}
