//! Residuals, Jacobians and normal equations of the image observations.
//!
//! With X in the world, y = R_rw X, x_in_rig = y + t_rw, z = R_cr x_in_rig, x_in_cam = z + t_cr and P the projection, let
//! J = dP / d x_in_cam (2x3) and A = J R_cr. A rotation step w from the left moves a rotated vector v by w x v, and
//! a . (w x v) = (v x a) . w for a row a. So the Jacobian is, row by row,
//!
//! - sensor: (z x j, j),
//! - frame: (y x a, a),
//! - point: E = A R_rw,
//! - camera: dP / d parameters.
//!
//! Residual and Jacobian are divided by sigma. A loss enters by reweighting (iteratively reweighted least squares): both
//! are also multiplied by the square root of rho'. The gradient is then exact, and the normal matrix is that of a
//! quadratic that lies above the concave loss and touches it, so that a full step lowers the cost. The second-order
//! term of Triggs et al., *Bundle adjustment: a modern synthesis*, 1999, would make the matrix indefinite for outliers
//! under these losses; Ceres drops it there for that reason.

use super::kernels;
use super::layout::{Layout, NONE, Obs};
use super::pieces::{Sliced, for_each_piece};
use super::state::{State, ViewPose};
use crate::robust::Loss;
use nalgebra::Vector3;
use scene::camera::MAX_CAMERA_PARAMS;

/// Longest row: frame, sensor and camera.
pub(super) const MAX_ROW: usize = 12 + MAX_CAMERA_PARAMS;

/// Normal equations of a point: E^T E (lower triangle by rows) and E^T r.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PointNormal {
    pub h: [f64; 6],
    pub g: [f64; 3],
    /// Cost of its observations.
    pub cost: f64,
}

/// Normal equations of the image observations at a state.
#[derive(Debug, Default)]
pub(super) struct Linearised {
    pub points: Vec<PointNormal>,
    /// Of each incidence: W, three columns of the block's dimension.
    pub w: Vec<f64>,
    /// Of each view with d parameters: F^T F (d x d) and F^T r.
    pub views: Vec<f64>,
    /// Where each view begins in `views`.
    pub view_start: Vec<usize>,
    /// `views` as far as each piece of work contributes, one after the other, and where each begins.
    piece_views: Vec<f64>,
    piece_views_start: Vec<usize>,
    piece_cost: Vec<f64>,
}

impl Linearised {
    pub fn new(layout: &Layout) -> Self {
        let pieces = layout.piece_count();
        let view_start = layout.view_start();
        let len = view_start[layout.views.len()];
        Self {
            points: vec![PointNormal::default(); layout.slot_count()],
            w: vec![0.0; layout.w_len()],
            views: vec![0.0; len],
            view_start,
            piece_views: vec![0.0; len * pieces],
            piece_views_start: (0..=pieces).map(|i| i * len).collect(),
            piece_cost: vec![0.0; pieces],
        }
    }

    /// Gives back the memory of the sums by piece: there will be no other update.
    pub fn forget_pieces(&mut self) {
        (self.piece_views, self.piece_views_start) = (Vec::new(), Vec::new());
    }

    /// Computes the normal equations at `state`; returns the cost.
    pub fn update(&mut self, layout: &Layout, state: &State, loss: &Loss, parallel: bool) -> f64 {
        let pieces = &layout.pieces;
        let view_start = &self.view_start;
        let data = (
            Sliced::new(&mut self.piece_views, &self.piece_views_start),
            Sliced::new(&mut self.points, &pieces.slots),
            Sliced::new(&mut self.w, &pieces.w),
            Sliced::new(&mut self.piece_cost, &pieces.ones),
        );
        for_each_piece(0..layout.piece_count(), data, parallel, &|piece, (views, points, w, cost)| {
            let mut normal = PieceNormal { view_start, views: views.into_inner(), points: points.into_inner(), w: w.into_inner() };
            cost.into_inner()[0] = linearise_piece(layout, state, loss, piece, &mut normal);
        });
        // The pieces are added in order.
        self.views.fill(0.0);
        if !self.views.is_empty() {
            for piece in self.piece_views.chunks_exact(self.views.len()) {
                for (sum, x) in self.views.iter_mut().zip(piece) {
                    *sum += x;
                }
            }
        }
        self.piece_cost.iter().sum()
    }
}

/// rho(s) and the square root of its derivative.
#[inline]
pub(super) fn robust_weight(loss: &Loss, s: f64) -> (f64, f64) {
    match loss {
        Loss::Trivial => (s, 1.0),
        _ => {
            let (rho, slope) = loss.evaluate(s);
            (rho, slope.sqrt())
        }
    }
}

/// An observation's whitened and reweighted residual and Jacobian.
pub(super) struct ObservationJacobian {
    pub residual: [f64; 2],
    /// rho(s) / 2.
    pub cost: f64,
    /// d / d point in the world.
    pub point: [[f64; 3]; 2],
    /// Frame, sensor and camera, as far as they are free, one after the other.
    pub rows: [[f64; MAX_ROW]; 2],
}

impl Default for ObservationJacobian {
    fn default() -> Self {
        Self { residual: [0.0; 2], cost: 0.0, point: [[0.0; 3]; 2], rows: [[0.0; MAX_ROW]; 2] }
    }
}

/// Linearises an observation; false when the point does not project.
pub(super) fn linearise_observation(
    layout: &Layout,
    state: &State,
    loss: &Loss,
    x: &[f64; 3],
    o: &Obs,
    out: &mut ObservationJacobian,
) -> bool {
    let view = &layout.views[o.view as usize];
    let pose: &ViewPose = &state.views[o.view as usize];
    let y = pose.r_rig_from_world * Vector3::from(*x);
    let x_in_rig = y + pose.t_rig_from_world;
    let (z, x_in_cam) = if view.plain_sensor {
        (x_in_rig, x_in_rig)
    } else {
        let z = pose.r_cam_from_rig * x_in_rig;
        (z, z + pose.t_cam_from_rig)
    };
    let Some(projection) = state.cameras[view.camera as usize].project_with_jacobians(&x_in_cam) else {
        return false;
    };
    let mut r = [(projection.pixel.x - o.pixel[0]) * o.inverse_sigma, (projection.pixel.y - o.pixel[1]) * o.inverse_sigma];
    let (rho, root) = robust_weight(loss, r[0] * r[0] + r[1] * r[1]);
    out.cost = 0.5 * rho;
    r = [r[0] * root, r[1] * root];
    out.residual = r;
    let scale = root * o.inverse_sigma;
    for k in 0..2 {
        let j = Vector3::new(projection.d_point[(k, 0)], projection.d_point[(k, 1)], projection.d_point[(k, 2)]) * scale;
        let a = if view.plain_sensor { j } else { pose.r_cam_from_rig.tr_mul(&j) };
        out.point[k] = pose.r_rig_from_world.tr_mul(&a).into();
        let row = &mut out.rows[k];
        if view.block[0] != NONE {
            let turn = y.cross(&a);
            row[..6].copy_from_slice(&[turn.x, turn.y, turn.z, a.x, a.y, a.z]);
        }
        if view.block[1] != NONE {
            let turn = z.cross(&j);
            row[view.start[1] as usize..][..6].copy_from_slice(&[turn.x, turn.y, turn.z, j.x, j.y, j.z]);
        }
        if view.block[2] != NONE {
            let row = &mut row[view.start[2] as usize..];
            for (to, param) in row.iter_mut().zip(layout.camera_free[view.camera as usize].indices()) {
                *to = projection.d_params[(k, param)] * scale;
            }
        }
    }
    true
}

/// What a piece of work writes.
struct PieceNormal<'a> {
    view_start: &'a [usize],
    views: &'a mut [f64],
    points: &'a mut [PointNormal],
    w: &'a mut [f64],
}

fn linearise_piece(layout: &Layout, state: &State, loss: &Loss, piece: usize, normal: &mut PieceNormal<'_>) -> f64 {
    let mut cost = 0.0;
    let mut j = ObservationJacobian::default();
    let (first, end) = (layout.pieces.slots[piece], layout.pieces.slots[piece + 1]);
    let first_w = layout.slots[first].first_w;
    normal.w.fill(0.0);
    normal.views.fill(0.0);
    for s in first..end {
        let (slot, next) = (&layout.slots[s], &layout.slots[s + 1]);
        let mut point = PointNormal::default();
        for observation in &layout.obs[slot.first_obs as usize..next.first_obs as usize] {
            if !linearise_observation(layout, state, loss, &state.points[s], observation, &mut j) {
                debug_assert!(false, "a state that is linearised was evaluated before");
                j = ObservationJacobian::default();
            }
            point.cost += j.cost;
            let view = &layout.views[observation.view as usize];
            let v = observation.view as usize;
            kernels::add_view(view.row_len(), &j, &mut normal.views[normal.view_start[v]..normal.view_start[v + 1]]);
            if !slot.free {
                continue;
            }
            point.add(&j);
            for segment in 0..3 {
                if observation.incidence[segment] != NONE {
                    let incidence = &layout.incidences[(slot.first_incidence + observation.incidence[segment]) as usize];
                    let (start, dim) = (view.start[segment] as usize, view.dim(segment));
                    kernels::add_product(dim, &j, start, &mut normal.w[incidence.w - first_w..][..3 * dim]);
                }
            }
        }
        cost += point.cost;
        normal.points[s - first] = point;
    }
    cost
}

impl PointNormal {
    pub fn add(&mut self, j: &ObservationJacobian) {
        let [e0, e1] = j.point;
        let mut i = 0;
        for a in 0..3 {
            for b in 0..=a {
                self.h[i] += e0[a] * e0[b] + e1[a] * e1[b];
                i += 1;
            }
            self.g[a] += e0[a] * j.residual[0] + e1[a] * j.residual[1];
        }
    }
}
