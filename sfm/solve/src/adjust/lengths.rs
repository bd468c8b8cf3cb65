//! Residuals that meet kept blocks only: lengths, priors, and the observations of kept points.
//!
//! There are few of them, so they are added one by one, in order.

use super::layout::{Layout, NONE, Obs, Owner};
use super::linearise::{ObservationJacobian, linearise_observation, robust_weight};
use super::problem::{Baseline, PosePrior, Problem};
use super::sensors::{across, control_point_rows, direction_rows, heading_row, position_rows};
use super::state::State;
use super::summary::LengthResidual;
use crate::lie::{so3_left_jacobian_inverse, so3_log};
use crate::robust::Loss;
use nalgebra::Vector3;
use scene::Rigid3;
use scene::camera::MAX_CAMERA_PARAMS;

/// One scalar residual and its gradient with respect to up to four kept blocks.
#[derive(Default)]
pub(super) struct Row {
    residual: f64,
    count: usize,
    blocks: [u32; 4],
    gradients: [[f64; MAX_CAMERA_PARAMS]; 4],
}

impl Row {
    pub fn new(residual: f64) -> Self {
        Self { residual, ..Self::default() }
    }

    /// Adds the gradient with respect to a block; a block met twice has one gradient, the sum.
    pub fn add(&mut self, block: u32, gradient: &[f64]) {
        if block == NONE {
            return;
        }
        let i = self.blocks[..self.count].iter().position(|&b| b == block).unwrap_or(self.count);
        self.count = self.count.max(i + 1);
        self.blocks[i] = block;
        for (sum, g) in self.gradients[i].iter_mut().zip(gradient) {
            *sum += g;
        }
    }

    fn scale(&mut self, factor: f64) {
        self.residual *= factor;
        self.gradients[..self.count].iter_mut().flatten().for_each(|g| *g *= factor);
    }
}

/// Normal equations of these residuals.
#[derive(Debug, Default)]
pub(super) struct KeptNormal {
    /// (column block, row block, begin in `values`), ascending, row block at least the column block. The values of a
    /// pair stand by columns.
    pub pairs: Vec<(u32, u32, usize)>,
    pub values: Vec<f64>,
    pub gradient: Vec<f64>,
    observations: Vec<(Obs, u32)>,
    /// Loss of positions, directions and headings.
    sensor_loss: Loss,
}

impl KeptNormal {
    pub fn new(problem: &Problem, layout: &Layout, state: &State, loss: &Loss, sensor_loss: Loss) -> Self {
        let observation = |(view, o): &(u32, super::ImageObservation)| {
            let kept = layout.kept_points.partition_point(|&p| p < o.point) as u32;
            (Obs { view: *view, incidence: [NONE; 3], pixel: o.pixel.into(), inverse_sigma: 1.0 / o.sigma_px }, kept)
        };
        let mut normal = Self { observations: layout.kept_observations.iter().map(observation).collect(), sensor_loss, ..Self::default() };
        let mut pairs = Vec::new();
        normal.visit(problem, layout, state, loss, |row| {
            let blocks = &row.blocks[..row.count];
            pairs.extend(blocks.iter().flat_map(|&a| blocks.iter().map(move |&b| (a.min(b), a.max(b)))));
        });
        pairs.sort_unstable();
        pairs.dedup();
        let mut len = 0;
        for (a, b) in pairs {
            normal.pairs.push((a, b, len));
            len += layout.dim(a as usize) * layout.dim(b as usize);
        }
        normal.values = vec![0.0; len];
        normal.gradient = vec![0.0; layout.unknowns()];
        normal
    }

    /// Computes the normal equations at `state`; returns the cost, infinite when a point does not project.
    pub fn update(&mut self, problem: &Problem, layout: &Layout, state: &State, loss: &Loss) -> f64 {
        let (mut values, mut gradient) = (std::mem::take(&mut self.values), std::mem::take(&mut self.gradient));
        values.fill(0.0);
        gradient.fill(0.0);
        let cost = self.visit(problem, layout, state, loss, |row| {
            for (&a, g_a) in row.blocks[..row.count].iter().zip(&row.gradients) {
                let dim_a = layout.dim(a as usize);
                for (sum, g) in gradient[layout.offsets[a as usize]..][..dim_a].iter_mut().zip(g_a) {
                    *sum += g * row.residual;
                }
                for (&b, g_b) in row.blocks[..row.count].iter().zip(&row.gradients).filter(|(b, _)| **b >= a) {
                    let dim_b = layout.dim(b as usize);
                    let pair = self.pairs.partition_point(|&(c, d, _)| (c, d) < (a, b));
                    let start = self.pairs[pair].2;
                    for j in 0..dim_a {
                        for i in 0..dim_b {
                            values[start + j * dim_b + i] += g_b[i] * g_a[j];
                        }
                    }
                }
            }
        });
        (self.values, self.gradient) = (values, gradient);
        cost
    }

    /// The cost at `state`, infinite when a point does not project.
    pub fn cost(&self, problem: &Problem, layout: &Layout, state: &State, loss: &Loss) -> f64 {
        self.visit(problem, layout, state, loss, |_| {})
    }

    /// Calls `row` with the blocks of each residual and its gradients with respect to them, in the order of the problem.
    pub fn visit_rows(
        &self,
        problem: &Problem,
        layout: &Layout,
        state: &State,
        loss: &Loss,
        mut row: impl FnMut(&[u32], &[[f64; MAX_CAMERA_PARAMS]]),
    ) {
        self.visit(problem, layout, state, loss, |r| row(&r.blocks[..r.count], &r.gradients[..r.count]));
    }

    fn visit(&self, problem: &Problem, layout: &Layout, state: &State, loss: &Loss, mut row: impl FnMut(&Row)) -> f64 {
        let mut cost = 0.0;
        let mut square = |r: Row| {
            row(&r);
            cost += 0.5 * r.residual * r.residual;
        };
        for b in &problem.baselines {
            square(baseline_row(layout, state, b));
        }
        for b in &problem.scale_bars {
            square(scale_bar_row(layout, state, b));
        }
        for o in &problem.control_points {
            control_point_rows(layout, state, o, &mut square);
        }
        for (b, &owner) in layout.owners.iter().enumerate() {
            match owner {
                Owner::Frame(i) => {
                    if let Some(prior) = &problem.frames[i as usize].prior {
                        pose_prior_rows(&state.frames[i as usize], prior, b as u32, &mut square);
                    }
                }
                Owner::Sensor(i) => {
                    if let Some(prior) = &problem.sensors[i as usize].prior {
                        pose_prior_rows(&state.sensors[i as usize], prior, b as u32, &mut square);
                    }
                }
                Owner::Camera(i) => {
                    for (k, param) in layout.camera_free[i as usize].indices().enumerate() {
                        if let Some(prior) = &problem.cameras[i as usize].priors[param] {
                            let mut r = Row::new((state.cameras[i as usize].params()[param] - prior.value) / prior.sigma);
                            let mut gradient = [0.0; MAX_CAMERA_PARAMS];
                            gradient[k] = 1.0 / prior.sigma;
                            r.add(b as u32, &gradient);
                            square(r);
                        }
                    }
                }
                Owner::Point(_) => {}
            }
        }
        // The rows of an observation share its weight.
        let mut rows: Vec<Row> = Vec::new();
        let mut weigh = |rows: &mut Vec<Row>| {
            let (rho, root) = robust_weight(&self.sensor_loss, rows.iter().map(|r| r.residual * r.residual).sum());
            cost += 0.5 * rho;
            for mut r in rows.drain(..) {
                r.scale(root);
                row(&r);
            }
        };
        for o in &problem.positions {
            position_rows(layout, state, o, |r| rows.push(r));
            weigh(&mut rows);
        }
        for o in &problem.directions {
            direction_rows(layout, state, o, |r| rows.push(r));
            weigh(&mut rows);
        }
        for o in &problem.headings {
            rows.push(heading_row(layout, state, o));
            weigh(&mut rows);
        }
        let mut j = ObservationJacobian::default();
        for (o, kept) in &self.observations {
            let x = state.kept_points[*kept as usize];
            if !linearise_observation(layout, state, loss, &x.into(), o, &mut j) {
                return f64::INFINITY;
            }
            let view = &layout.views[o.view as usize];
            for k in 0..2 {
                let mut r = Row::new(j.residual[k]);
                for segment in 0..3 {
                    r.add(view.block[segment], &j.rows[k][view.start[segment] as usize..view.start[segment + 1] as usize]);
                }
                r.add(layout.kept_block[*kept as usize], &j.point[k]);
                row(&r);
            }
            cost += j.cost;
        }
        cost
    }
}

/// Number of scalar residuals of instruments, control points and priors on kept blocks.
pub(super) fn other_residuals(problem: &Problem, layout: &Layout) -> usize {
    let count = |owner: &Owner| match *owner {
        Owner::Frame(i) => 6 * usize::from(problem.frames[i as usize].prior.is_some()),
        Owner::Sensor(i) => 6 * usize::from(problem.sensors[i as usize].prior.is_some()),
        Owner::Camera(i) => layout.camera_free[i as usize].indices().filter(|&k| problem.cameras[i as usize].priors[k].is_some()).count(),
        Owner::Point(_) => 0,
    };
    let axes = |sigma: &Vector3<f64>| sigma.iter().filter(|s| s.is_finite()).count();
    let instruments =
        problem.positions.iter().map(|o| axes(&o.sigma)).sum::<usize>() + 2 * problem.directions.len() + problem.headings.len();
    let control = problem.control_points.iter().map(|o| axes(&o.sigma)).sum::<usize>();
    layout.owners.iter().map(count).sum::<usize>() + instruments + control
}

/// Baselines and scale bars at `state`.
pub(super) fn length_residuals(problem: &Problem, layout: &Layout, state: &State) -> (Vec<LengthResidual>, Vec<LengthResidual>) {
    let residual =
        |found: f64, given: f64, sigma: f64| LengthResidual { given, found, sigma, normalised_residual: (found - given) / sigma };
    let baselines = problem.baselines.iter().map(|b| {
        let found = (centre_in_world(state, b.a) - centre_in_world(state, b.b)).norm();
        residual(found, b.length, b.sigma)
    });
    let bars = problem.scale_bars.iter().map(|b| {
        let [p, q] = [b.a, b.b].map(|p| state.kept_points[layout.kept_points.partition_point(|&k| k < p)]);
        residual((p - q).norm(), b.length, b.sigma)
    });
    (baselines.collect(), bars.collect())
}

fn centre_in_world(state: &State, (frame, sensor): (u32, u32)) -> Vector3<f64> {
    (state.sensors[sensor as usize] * state.frames[frame as usize]).centre()
}

/// r = (|c_a - c_b| - length) / sigma. Its gradient is zero where the centres coincide, where the distance has none.
fn baseline_row(layout: &Layout, state: &State, b: &Baseline) -> Row {
    let difference = centre_in_world(state, b.a) - centre_in_world(state, b.b);
    let distance = difference.norm();
    let n = if distance > 0.0 { difference / (distance * b.sigma) } else { Vector3::zeros() };
    displacement_row(layout, state, b, (distance - b.length) / b.sigma, &n)
}

/// A residual whose gradient is that of n . (c_a - c_b) for a vector n of the world.
///
/// With c_rig = -R_s^T t_s and c = R^T (c_rig - t), a step (w, d) of the frame moves c by R^T (u x w - d), u = R c, and one
/// of the sensor moves it by R^T R_s^T (w x t_s - d).
fn displacement_row(layout: &Layout, state: &State, b: &Baseline, residual: f64, n: &Vector3<f64>) -> Row {
    let mut row = Row::new(residual);
    for (sign, (frame, sensor)) in [(1.0, b.a), (-1.0, b.b)] {
        let (f, s) = (&state.frames[frame as usize], &state.sensors[sensor as usize]);
        let n_in_rig = f.rotation * (sign * n);
        // In one frame, the frame moves both ends alike.
        if b.a.0 != b.b.0 {
            let u = s.centre() - f.translation;
            row.add(layout.frame_block[frame as usize], &pose_gradient(&-u.cross(&n_in_rig), &-n_in_rig));
        }
        let n_in_cam = s.rotation * n_in_rig;
        row.add(layout.sensor_block[sensor as usize], &pose_gradient(&s.translation.cross(&n_in_cam), &-n_in_cam));
    }
    row
}

/// What a baseline's residual changes by on average, to second order, when its ends move with their covariance: the variance of c_a - c_b
/// across the line between them over 2 |c_a - c_b| sigma. `variance` gives that of a linear function, from its blocks and gradients.
pub(super) fn mean_bend(
    layout: &Layout,
    state: &State,
    b: &Baseline,
    variance: impl Fn(&[u32], &[[f64; MAX_CAMERA_PARAMS]]) -> f64,
) -> f64 {
    let difference = centre_in_world(state, b.a) - centre_in_world(state, b.b);
    let distance = difference.norm();
    let Some(along) = difference.try_normalize(0.0) else { return f64::INFINITY };
    let of = |n: Vector3<f64>| {
        let row = displacement_row(layout, state, b, 0.0, &n);
        variance(&row.blocks[..row.count], &row.gradients[..row.count])
    };
    across(&along).into_iter().map(of).sum::<f64>() / (2.0 * distance * b.sigma)
}

fn scale_bar_row(layout: &Layout, state: &State, b: &super::ScaleBar) -> Row {
    let [i, j] = [b.a, b.b].map(|p| layout.kept_points.partition_point(|&k| k < p));
    let difference = state.kept_points[i] - state.kept_points[j];
    let distance = difference.norm();
    let mut row = Row::new((distance - b.length) / b.sigma);
    let n = if distance > 0.0 { difference / (distance * b.sigma) } else { Vector3::zeros() };
    row.add(layout.kept_block[i], n.as_slice());
    row.add(layout.kept_block[j], (-n).as_slice());
    row
}

/// See [`PosePrior`]. A step (w, d) moves the origin -R^T t by R^T (w x t - d).
fn pose_prior_rows(pose: &Rigid3, prior: &PosePrior, block: u32, square: &mut impl FnMut(Row)) {
    let turn = so3_log(&(pose.rotation * prior.pose.rotation.inverse()));
    let jacobian = so3_left_jacobian_inverse(&turn);
    let shift = pose.centre() - prior.pose.centre();
    let rotation = pose.rotation_matrix();
    for k in 0..3 {
        let mut row = Row::new(turn[k] / prior.sigma_rotation_rad);
        row.add(block, &pose_gradient(&(jacobian.row(k).transpose() / prior.sigma_rotation_rad), &Vector3::zeros()));
        square(row);
    }
    for k in 0..3 {
        let mut row = Row::new(shift[k] / prior.sigma_translation);
        let m: Vector3<f64> = rotation.column(k) / prior.sigma_translation;
        row.add(block, &pose_gradient(&pose.translation.cross(&m), &-m));
        square(row);
    }
}

fn pose_gradient(w: &Vector3<f64>, d: &Vector3<f64>) -> [f64; 6] {
    [w.x, w.y, w.z, d.x, d.y, d.z]
}
