//! The Levenberg-Marquardt loop.

use super::conjugate::System;
use super::error::{AdjustError, validate};
use super::layout::{Layout, Owner};
use super::lengths::{KeptNormal, length_residuals, other_residuals};
use super::linearise::Linearised;
use super::options::AdjustOptions;
use super::problem::Problem;
use super::schur::Reduced;
use super::solve_reduced::Solver;
use super::state::State;
use super::step::{Stepper, reprojection_errors};
use super::summary::{AdjustSummary, ParameterCounts, ReprojectionErrors, Termination};

/// Below this number of observations the work is done on the calling thread: handing it out would cost more.
const PARALLEL_OBSERVATIONS: usize = 4000;
/// A step is taken when the cost falls by at least this share of what the linear model promises.
const MIN_RELATIVE_DECREASE: f64 = 1e-3;
/// Along directions that nothing determines (position, orientation and scale of a world without lengths) only the damping holds the step:
/// with a larger radius the rounding errors of the gradient would move the world.
const MAX_RADIUS: f64 = 1e9;
/// Changes of the cost below this share of it drown in rounding errors: such a step is taken unseen.
const COST_NOISE: f64 = 1e-12;
const MIN_RADIUS: f64 = 1e-32;

/// Adjusts the free blocks of a problem to minimise its cost, the sum over all residuals of rho(r^2) / 2.
///
/// Levenberg-Marquardt with the update of the trust region by Nielsen (*Damping parameter in Marquardt's method*, 1999) as
/// in Ceres, the points eliminated by Schur complement, and a Cholesky factorisation of what remains. The damping takes
/// care of the gauge: without lengths or fixed poses the result keeps, nearly, the position and the scale of the start.
///
/// Observations whose point does not project at the start are left out and counted in the summary. After that, a point
/// that a step would take behind a camera stays for this step, and a step that would do so even then is rejected.
///
/// The result is the same to the bit whatever the number of threads in rayon's current pool.
///
/// # Errors
/// [`AdjustError`] when an index is out of range, a value is not finite, a sigma or length is not positive, an option is
/// out of range or memory runs out. The problem is then unchanged.
pub fn adjust(problem: &mut Problem, options: &AdjustOptions) -> Result<AdjustSummary, AdjustError> {
    options.validate()?;
    validate(problem)?;
    let mut state = State::new(problem);
    let layout = Layout::new(problem, &mut state);
    state.load_points(problem, &layout);
    let outcome = minimise(problem, options, &layout, &mut state)?;
    state.store(problem, &layout);
    Ok(summarise(problem, &layout, &state, &outcome))
}

/// How the minimisation went.
struct Outcome {
    initial_cost: f64,
    final_cost: f64,
    iterations: usize,
    steps_taken: usize,
    termination: Termination,
    gradient_max: f64,
}

/// The trust region.
struct Region {
    radius: f64,
    shrink: f64,
}

impl Region {
    fn accept(&mut self, ratio: f64) {
        let x = 2.0 * ratio - 1.0;
        self.radius = (self.radius / (1.0 - x * x * x).max(1.0 / 3.0)).min(MAX_RADIUS);
        self.shrink = 2.0;
    }

    fn reject(&mut self) {
        self.radius /= self.shrink;
        self.shrink *= 2.0;
    }
}

fn minimise(problem: &Problem, options: &AdjustOptions, layout: &Layout, state: &mut State) -> Result<Outcome, AdjustError> {
    let loss = &options.loss;
    let parallel = layout.obs.len() >= PARALLEL_OBSERVATIONS && rayon::current_num_threads() > 1;
    let mut linear = Linearised::new(layout);
    let mut kept = KeptNormal::new(problem, layout, state, loss, options.sensor_loss);
    let cost = linear.update(layout, state, loss, parallel) + kept.update(problem, layout, state, loss);
    let mut outcome = Outcome {
        initial_cost: cost,
        final_cost: cost,
        iterations: 0,
        steps_taken: 0,
        termination: Termination::NothingToAdjust,
        gradient_max: 0.0,
    };
    if layout.unknowns() == 0 && !layout.slots.iter().any(|s| s.free) {
        return Ok(outcome);
    }
    let mut reduced = Reduced::new(layout, &kept, if parallel { rayon::current_num_threads() } else { 1 });
    let mut solver = Solver::new(layout, &reduced.pattern)?;
    let mut stepper = Stepper::new(layout);
    let mut candidate = state.clone();
    let mut region = Region { radius: options.initial_radius, shrink: 2.0 };
    outcome.termination = Termination::MaxIterations;
    let mut fresh = true;
    while outcome.iterations < options.max_iterations {
        if region.radius < MIN_RADIUS {
            outcome.termination = Termination::NoProgress;
            break;
        }
        reduced.build(layout, &linear, &kept, region.radius, parallel);
        if fresh {
            let of_points = linear.points.iter().flat_map(|p| p.g);
            outcome.gradient_max = reduced.gradient.iter().copied().chain(of_points).fold(0.0, |m, g| f64::max(m, g.abs()));
            if outcome.gradient_max <= options.gradient_tolerance {
                outcome.termination = Termination::GradientTolerance;
                break;
            }
        }
        fresh = false;
        outcome.iterations += 1;
        let system = System { layout, linear: &linear, kept: &kept, parallel };
        if !solver.solve(&system, &mut reduced) || !candidate.set_moved(state, &reduced.rhs, layout) {
            region.reject();
            continue;
        }
        let sums = stepper.step(layout, &linear, &reduced, region.radius, loss, state, &mut candidate, parallel);
        let new_cost = sums.cost + kept.cost(problem, layout, &candidate, loss);
        let decrease = outcome.final_cost - new_cost;
        let ratio = decrease / sums.model_decrease;
        let noise = COST_NOISE * outcome.final_cost;
        let unseen = sums.model_decrease <= noise && decrease.abs() <= noise;
        let accepted = new_cost.is_finite() && sums.model_decrease > 0.0 && (ratio > MIN_RELATIVE_DECREASE || unseen);
        let world = sums.world_size(layout.slot_count());
        let largest = sums.largest_step(world).max(state.largest_step(&reduced.rhs, world, layout));
        if largest <= options.parameter_tolerance {
            // Not taken, so that the adjustment of an adjusted problem changes nothing.
            outcome.termination = Termination::ParameterTolerance;
            break;
        }
        if !accepted {
            // However little it would have changed: a shorter step may gain more.
            region.reject();
            continue;
        }
        let small_change = decrease <= options.function_tolerance * outcome.final_cost;
        std::mem::swap(state, &mut candidate);
        outcome.final_cost = new_cost;
        outcome.steps_taken += 1;
        if small_change && !unseen {
            outcome.termination = Termination::FunctionTolerance;
            break;
        }
        region.accept(if unseen { 1.0 } else { ratio });
        linear.update(layout, state, loss, parallel);
        kept.update(problem, layout, state, loss);
        fresh = true;
    }
    Ok(outcome)
}

fn summarise(problem: &Problem, layout: &Layout, state: &State, outcome: &Outcome) -> AdjustSummary {
    let mut free = ParameterCounts { points: layout.slots.iter().filter(|s| s.free).count(), ..Default::default() };
    for owner in &layout.owners {
        match *owner {
            Owner::Frame(_) => free.frames += 1,
            Owner::Sensor(_) => free.sensors += 1,
            Owner::Camera(i) => free.camera_parameters += layout.camera_free[i as usize].count as usize,
            Owner::Point(_) => free.points += 1,
        }
    }
    free.total = 6 * (free.frames + free.sensors) + free.camera_parameters + 3 * free.points;
    let observations = layout.obs.len() + layout.kept_observations.len();
    let (baselines, scale_bars) = length_residuals(problem, layout, state);
    AdjustSummary {
        initial_cost: outcome.initial_cost,
        final_cost: outcome.final_cost,
        iterations: outcome.iterations,
        steps_taken: outcome.steps_taken,
        termination: outcome.termination,
        gradient_max: outcome.gradient_max,
        observations,
        observations_left_out: layout.left_out,
        residuals: 2 * observations + baselines.len() + scale_bars.len() + other_residuals(problem, layout),
        free,
        reprojection: ReprojectionErrors::of(&mut reprojection_errors(layout, state)),
        baselines,
        scale_bars,
    }
}
