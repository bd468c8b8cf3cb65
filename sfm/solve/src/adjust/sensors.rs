//! Residuals of what other instruments measured: positions, directions, headings, control points.
//!
//! With a pose `rig_from_world` = (R, t), a step (w, d) makes it (exp(w) R, t + d). A point l of the rig lies at x = R^T (l - t) in the
//! world and moves by R^T ((l - t) x w - d); a direction g of the world is R g in the rig and moves by w x R g; a direction a of the rig is
//! f = R^T a in the world and moves by R^T (a x w).

use super::layout::Layout;
use super::lengths::Row;
use super::problem::{ControlPoint, DirectionObservation, HeadingObservation, PositionObservation};
use super::state::State;
use nalgebra::Vector3;

/// One row an observed axis.
pub(super) fn position_rows(layout: &Layout, state: &State, o: &PositionObservation, mut add: impl FnMut(Row)) {
    let pose = &state.frames[o.frame as usize];
    let r = pose.rotation_matrix();
    let v = o.in_rig - pose.translation;
    let difference = r.tr_mul(&v) - o.xyz;
    for k in (0..3).filter(|&k| o.sigma[k].is_finite()) {
        let mut row = Row::new(difference[k] / o.sigma[k]);
        let m: Vector3<f64> = r.column(k) / o.sigma[k];
        // m . (v x w - d) = (m x v) . w - m . d.
        row.add(layout.frame_block[o.frame as usize], &join(&m.cross(&v), &-m));
        add(row);
    }
}

/// Two rows, across the direction.
pub(super) fn direction_rows(layout: &Layout, state: &State, o: &DirectionObservation, mut add: impl FnMut(Row)) {
    let seen = state.frames[o.frame as usize].rotation * o.in_world.normalize();
    let given = o.in_rig.normalize();
    for across in across(&given) {
        let b = across / o.sigma_rad;
        let mut row = Row::new(b.dot(&seen));
        row.add(layout.frame_block[o.frame as usize], &join(&seen.cross(&b), &Vector3::zeros()));
        add(row);
    }
}

/// The angle about the z axis of the world by which the axis deviates from the heading.
pub(super) fn heading_row(layout: &Layout, state: &State, o: &HeadingObservation) -> Row {
    let r = state.frames[o.frame as usize].rotation_matrix();
    let f = r.tr_mul(&o.axis_in_rig);
    let (sin, cos) = o.heading_rad.sin_cos();
    let (along, right) = (Vector3::new(sin, cos, 0.0), Vector3::new(cos, -sin, 0.0));
    let (s, c) = (f.dot(&right), f.dot(&along));
    let squared = s * s + c * c;
    // An axis that points straight up or down has no heading.
    if squared <= 0.0 {
        return Row::new(0.0);
    }
    let mut row = Row::new(s.atan2(c) / o.sigma_rad);
    let m = r * ((c * right - s * along) / (squared * o.sigma_rad));
    row.add(layout.frame_block[o.frame as usize], &join(&m.cross(&o.axis_in_rig), &Vector3::zeros()));
    row
}

/// One row an axis.
pub(super) fn control_point_rows(layout: &Layout, state: &State, o: &ControlPoint, mut add: impl FnMut(Row)) {
    let kept = layout.kept_points.partition_point(|&p| p < o.point);
    for k in (0..3).filter(|&k| o.sigma[k].is_finite()) {
        let mut row = Row::new((state.kept_points[kept][k] - o.xyz[k]) / o.sigma[k]);
        row.add(layout.kept_block[kept], Vector3::ith(k, 1.0 / o.sigma[k]).as_slice());
        add(row);
    }
}

/// Two unit vectors at right angles to a unit vector and to each other.
pub(super) fn across(v: &Vector3<f64>) -> [Vector3<f64>; 2] {
    // The axis that it is furthest from.
    let a = v.cross(&Vector3::ith(v.iamin(), 1.0)).normalize();
    [a, v.cross(&a)]
}

fn join(w: &Vector3<f64>, d: &Vector3<f64>) -> [f64; 6] {
    [w.x, w.y, w.z, d.x, d.y, d.z]
}
