//! The loop of LO-RANSAC.

use super::{Sampler, Scoring};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Errors are computed for this many correspondences at a time; scoring may stop after each block.
const BLOCK: usize = 128;
/// Local optimisation inside the loop sees at most this many times the sample size of inliers, evenly spread: enough to
/// find the neighbourhood (Lebeda et al. 2012 take 7 for linear least squares).
const LOCAL_SAMPLE_FACTOR: usize = 30;
/// Limits of the error, in units of the inlier limit, for the steps of one local optimisation.
const LOCAL_LIMITS: [f64; 3] = [2.0, 1.0, 1.0];
/// Rounds of refinement on all inliers at the end.
const FINAL_ROUNDS: usize = 5;

/// When to stop and what an inlier is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RansacOptions {
    /// Largest error of an inlier, in the unit of the estimator's error (each states it).
    pub max_error: f64,
    /// Probability with which a sample free of outliers is wanted, below 1.
    pub confidence: f64,
    /// Samples that are drawn in any case.
    pub min_iterations: usize,
    /// Samples that are drawn at most.
    pub max_iterations: usize,
    /// Seed of the sampler.
    pub seed: u64,
}

impl Default for RansacOptions {
    /// For errors in pixels; normalised coordinates need another `max_error`.
    fn default() -> Self {
        Self { max_error: 4.0, confidence: 0.9999, min_iterations: 30, max_iterations: 10_000, seed: 0 }
    }
}

/// A model and the correspondences that agree with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Ransac<M> {
    /// The model, refined on its inliers.
    pub model: M,
    /// Correspondences whose error is below the limit, sorted.
    pub inliers: Vec<usize>,
    /// Samples drawn.
    pub iterations: usize,
}

impl<M> Ransac<M> {
    /// The same with another representation of the model.
    pub fn map<N>(self, f: impl FnOnce(M) -> N) -> Ransac<N> {
        Ransac { model: f(self.model), inliers: self.inliers, iterations: self.iterations }
    }
}

/// A kind of model, with the correspondences it is to be estimated from.
///
/// Contract: methods are pure, so that repeated calls agree to the bit. `solve` appends zero or more models, none for a
/// degenerate sample, and never one with a value that is not finite. `refine` may give a worse model: the caller compares.
pub trait Estimator {
    /// The model.
    type Model: Clone;

    /// Number of correspondences of a minimal sample.
    fn sample_size(&self) -> usize;

    /// Number of correspondences.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends the models that fit a minimal sample.
    fn solve(&self, sample: &[usize], models: &mut Vec<Self::Model>);

    /// Squared errors of the correspondences from `start` on, as many as `out` holds; infinite or NaN for those that
    /// cannot be measured.
    fn squared_errors(&self, model: &Self::Model, start: usize, out: &mut [f64]);

    /// A better model from an approximate one and correspondences that mostly agree with it; errors beyond `max_error`
    /// must not count. `None` when there are too few.
    fn refine(&self, model: &Self::Model, inliers: &[usize], max_error: f64) -> Option<Self::Model>;
}

/// Estimates a model: random minimal samples, each improvement refined at once on its inliers, in the end on all of them.
///
/// LO-RANSAC after Chum, Matas & Kittler, *Locally optimized RANSAC*, DAGM 2003, and Lebeda, Matas & Chum, *Fixing the
/// locally optimized RANSAC*, BMVC 2012 (limited inlier sets, decreasing limits), with the estimator's nonlinear refinement in
/// place of linear least squares and inner sampling. A model is dropped as soon as its partial cost exceeds the best. Stops when
/// a sample free of outliers has been drawn with the wanted confidence, given the inliers of the best model.
///
/// `None` for options without meaning (limit or confidence not positive, NaN), fewer correspondences than a sample, or when
/// no model has at least `sample_size` inliers. Does not detect that the data are degenerate for the model (a plane for a
/// fundamental matrix): the caller compares models.
pub fn run<E: Estimator>(
    estimator: &E,
    sampler: &impl Sampler,
    scoring: &impl Scoring,
    options: &RansacOptions,
) -> Option<Ransac<E::Model>> {
    let size = estimator.sample_size();
    let valid = options.max_error > 0.0 && options.max_error.is_finite() && options.confidence > 0.0;
    if !valid || estimator.len() < size {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let mut search = Search { estimator, scoring, best: None, best_cost: f64::INFINITY };
    let mut sample = vec![0; size];
    let (mut models, mut inliers) = (Vec::new(), Vec::new());
    let (mut iterations, mut needed) = (0, options.max_iterations);
    while iterations < needed.max(options.min_iterations).min(options.max_iterations) {
        iterations += 1;
        if !sampler.draw(&mut rng, &mut sample) {
            return None;
        }
        models.clear();
        estimator.solve(&sample, &mut models);
        let mut improved = false;
        for model in &models {
            improved |= search.offer(model);
        }
        if improved {
            search.optimise_locally(options.max_error, size * LOCAL_SAMPLE_FACTOR);
            search.inliers(options.max_error, &mut inliers);
            needed = iterations_needed(options, sampler.success_probability(&inliers, size));
        }
    }
    search.finish(options.max_error, iterations)
}

/// Refines a model that came from elsewhere, as [`run`] does with those of its samples: on limited inlier sets with decreasing limits, then on
/// all inliers. Draws no sample: `iterations` is 0.
///
/// `None` for a limit without meaning, and when the model does not have at least `sample_size` inliers.
pub fn improve<E: Estimator>(estimator: &E, scoring: &impl Scoring, model: E::Model, max_error: f64) -> Option<Ransac<E::Model>> {
    if !(max_error > 0.0 && max_error.is_finite()) {
        return None;
    }
    let mut search = Search { estimator, scoring, best: None, best_cost: f64::INFINITY };
    search.offer(&model);
    search.optimise_locally(max_error, estimator.sample_size() * LOCAL_SAMPLE_FACTOR);
    search.finish(max_error, 0)
}

/// Samples after which one free of outliers was drawn with the wanted confidence.
fn iterations_needed(options: &RansacOptions, success: f64) -> usize {
    if success >= 1.0 {
        return 1;
    }
    let needed = (1.0 - options.confidence).max(f64::MIN_POSITIVE).ln() / (-success).ln_1p();
    // A float that is too large, or infinite for no success, saturates.
    needed.ceil().max(1.0).min(options.max_iterations as f64) as usize
}

struct Search<'a, E: Estimator, C> {
    estimator: &'a E,
    scoring: &'a C,
    best: Option<E::Model>,
    best_cost: f64,
}

impl<E: Estimator, C: Scoring> Search<'_, E, C> {
    /// Takes the model if it is the best so far.
    fn offer(&mut self, model: &E::Model) -> bool {
        let Some(cost) = self.cost_below(model, self.best_cost) else {
            return false;
        };
        self.best = Some(model.clone());
        self.best_cost = cost;
        true
    }

    /// Cost of a model, or `None` as soon as it reaches `bound`.
    fn cost_below(&self, model: &E::Model, bound: f64) -> Option<f64> {
        let mut errors = [0.0; BLOCK];
        let mut cost = 0.0;
        for start in (0..self.estimator.len()).step_by(BLOCK) {
            let errors = &mut errors[..BLOCK.min(self.estimator.len() - start)];
            self.estimator.squared_errors(model, start, errors);
            // Four partial sums in fixed lanes: quick, and the same on every machine.
            let mut lanes = [0.0; 4];
            for chunk in errors.chunks(4) {
                for (lane, &e) in lanes.iter_mut().zip(chunk) {
                    *lane += self.scoring.cost(e);
                }
            }
            cost += (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]);
            if cost >= bound || cost.is_nan() {
                return None;
            }
        }
        Some(cost)
    }

    /// Correspondences within `limit` of the best model, in order.
    fn inliers(&self, limit: f64, out: &mut Vec<usize>) {
        out.clear();
        let Some(model) = &self.best else {
            return;
        };
        let limit_squared = limit * limit;
        let mut errors = [0.0; BLOCK];
        for start in (0..self.estimator.len()).step_by(BLOCK) {
            let errors = &mut errors[..BLOCK.min(self.estimator.len() - start)];
            self.estimator.squared_errors(model, start, errors);
            out.extend(errors.iter().enumerate().filter(|(_, e)| **e < limit_squared).map(|(i, _)| start + i));
        }
    }

    /// Refines the best model on all of its inliers.
    fn finish(mut self, max_error: f64, iterations: usize) -> Option<Ransac<E::Model>> {
        let (mut inliers, mut previous) = (Vec::new(), Vec::new());
        for _ in 0..FINAL_ROUNDS {
            self.inliers(max_error, &mut inliers);
            if inliers == previous || !self.refine_on(&inliers, max_error) {
                break;
            }
            std::mem::swap(&mut previous, &mut inliers);
        }
        self.inliers(max_error, &mut inliers);
        if inliers.len() < self.estimator.sample_size() {
            return None;
        }
        self.best.map(|model| Ransac { model, inliers, iterations })
    }

    fn optimise_locally(&mut self, max_error: f64, limit: usize) {
        let mut inliers = Vec::new();
        for factor in LOCAL_LIMITS {
            self.inliers(factor * max_error, &mut inliers);
            if inliers.len() > limit {
                let all = inliers.len();
                inliers = (0..limit).map(|k| inliers[k * all / limit]).collect();
            }
            self.refine_on(&inliers, factor * max_error);
        }
    }

    /// Refines the best model; whether that improved it.
    fn refine_on(&mut self, inliers: &[usize], max_error: f64) -> bool {
        let refined = self.best.as_ref().and_then(|m| self.estimator.refine(m, inliers, max_error));
        refined.is_some_and(|model| self.offer(&model))
    }
}
