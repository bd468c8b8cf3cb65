//! Back-substitution of the points, and the cost of the state that a step leads to.

use super::layout::Layout;
use super::linearise::{Linearised, ObservationJacobian, PointNormal, linearise_observation, robust_weight};
use super::pieces::{Sliced, for_each_piece};
use super::schur::{Reduced, damped_inverse, damping, point_step};
use super::state::State;
use crate::robust::Loss;
use nalgebra::Vector3;

/// A point whose cost a step changes by more than this, half of what a right observation has, is adjusted alone: points with a wrong
/// observation or a narrow angle bend more than the linear model knows, and would shorten the steps of all others.
const RISE: f64 = 0.5;
const SETTLE_STEPS: usize = 5;
const SETTLE_RADIUS: f64 = 100.0;
const SETTLED: f64 = 0.01;

/// What the points' part of a step sums up to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StepSums {
    /// Of the image observations after the step; infinite when one of them no longer projects.
    pub cost: f64,
    /// Decrease of the cost that the linear model promises.
    pub model_decrease: f64,
    /// Largest step of a point, and of one relative to its norm.
    step_max: f64,
    relative_max: f64,
    norm_squared: f64,
}

impl StepSums {
    fn add(&mut self, other: &Self) {
        self.cost += other.cost;
        self.model_decrease += other.model_decrease;
        self.step_max = self.step_max.max(other.step_max);
        self.relative_max = self.relative_max.max(other.relative_max);
        self.norm_squared += other.norm_squared;
    }

    /// Root mean square of the norms of the points.
    pub fn world_size(&self, points: usize) -> f64 {
        (self.norm_squared / points.max(1) as f64).sqrt()
    }

    /// The largest relative change of a point: see [`super::AdjustOptions::parameter_tolerance`].
    pub fn largest_step(&self, world: f64) -> f64 {
        // A point's own norm counts where it is larger than the world.
        self.relative_max.min(if world > 0.0 { self.step_max / world } else { f64::INFINITY })
    }
}

/// Workspace.
#[derive(Debug)]
pub(super) struct Stepper {
    sums: Vec<StepSums>,
    /// Whether points that the linear model serves badly are adjusted alone.
    settles: bool,
}

impl Stepper {
    pub fn new(layout: &Layout) -> Self {
        Self { sums: vec![StepSums::default(); layout.piece_count()], settles: true }
    }

    /// Takes the step of the linear model as it is from now on.
    #[cfg(test)]
    pub fn linear(self) -> Self {
        Self { settles: false, ..self }
    }

    /// Moves the points of `to`, whose kept blocks are already moved, and evaluates it. `reduced.rhs` is the step.
    ///
    /// With (H + D) x = -g, the linear model promises a decrease of -g.x - x.H x / 2 = (x.D x - g.x) / 2.
    ///
    /// A point that would come to lie behind a camera that sees it (or beyond the fold of its distortion) stays where it
    /// was in this step; if it does not project from there either, the cost is infinite.
    #[expect(clippy::too_many_arguments, reason = "all of the solver's state meets here")]
    pub fn step(
        &mut self,
        layout: &Layout,
        linear: &Linearised,
        reduced: &Reduced,
        radius: f64,
        loss: &Loss,
        from: &State,
        to: &mut State,
        parallel: bool,
    ) -> StepSums {
        let mut points = std::mem::take(&mut to.points);
        let (target, settles): (&State, bool) = (to, self.settles);
        let data = (Sliced::new(&mut points, &layout.pieces.slots), Sliced::new(&mut self.sums, &layout.pieces.ones));
        for_each_piece(0..layout.piece_count(), data, parallel, &|piece, (points, sums)| {
            let first = layout.pieces.slots[piece];
            let mut sum = StepSums::default();
            for (k, point) in points.into_inner().iter_mut().enumerate() {
                let (s, old) = (first + k, &from.points[first + k]);
                let step = if layout.slots[s].free { back_substitute(layout, linear, reduced, s) } else { [0.0; 3] };
                *point = [old[0] + step[0], old[1] + step[1], old[2] + step[2]];
                let mut cost = slot_cost(layout, target, loss, s, point);
                if !cost.is_finite() {
                    *point = *old;
                    cost = slot_cost(layout, target, loss, s, point);
                }
                if settles && layout.slots[s].free && (cost - linear.points[s].cost).abs() > RISE {
                    cost = settle(layout, target, loss, s, point, cost);
                }
                sum.cost += cost;
                let normal = &linear.points[s];
                for (i, diagonal) in [normal.h[0], normal.h[2], normal.h[5]].into_iter().enumerate() {
                    sum.model_decrease += 0.5 * step[i] * (damping(diagonal, radius) * step[i] - normal.g[i]);
                }
                let (length, norm) = (Vector3::from(step).norm(), Vector3::from(*old).norm());
                sum.step_max = sum.step_max.max(length);
                sum.relative_max = sum.relative_max.max(if length > 0.0 { length / norm } else { 0.0 });
                sum.norm_squared += norm * norm;
            }
            sums.into_inner()[0] = sum;
        });
        to.points = points;
        let mut total = StepSums::default();
        self.sums.iter().for_each(|s| total.add(s));
        for ((d, g), added) in reduced.rhs.iter().zip(&reduced.gradient).zip(&reduced.damping) {
            total.model_decrease += 0.5 * d * (added * d - g);
        }
        total
    }
}

/// Adjusts a point alone, by a few steps of Levenberg & Marquardt; returns the cost of its observations.
fn settle(layout: &Layout, state: &State, loss: &Loss, s: usize, point: &mut [f64; 3], mut cost: f64) -> f64 {
    let mut j = ObservationJacobian::default();
    let observations = &layout.obs[layout.slots[s].first_obs as usize..layout.slots[s + 1].first_obs as usize];
    let mut radius = SETTLE_RADIUS;
    for _ in 0..SETTLE_STEPS {
        let mut normal = PointNormal::default();
        for o in observations {
            if !linearise_observation(layout, state, loss, point, o, &mut j) {
                return cost;
            }
            normal.add(&j);
        }
        let step = point_step(&normal, &damped_inverse(&normal.h, radius), &[0.0; 3]);
        let moved = [point[0] + step[0], point[1] + step[1], point[2] + step[2]];
        let new = slot_cost(layout, state, loss, s, &moved);
        if new < cost {
            (*point, radius) = (moved, radius * 10.0);
            let gain = cost - new;
            cost = new;
            if gain < SETTLED * cost {
                break;
            }
        } else {
            radius /= 100.0;
        }
    }
    cost
}

fn back_substitute(layout: &Layout, linear: &Linearised, reduced: &Reduced, s: usize) -> [f64; 3] {
    let mut w_step = [0.0; 3];
    let range = layout.slots[s].first_incidence as usize..layout.slots[s + 1].first_incidence as usize;
    for incidence in &layout.incidences[range] {
        let d = &reduced.rhs[layout.offsets[incidence.block as usize]..layout.offsets[incidence.block as usize + 1]];
        let w = &linear.w[incidence.w..][..3 * d.len()];
        for (sum, column) in w_step.iter_mut().zip(w.chunks_exact(d.len())) {
            for (w, d) in column.iter().zip(d) {
                *sum += w * d;
            }
        }
    }
    point_step(&linear.points[s], &reduced.point_inverse[s], &w_step)
}

/// Cost of the observations of a point; infinite when it does not project.
fn slot_cost(layout: &Layout, state: &State, loss: &Loss, s: usize, x: &[f64; 3]) -> f64 {
    let x = Vector3::from(*x);
    let mut cost = 0.0;
    for o in &layout.obs[layout.slots[s].first_obs as usize..layout.slots[s + 1].first_obs as usize] {
        let view = &layout.views[o.view as usize];
        let x_in_cam = state.views[o.view as usize].x_in_cam(&x);
        let Some(pixel) = state.cameras[view.camera as usize].project(&x_in_cam) else {
            return f64::INFINITY;
        };
        let (u, v) = ((pixel.x - o.pixel[0]) * o.inverse_sigma, (pixel.y - o.pixel[1]) * o.inverse_sigma);
        cost += 0.5 * robust_weight(loss, u * u + v * v).0;
    }
    cost
}

/// Reprojection errors of all observations that took part, pixels.
pub(super) fn reprojection_errors(layout: &Layout, state: &State) -> Vec<f64> {
    let mut errors = Vec::with_capacity(layout.obs.len() + layout.kept_observations.len());
    let mut push = |view: u32, x: Vector3<f64>, pixel: [f64; 2]| {
        let x_in_cam = state.views[view as usize].x_in_cam(&x);
        if let Some(p) = state.cameras[layout.views[view as usize].camera as usize].project(&x_in_cam) {
            errors.push((p.x - pixel[0]).hypot(p.y - pixel[1]));
        }
    };
    for (s, x) in state.points.iter().enumerate() {
        for o in &layout.obs[layout.slots[s].first_obs as usize..layout.slots[s + 1].first_obs as usize] {
            push(o.view, Vector3::from(*x), o.pixel);
        }
    }
    for (view, o) in &layout.kept_observations {
        push(*view, state.kept_points[layout.kept_points.partition_point(|&p| p < o.point)], o.pixel.into());
    }
    errors
}
