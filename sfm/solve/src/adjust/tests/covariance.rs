//! Covariances against dense algebra, and against what noise does.

use super::normal_equations::{everything, layout_order};
use super::oracle::{Unknown, jacobian};
use super::scene::{Options, free_camera, truth};
use crate::adjust::covariance::Normal;
use crate::adjust::layout::Layout;
use crate::adjust::lengths::KeptNormal;
use crate::adjust::pattern::Pattern;
use crate::adjust::state::State;
use crate::adjust::*;
use crate::lie::so3_log;
use crate::testing::Random;
use ::scene::{CameraModel, Rigid3};
use nalgebra::{DMatrix, Matrix3, Matrix6, Vector6};

/// (J^T J)^-1 from the definitions, and its unknowns.
fn dense(problem: &Problem) -> (Vec<Unknown>, DMatrix<f64>, DMatrix<f64>) {
    let mut state = State::new(problem);
    let layout = Layout::new(problem, &mut state);
    let order = layout_order(problem, &layout);
    let j = jacobian(problem, &order);
    let inverse = (j.transpose() * &j).try_inverse().expect("determined");
    (order, j, inverse)
}

fn block<const N: usize>(order: &[Unknown], inverse: &DMatrix<f64>, first: Unknown) -> nalgebra::SMatrix<f64, N, N> {
    let at = order.iter().position(|u| *u == first).expect("free");
    inverse.fixed_view::<N, N>(at, at).into_owned()
}

/// By the inverse of a system with the given pattern.
fn by(problem: &Problem, options: &CovarianceOptions, pattern: impl Fn(&Layout, &KeptNormal) -> Pattern) -> Covariance {
    let mut system = Normal::new(problem, options).expect("valid");
    let pattern = pattern(&system.layout, &system.kept);
    let inverse = system.invert(pattern).expect("determined");
    system.collect(problem, &inverse, options)
}

/// All numbers of a covariance.
fn values(c: &Covariance) -> Vec<f64> {
    let poses = c.frames.iter().chain(&c.sensors).flatten().flat_map(|m| m.iter().copied());
    let cameras = c.cameras.iter().flatten().flat_map(|m| m.iter().copied());
    let points = c.points.iter().flatten().flat_map(|m| m.iter().copied());
    poses.chain(cameras).chain(points).chain(c.redundancy.iter().copied()).chain([c.total_redundancy]).collect()
}

#[test]
fn all_routes_agree() {
    let mut problem = everything(CameraModel::OpenCv, 3);
    // An outlying reading, and one wrong observation.
    problem.positions[0].xyz.x += 3.0;
    problem.observations[10].pixel.x += 30.0;
    let robust = Loss::Cauchy { scale_px: 2.0 };
    let options = CovarianceOptions { loss: robust, sensor_loss: robust, ..CovarianceOptions::default() };
    let whole = values(&by(&problem, &options, |layout, _| Pattern::dense(layout)));
    // Groups of a block, of some, and the sparse system.
    let others = [
        values(&by(&problem, &options, |layout, _| Pattern::packed(layout, 1))),
        values(&by(&problem, &options, |layout, _| Pattern::packed(layout, 20))),
        values(&by(&problem, &options, Pattern::sparse)),
        values(&covariance(&problem, &options).expect("determined")),
    ];
    for other in others {
        assert_eq!(whole.len(), other.len());
        // Each block is as exact as its largest element; the smallest variances are 1e-6 of that of a focal length.
        let far = whole.iter().zip(&other).filter(|(a, b)| (*a - *b).abs() > 1e-9 * (a.abs() + 1e-4)).count();
        assert_eq!(far, 0);
    }
}

#[test]
fn covariances_are_blocks_of_the_inverse() {
    for sensors in [1, 3] {
        let problem = everything(CameraModel::Radial, sensors);
        let (order, j, inverse) = dense(&problem);
        let found = covariance(&problem, &CovarianceOptions::default()).expect("determined");
        // The Jacobian by differences errs by 1e-9; the inverse magnifies it.
        let near = |a: &[f64], b: &[f64]| {
            let size = b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5 * size)
        };
        for f in 1..4 {
            let expected: Matrix6<f64> = block(&order, &inverse, Unknown::Frame(f, 0));
            assert!(near(found.frames[f].expect("free").as_slice(), expected.as_slice()), "frame {f}");
        }
        assert!(found.frames[0].is_none() && found.points[3].is_none());
        for p in (0..14).filter(|p| ![3, 5].contains(p)) {
            let expected: Matrix3<f64> = block(&order, &inverse, Unknown::Point(p, 0));
            assert!(near(found.points[p].expect("free").as_slice(), expected.as_slice()), "point {p}");
        }
        let expected: nalgebra::Matrix5<f64> = block(&order, &inverse, Unknown::Camera(0, 0));
        assert!(near(found.cameras[0].as_ref().expect("free").as_slice(), expected.as_slice()));
        if sensors > 1 {
            let expected: Matrix6<f64> = block(&order, &inverse, Unknown::Sensor(2, 0));
            assert!(near(found.sensors[2].expect("free").as_slice(), expected.as_slice()));
        }
        // The diagonal of I - J Cov J^T, whose sum is the total.
        let hat = &j * &inverse * j.transpose();
        let others = j.nrows() - 2 * problem.observations.len();
        assert_eq!(found.redundancy.len(), others);
        let lengths = problem.baselines.len() + problem.scale_bars.len();
        for (i, r) in found.redundancy[..lengths].iter().enumerate() {
            let row = 2 * problem.observations.len() + i;
            assert!((r - (1.0 - hat[(row, row)])).abs() < 1e-5, "length {i}: {r}");
        }
        assert!((found.total_redundancy - (j.nrows() as f64 - hat.trace())).abs() < 1e-3);
    }
}

#[test]
fn a_world_that_floats_has_none() {
    let floating = truth(&Options::default());
    assert_eq!(covariance(&floating, &CovarianceOptions::default()), Err(CovarianceError::Singular));
    let mut no_scale = floating;
    no_scale.frames[0].free = false;
    assert_eq!(covariance(&no_scale, &CovarianceOptions::default()), Err(CovarianceError::Singular));
    no_scale.baselines = vec![Baseline { a: (0, 0), b: (5, 0), length: 1.0, sigma: 0.01 }];
    assert!(covariance(&no_scale, &CovarianceOptions::default()).is_ok());
}

/// The step (w, d) from one pose to another.
fn error(found: &Rigid3, truth: &Rigid3) -> Vector6<f64> {
    let w = so3_log(&(truth.rotation * found.rotation.inverse()));
    let d = truth.translation - found.translation;
    Vector6::new(w.x, w.y, w.z, d.x, d.y, d.z)
}

/// Normalised squared errors of all frames of small surveys, and of the position of one point of each.
fn small_surveys(sensors: usize, rigid: bool, seeds: u64) -> [NormalisedError; 2] {
    let (mut of_frames, mut of_point) = (Vec::new(), 0.0);
    for seed in 0..seeds {
        let options = Options { frames: 8, sensors, points: 60, track: 5, noise_px: 0.7, seed: 100 + seed, ..Options::default() };
        let mut truth = truth(&options);
        truth.frames[0].free = false;
        truth.observations.iter_mut().for_each(|o| o.sigma_px = 0.7);
        let mut random = Random::new(seed);
        if rigid {
            truth.cameras.iter_mut().for_each(free_camera);
            let length = (truth.sensors[0].pose.centre() - truth.sensors[1].pose.centre()).norm();
            truth.baselines.push(Baseline { a: (0, 0), b: (0, 1), length: length + 0.002 * random.normal(), sigma: 0.002 });
        } else {
            for f in 1..8 {
                let length = (truth.frames[f - 1].pose.centre() - truth.frames[f].pose.centre()).norm();
                let (a, b) = ((f as u32 - 1, 0), (f as u32, 0));
                truth.baselines.push(Baseline { a, b, length: length + 0.002 * random.normal(), sigma: 0.002 });
            }
        }
        let mut problem = truth.clone();
        adjust(&mut problem, &AdjustOptions { function_tolerance: 1e-12, ..AdjustOptions::default() }).expect("valid");
        let poses: Vec<Rigid3> = truth.frames.iter().map(|f| f.pose).collect();
        let found = consistency(&problem, &poses, &CovarianceOptions::default()).expect("determined");
        assert_eq!(joint_consistency(&problem, &poses, &CovarianceOptions::default()).as_ref(), Ok(&found.joint));
        of_frames.push(found.joint);
        let e = problem.points[30].xyz - truth.points[30].xyz;
        of_point += e.dot(&(found.covariance.points[30].expect("free").try_inverse().expect("positive") * e));
    }
    let degrees = 3.0 * seeds as f64;
    [NormalisedError::sum(&of_frames), NormalisedError::new(of_point, degrees, 2.0 * degrees)]
}

#[test]
fn errors_are_as_large_as_the_covariance_says() {
    for (sensors, rigid) in [(1, false), (2, true)] {
        let [of_frames, of_point] = small_surveys(sensors, rigid, 100);
        assert!(of_frames.is_in_band(), "rigid {rigid}: {of_frames:?}");
        assert!(of_point.is_in_band(), "rigid {rigid}: {of_point:?}");
        // The band of 4,200 degrees of freedom is 4 % wide: variances that are a tenth off would show.
        for factor in [0.9, 1.1] {
            assert!(!NormalisedError { value: factor * of_frames.value, ..of_frames }.is_in_band(), "rigid {rigid}: {of_frames:?}");
        }
    }
}

/// A survey of 30 frames with 2 % of wrong observations: adjusted robustly, and by least squares without what that shows to be wrong.
fn adjusted_survey(sensors: usize, seed: u64) -> (Problem, Vec<Rigid3>) {
    let noise_px = 0.7;
    let options = Options { frames: 30, sensors, points: 300, track: 5, arc: 0.03, noise_px, seed, ..Options::default() };
    let mut problem = truth(&options);
    let true_poses: Vec<Rigid3> = problem.frames.iter().map(|f| f.pose).collect();
    let mut random = Random::new(seed);
    for (i, o) in problem.observations.iter_mut().enumerate() {
        o.sigma_px = noise_px;
        if i % 50 == 7 {
            o.pixel.x += random.uniform(15.0, 60.0);
            o.pixel.y -= random.uniform(15.0, 60.0);
        }
    }
    let centre = |f: u32, s: u32| (problem.sensors[s as usize].pose * problem.frames[f as usize].pose).centre();
    let ends = (1..30).map(|f| if sensors == 1 { ((f - 1, 0), (f, 0)) } else { ((f, 0), (f, 1)) });
    let length = |(a, b): ((u32, u32), (u32, u32))| (centre(a.0, a.1) - centre(b.0, b.1)).norm();
    problem.baselines = ends.map(|(a, b)| Baseline { a, b, length: length((a, b)) + 0.002 * random.normal(), sigma: 0.002 }).collect();
    problem.cameras.iter_mut().for_each(free_camera);
    let run = |problem: &mut Problem, loss| {
        let summary = adjust(problem, &AdjustOptions { loss, function_tolerance: 1e-10, ..AdjustOptions::default() }).expect("valid");
        assert!(summary.termination.is_converged(), "{summary:?}");
    };
    run(&mut problem, Loss::Cauchy { scale_px: 2.0 });
    let Problem { cameras, sensors, frames, points, observations, .. } = &mut problem;
    observations.retain(|o| {
        let pose = sensors[o.sensor as usize].pose * frames[o.frame as usize].pose;
        let pixel = cameras[o.camera as usize].camera.project(&pose.apply(&points[o.point as usize].xyz)).expect("in front");
        (pixel - o.pixel).norm() < 5.0 * o.sigma_px
    });
    run(&mut problem, Loss::Trivial);
    problem.frames[15].free = false;
    (problem, true_poses)
}

#[test]
fn what_consistency_and_covariance_say_is_the_same() {
    let (problem, truth) = adjusted_survey(1, 5);
    let options = CovarianceOptions::default();
    let found = consistency(&problem, &truth, &options).expect("determined");
    // That of the sequence is sparse.
    let (a, b) = (values(&found.covariance), values(&covariance(&problem, &options).expect("determined")));
    let far = a.iter().zip(&b).filter(|(a, b)| (*a - *b).abs() > 1e-7 * a.abs() + 1e-12).count();
    assert_eq!((a.len(), far), (b.len(), 0));
    // e^T Cov^-1 e of the frames alone, from the definitions.
    let (order, _, inverse) = dense(&problem);
    let frames: Vec<usize> = (0..30).filter(|f| *f != 15).collect();
    let at = |f: usize| order.iter().position(|u| *u == Unknown::Frame(f, 0)).expect("free");
    let moved = truth[15].inverse() * problem.frames[15].pose;
    let e = nalgebra::DVector::from_iterator(
        6 * frames.len(),
        frames.iter().flat_map(|&f| error(&problem.frames[f].pose, &(truth[f] * moved)).iter().copied().collect::<Vec<_>>()),
    );
    let of_frames =
        DMatrix::from_fn(6 * frames.len(), 6 * frames.len(), |i, j| inverse[(at(frames[i / 6]) + i % 6, at(frames[j / 6]) + j % 6)]);
    let expected = e.dot(&(of_frames.try_inverse().expect("positive") * &e));
    assert!((found.joint.value / expected - 1.0).abs() < 1e-3, "{} {expected}", found.joint.value);
    let too_little = CovarianceOptions { max_bytes: 1000, ..options };
    assert!(matches!(covariance(&problem, &too_little), Err(CovarianceError::TooLarge { allowed: 1000, .. })));
}

/// Frames on a line whose places are known to s along each axis: each of their distances bends by s^2 / (length sigma) on average.
#[test]
fn baselines_bend_across_what_is_undetermined() {
    let place = |f: u32| Rigid3::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::new(-0.4 * f64::from(f), 0.1, 0.0));
    let prior = |pose| PosePrior { pose, sigma_rotation_rad: 1e-3, sigma_translation: 0.02 };
    let mut problem = Problem { sensors: vec![PoseBlock::fixed(Rigid3::identity())], ..Problem::default() };
    problem.frames = (0..10).map(|f| PoseBlock { free: f > 0, prior: Some(prior(place(f))), ..PoseBlock::fixed(place(f)) }).collect();
    problem.baselines = (1..10).map(|f| Baseline { a: (0, 0), b: (f, 0), length: 0.4 * f64::from(f), sigma: 0.001 }).collect();
    let found = covariance(&problem, &CovarianceOptions::default()).expect("determined");
    for (f, bend) in (1..10).zip(&found.baseline_bends) {
        let expected = 0.02_f64.powi(2) / (0.4 * f64::from(f) * 0.001);
        // Turns about the origin move the places by less than a hundredth of 0.02 m, 1e-3 rad times the 0.1 m beside the line.
        assert!((bend / expected - 1.0).abs() < 1e-2, "{bend} {expected}");
    }
    // Along the line the distances themselves tell the places, of which the bend takes no note.
    assert!(found.frames[1].expect("free")[(3, 3)] < 1.01e-6);
}

#[test]
fn threads_change_no_bit() {
    let mut problem = truth(&Options { frames: 60, points: 900, track: 4, arc: 0.05, noise_px: 0.5, ..Options::default() });
    problem.frames[30].free = false;
    problem.baselines = vec![Baseline { a: (0, 0), b: (59, 0), length: 1.0, sigma: 0.01 }];
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| covariance(&problem, &CovarianceOptions::default()).expect("determined"))
    };
    assert!(on(1) == on(2));
}
