//! Jacobians, elimination and back-substitution against dense algebra from the definitions.

use super::oracle::{Unknown, jacobian, residuals, unknowns};
use super::scene::{Options, free_camera, perturb, truth};
use crate::adjust::conjugate::System;
use crate::adjust::layout::{Layout, Owner};
use crate::adjust::lengths::KeptNormal;
use crate::adjust::linearise::Linearised;
use crate::adjust::pattern::Pattern;
use crate::adjust::schur::{Reduced, damping};
use crate::adjust::solve_reduced::Solver;
use crate::adjust::state::State;
use crate::adjust::step::Stepper;
use crate::adjust::*;
use ::scene::CameraModel;
use nalgebra::{DMatrix, DVector, Vector3};

const RADIUS: f64 = 50.0;

/// What the adjuster makes of a problem in one iteration.
struct Iteration {
    cost: f64,
    gradient: Vec<f64>,
    step: Vec<f64>,
    model_decrease: f64,
    after: State,
}

/// Unknowns in the adjuster's order.
pub(super) fn layout_order(problem: &Problem, layout: &Layout) -> Vec<Unknown> {
    let kept = layout.owners.iter().flat_map(|&owner| match owner {
        Owner::Frame(i) => (0..6).map(|k| Unknown::Frame(i as usize, k)).collect::<Vec<_>>(),
        Owner::Sensor(i) => (0..6).map(|k| Unknown::Sensor(i as usize, k)).collect(),
        Owner::Camera(i) => layout.camera_free[i as usize].indices().map(|k| Unknown::Camera(i as usize, k)).collect(),
        Owner::Point(i) => (0..3).map(|k| Unknown::Point(layout.kept_points[i as usize] as usize, k)).collect(),
    });
    let slots = layout.slots[..layout.slot_count()].iter().filter(|s| s.free);
    let all: Vec<_> = kept.chain(slots.flat_map(|s| (0..3).map(|k| Unknown::Point(s.point as usize, k)))).collect();
    assert_eq!(all.len(), unknowns(problem).len());
    all
}

fn iterate(problem: &Problem, make_pattern: impl Fn(&Layout, &KeptNormal) -> Pattern) -> (Vec<Unknown>, Iteration) {
    iterate_on(problem, make_pattern, false)
}

fn iterate_on(problem: &Problem, make_pattern: impl Fn(&Layout, &KeptNormal) -> Pattern, parallel: bool) -> (Vec<Unknown>, Iteration) {
    let loss = Loss::Trivial;
    let mut state = State::new(problem);
    let layout = Layout::new(problem, &mut state);
    state.load_points(problem, &layout);
    let mut linear = Linearised::new(&layout);
    let mut kept = KeptNormal::new(problem, &layout, &state, &loss, loss);
    let cost = linear.update(&layout, &state, &loss, parallel) + kept.update(problem, &layout, &state, &loss);
    let mut reduced = Reduced::with_pattern(&layout, make_pattern(&layout, &kept), 2);
    let mut solver = Solver::new(&layout, &reduced.pattern).expect("memory");
    if let Solver::Conjugate(conjugate) = &mut solver {
        conjugate.solve_exactly();
    }
    reduced.build(&layout, &linear, &kept, RADIUS, parallel);
    assert!(solver.solve(&System { layout: &layout, linear: &linear, kept: &kept, parallel }, &mut reduced));
    let mut after = state.clone();
    assert!(after.set_moved(&state, &reduced.rhs, &layout));
    let sums = Stepper::new(&layout).linear().step(&layout, &linear, &reduced, RADIUS, &loss, &state, &mut after, parallel);
    let (mut step, mut gradient) = (reduced.rhs.clone(), reduced.gradient.clone());
    for (s, slot) in layout.slots[..layout.slot_count()].iter().enumerate().filter(|(_, s)| s.free) {
        step.extend((0..3).map(|k| after.points[s][k] - state.points[s][k]));
        gradient.extend(linear.points[s].g);
        assert!(slot.free);
    }
    (layout_order(problem, &layout), Iteration { cost, gradient, step, model_decrease: sums.model_decrease, after })
}

/// Compares an iteration with dense algebra; the residuals are smooth and the Jacobian by differences of the fourth order
/// errs by about 1e-9 of its largest element, which the damped system magnifies little.
fn check(problem: &Problem, make_pattern: impl Fn(&Layout, &KeptNormal) -> Pattern) {
    let (order, found) = iterate(problem, make_pattern);
    let j = jacobian(problem, &order);
    let r = DVector::from_vec(residuals(problem));
    assert!((found.cost - 0.5 * r.norm_squared()).abs() < 1e-12 * found.cost, "cost {} {}", found.cost, 0.5 * r.norm_squared());
    let g = j.transpose() * &r;
    let found_g = DVector::from_vec(found.gradient);
    for i in 0..g.len() {
        let scale = j.column(i).norm() * r.norm();
        assert!((found_g[i] - g[i]).abs() < 1e-8 * scale, "gradient of {:?}: {} {}", order[i], found_g[i], g[i]);
    }
    let h = j.transpose() * &j;
    let d = h.diagonal().map(|h| damping(h, RADIUS));
    let step = (&h + DMatrix::from_diagonal(&d)).cholesky().expect("damped").solve(&-&g);
    let found_step = DVector::from_vec(found.step);
    // In units of what each unknown does to the residuals.
    let scaled = |s: &DVector<f64>| s.component_mul(&h.diagonal().map(f64::sqrt));
    let error = (scaled(&found_step) - scaled(&step)).norm() / scaled(&step).norm();
    assert!(error < 1e-6, "step errs by {error}");
    let decrease = 0.5 * r.norm_squared() - 0.5 * (&r + &j * &step).norm_squared();
    assert!((found.model_decrease - decrease).abs() < 1e-6 * decrease, "{} {decrease}", found.model_decrease);
    assert!(found.after.points.iter().flatten().all(|x| x.is_finite()));
}

/// A rig of three with free sensors, cameras, lengths and priors: every kind of block and residual.
pub(super) fn everything(model: CameraModel, sensors: usize) -> Problem {
    let mut problem = truth(&Options { frames: 4, sensors, points: 14, track: 3, noise_px: 0.5, model, ..Options::default() });
    problem.cameras.iter_mut().for_each(free_camera);
    problem.cameras[0].priors[0] = Some(ParamPrior { value: 890.0, sigma: 5.0 });
    for (i, o) in problem.observations.iter_mut().enumerate() {
        o.sigma_px = 0.5 + 0.1 * (i % 7) as f64;
    }
    let prior = |pose| Some(PosePrior { pose, sigma_rotation_rad: 0.02, sigma_translation: 0.03 });
    problem.frames[1].prior = prior(problem.frames[1].pose);
    problem.frames[0].free = false;
    problem.points[3].free = false;
    problem.points[5].free = false;
    problem.scale_bars = vec![
        ScaleBar { a: 0, b: 7, length: 0.8, sigma: 0.01 },
        ScaleBar { a: 7, b: 5, length: 0.7, sigma: 0.02 },
        ScaleBar { a: 13, b: 1, length: 0.5, sigma: 0.02 },
    ];
    problem.baselines =
        vec![Baseline { a: (1, 0), b: (3, 0), length: 0.95, sigma: 0.01 }, Baseline { a: (0, 0), b: (2, 0), length: 0.8, sigma: 0.02 }];
    if sensors > 1 {
        problem.sensors[1].prior = prior(problem.sensors[1].pose);
        problem.baselines.push(Baseline { a: (2, 0), b: (2, 1), length: 0.31, sigma: 0.005 });
        problem.baselines.push(Baseline { a: (1, 1), b: (3, 1), length: 0.9, sigma: 0.02 });
    }
    let at = |f: usize, l: Vector3<f64>| problem.frames[f].pose.inverse().apply(&l);
    let arm = Vector3::new(0.1, -0.4, 0.2);
    problem.positions = vec![
        PositionObservation { frame: 1, in_rig: arm, xyz: at(1, arm).add_scalar(0.02), sigma: Vector3::new(0.1, 0.2, 0.05) },
        PositionObservation {
            frame: 3,
            in_rig: Vector3::zeros(),
            xyz: at(3, Vector3::zeros()),
            sigma: Vector3::new(f64::INFINITY, f64::INFINITY, 0.02),
        },
        PositionObservation { frame: 0, in_rig: arm, xyz: at(0, arm), sigma: Vector3::repeat(0.1) },
    ];
    let down = Vector3::new(0.1, 0.9, -0.2);
    problem.directions =
        [1, 2].map(|frame| DirectionObservation { frame, in_rig: Vector3::new(0.0, 2.0, 0.1), in_world: down, sigma_rad: 0.03 }).to_vec();
    problem.headings =
        [2, 3].map(|frame| HeadingObservation { frame, axis_in_rig: Vector3::z(), heading_rad: 3.0, sigma_rad: 0.1 }).to_vec();
    problem.control_points = [(7, 0.01), (9, f64::INFINITY), (3, 0.1)]
        .map(|(point, sigma)| ControlPoint {
            point,
            xyz: problem.points[point as usize].xyz.add_scalar(0.03),
            sigma: Vector3::new(sigma, 0.02, 0.05),
        })
        .to_vec();
    perturb(&mut problem, 0.01, 3);
    problem
}

#[test]
fn a_step_solves_the_normal_equations() {
    for model in CameraModel::ALL {
        for sensors in [1, 3] {
            check(&everything(model, sensors), |layout, _| Pattern::dense(layout));
        }
    }
}

#[test]
fn a_sparse_step_solves_the_normal_equations() {
    for sensors in [1, 3] {
        check(&everything(CameraModel::OpenCv, sensors), Pattern::sparse);
    }
    // A chain: frames far apart do not meet.
    let mut chain = truth(&Options { frames: 9, points: 40, track: 3, arc: 0.05, noise_px: 0.5, ..Options::default() });
    perturb(&mut chain, 0.01, 4);
    check(&chain, |layout, kept| {
        let pattern = Pattern::sparse(layout, kept);
        // 9 diagonal blocks, and each frame meets the next two.
        assert_eq!(pattern.len(), (9 + 8 + 7) * 36);
        pattern
    });
}

#[test]
fn conjugate_gradients_solve_the_normal_equations() {
    for sensors in [1, 3] {
        // One frame a cluster, two, and all.
        for unknowns in [6, 12, 1000] {
            check(&everything(CameraModel::OpenCv, sensors), |layout, _| Pattern::clustered(layout, unknowns));
        }
    }
    let mut nothing_shared = truth(&Options { frames: 9, points: 40, track: 3, arc: 0.05, noise_px: 0.5, ..Options::default() });
    perturb(&mut nothing_shared, 0.01, 4);
    check(&nothing_shared, |layout, _| Pattern::clustered(layout, 18));
}

#[test]
fn fixed_blocks_have_no_unknowns() {
    let mut problem = everything(CameraModel::Radial, 3);
    problem.sensors.iter_mut().for_each(|s| s.free = false);
    check(&problem, |layout, _| Pattern::dense(layout));
    problem.frames.iter_mut().for_each(|f| f.free = false);
    check(&problem, |layout, _| Pattern::dense(layout));
    problem.cameras.iter_mut().for_each(|c| c.free = [false; 10]);
    check(&problem, |layout, _| Pattern::dense(layout));
    let mut problem = everything(CameraModel::Radial, 3);
    problem.points.iter_mut().for_each(|p| p.free = false);
    check(&problem, |layout, _| Pattern::dense(layout));
}

#[test]
fn vector_width_and_grouping_change_no_bit() {
    let problem = everything(CameraModel::Brown, 3);
    let mut state = State::new(&problem);
    let layout = Layout::new(&problem, &mut state);
    state.load_points(&problem, &layout);
    let mut linear = Linearised::new(&layout);
    let mut kept = KeptNormal::new(&problem, &layout, &state, &Loss::Trivial, Loss::Trivial);
    linear.update(&layout, &state, &Loss::Trivial, false);
    kept.update(&problem, &layout, &state, &Loss::Trivial);
    for make_pattern in
        [|l: &Layout, _: &KeptNormal| Pattern::dense(l), Pattern::sparse, |l: &Layout, _: &KeptNormal| Pattern::clustered(l, 6)]
    {
        let build = |threads: usize, portable: bool| {
            let mut reduced = Reduced::with_pattern(&layout, make_pattern(&layout, &kept), threads);
            if portable {
                reduced.use_portable();
            }
            reduced.build(&layout, &linear, &kept, RADIUS, threads > 1);
            reduced.values.iter().chain(&reduced.rhs).map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        let reference = build(1, true);
        assert!(reference == build(1, false) && reference == build(2, true) && reference == build(5, false));
    }
}

#[test]
fn conjugate_gradients_give_the_same_bits_on_any_number_of_threads() {
    // Points of several pieces of work.
    let mut problem = truth(&Options { frames: 12, sensors: 2, points: 700, track: 4, noise_px: 0.5, ..Options::default() });
    problem.cameras.iter_mut().for_each(free_camera);
    perturb(&mut problem, 0.01, 3);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let (_, iteration) = pool.install(|| iterate_on(&problem, |layout, _| Pattern::clustered(layout, 18), threads > 1));
        iteration.step.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    assert!(on(1) == on(2));
}
