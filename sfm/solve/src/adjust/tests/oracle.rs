//! The adjuster's algebra done again from the definitions: residuals from the documentation of the problem, a Jacobian by
//! differences, dense normal equations.

use crate::adjust::*;
use crate::lie::{so3_exp, so3_log};
use ::scene::camera::ParamKind;
use nalgebra::{DMatrix, DVector, Vector3};

/// One free scalar: block and coordinate in its tangent space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unknown {
    Frame(usize, usize),
    Sensor(usize, usize),
    Camera(usize, usize),
    Point(usize, usize),
}

/// Every free scalar of the problem: frames, sensors, cameras, points.
pub fn unknowns(problem: &Problem) -> Vec<Unknown> {
    let mut all = Vec::new();
    let six = |blocks: &[PoseBlock], make: fn(usize, usize) -> Unknown| -> Vec<Unknown> {
        (0..blocks.len()).filter(|&i| blocks[i].free).flat_map(|i| (0..6).map(move |k| make(i, k))).collect()
    };
    all.extend(six(&problem.frames, Unknown::Frame));
    all.extend(six(&problem.sensors, Unknown::Sensor));
    for (i, block) in problem.cameras.iter().enumerate() {
        all.extend((0..block.camera.params().len()).filter(|&k| block.free[k]).map(|k| Unknown::Camera(i, k)));
    }
    all.extend((0..problem.points.len()).filter(|&i| problem.points[i].free).flat_map(|i| (0..3).map(move |k| Unknown::Point(i, k))));
    all
}

/// The problem after a step along one unknown.
pub fn moved(problem: &Problem, unknown: Unknown, step: f64) -> Problem {
    let mut problem = problem.clone();
    let turn_or_shift = |block: &mut PoseBlock, k: usize| {
        if k < 3 {
            block.pose.rotation = so3_exp(&Vector3::ith(k, step)) * block.pose.rotation;
        } else {
            block.pose.translation[k - 3] += step;
        }
    };
    match unknown {
        Unknown::Frame(i, k) => turn_or_shift(&mut problem.frames[i], k),
        Unknown::Sensor(i, k) => turn_or_shift(&mut problem.sensors[i], k),
        Unknown::Camera(i, k) => problem.cameras[i].camera.params_mut()[k] += step,
        Unknown::Point(i, k) => problem.points[i].xyz[k] += step,
    }
    problem
}

/// All residuals divided by their sigmas.
pub fn residuals(problem: &Problem) -> Vec<f64> {
    let mut all = Vec::new();
    let cam_from_world = |frame: u32, sensor: u32| problem.sensors[sensor as usize].pose * problem.frames[frame as usize].pose;
    for o in &problem.observations {
        let x_in_cam = cam_from_world(o.frame, o.sensor).apply(&problem.points[o.point as usize].xyz);
        let pixel = problem.cameras[o.camera as usize].camera.project(&x_in_cam).expect("in front");
        all.extend(((pixel - o.pixel) / o.sigma_px).iter());
    }
    for b in &problem.baselines {
        let [p, q] = [b.a, b.b].map(|(f, s)| cam_from_world(f, s).inverse().translation);
        all.push(((p - q).norm() - b.length) / b.sigma);
    }
    for b in &problem.scale_bars {
        let [p, q] = [b.a, b.b].map(|p| problem.points[p as usize].xyz);
        all.push(((p - q).norm() - b.length) / b.sigma);
    }
    for o in &problem.control_points {
        let difference = problem.points[o.point as usize].xyz - o.xyz;
        all.extend((0..3).filter(|&k| o.sigma[k].is_finite()).map(|k| difference[k] / o.sigma[k]));
    }
    for block in problem.frames.iter().chain(&problem.sensors).filter(|b| b.free) {
        if let Some(prior) = &block.prior {
            all.extend((so3_log(&(block.pose.rotation * prior.pose.rotation.inverse())) / prior.sigma_rotation_rad).iter());
            all.extend(((block.pose.centre() - prior.pose.centre()) / prior.sigma_translation).iter());
        }
    }
    for block in &problem.cameras {
        for (k, p) in block.camera.params().iter().enumerate().filter(|(k, _)| block.free[*k]) {
            if let Some(prior) = &block.priors[k] {
                all.push((p - prior.value) / prior.sigma);
            }
        }
    }
    for o in &problem.positions {
        let place = problem.frames[o.frame as usize].pose.inverse().apply(&o.in_rig);
        all.extend((0..3).filter(|&k| o.sigma[k].is_finite()).map(|k| (place - o.xyz)[k] / o.sigma[k]));
    }
    for o in &problem.directions {
        // Across the measured direction, in the basis that the adjuster takes: least axis first.
        let (seen, given) = (problem.frames[o.frame as usize].pose.rotation * o.in_world.normalize(), o.in_rig.normalize());
        let first = given.cross(&Vector3::ith(given.iamin(), 1.0)).normalize();
        all.extend([first, given.cross(&first)].map(|b| b.dot(&seen) / o.sigma_rad));
    }
    for o in &problem.headings {
        let axis = problem.frames[o.frame as usize].pose.rotation.inverse() * o.axis_in_rig;
        let turn = axis.x.atan2(axis.y) - o.heading_rad;
        all.push(turn.sin().atan2(turn.cos()) / o.sigma_rad);
    }
    all
}

/// Derivative of `f` along one coordinate by differences of the fourth order, which errs by h^4 and by rounding / h.
pub fn difference(f: impl Fn(f64) -> Vec<f64>, h: f64) -> Vec<f64> {
    let [a, b, c, d] = [f(-2.0 * h), f(-h), f(h), f(2.0 * h)];
    (0..a.len()).map(|i| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * h)).collect()
}

/// The Jacobian of [`residuals`] with respect to `unknowns`.
pub fn jacobian(problem: &Problem, unknowns: &[Unknown]) -> DMatrix<f64> {
    let rows = residuals(problem).len();
    let mut jacobian = DMatrix::zeros(rows, unknowns.len());
    for (column, &unknown) in unknowns.iter().enumerate() {
        let size = match unknown {
            // Pixels are linear in the coefficients of distortion, some of which change them very little.
            Unknown::Camera(i, k) if problem.cameras[i].camera.model().param_kinds()[k] == ParamKind::Distortion => 10.0,
            Unknown::Camera(i, k) => problem.cameras[i].camera.params()[k],
            _ => 1.0,
        };
        let derivative = difference(|step| residuals(&moved(problem, unknown, step)), 1e-4 * size);
        jacobian.set_column(column, &DVector::from_vec(derivative));
    }
    jacobian
}

#[test]
fn the_differencer_knows_derivatives() {
    // x^4 is exact up to rounding, the sine up to h^4 / 30.
    let x = 0.7f64;
    let d = difference(|h| vec![(x + h).powi(4), (x + h).sin(), 3.0], 1e-3);
    assert!((d[0] - 4.0 * x.powi(3)).abs() < 1e-11, "{}", d[0]);
    assert!((d[1] - x.cos()).abs() < 1e-12, "{}", d[1]);
    assert_eq!(d[2], 0.0);
}
