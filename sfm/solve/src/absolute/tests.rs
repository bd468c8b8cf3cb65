//! P3P and robust absolute pose against planted truth.

use super::*;
use crate::ransac::RansacOptions;
use crate::testing::Random;
use nalgebra::{Matrix3, Vector2, Vector3};
use scene::{Camera, CameraModel, Rigid3};

const TRIALS: u64 = 1000;

fn camera() -> Camera {
    Camera::new(CameraModel::OpenCv, 1920, 1200, &[1100.0, 1105.0, 955.0, 610.0, -0.2, 0.05, 0.001, -0.002]).unwrap()
}

fn world_pose(random: &mut Random) -> Rigid3 {
    Rigid3::new(random.rotation(3.0), random.vector(5.0))
}

struct Problem {
    sensors: Vec<Sensor>,
    correspondences: Vec<Correspondence>,
    rig_from_world: Rigid3,
}

/// `n` points seen by the sensors in turn; the first `outliers` pixels are random.
fn problem(random: &mut Random, rig: &[Rigid3], n: usize, noise_px: f64, outliers: usize, planar: bool) -> Problem {
    let sensors: Vec<Sensor> = rig.iter().map(|&cam_from_rig| Sensor { camera: camera(), cam_from_rig }).collect();
    let rig_from_world = world_pose(random);
    let mut correspondences = Vec::new();
    for i in 0..n {
        let sensor = i % sensors.len();
        let mut pixel = Vector2::new(random.uniform(0.0, 1920.0), random.uniform(0.0, 1200.0));
        let ray = camera().unproject(&pixel).unwrap().push(1.0);
        let depth = if planar { 4.0 / Vector3::new(0.2, -0.3, 1.0).dot(&ray) } else { random.uniform(2.0, 8.0) };
        let world_from_cam = (sensors[sensor].cam_from_rig * rig_from_world).inverse();
        let x_in_world = world_from_cam.apply(&(ray * depth));
        if i < outliers {
            pixel = Vector2::new(random.uniform(0.0, 1920.0), random.uniform(0.0, 1200.0));
        }
        pixel += Vector2::new(random.normal(), random.normal()) * noise_px;
        correspondences.push(Correspondence { sensor, pixel, x_in_world });
    }
    Problem { sensors, correspondences, rig_from_world }
}

fn rig(random: &mut Random) -> Vec<Rigid3> {
    let mut out = vec![Rigid3::identity()];
    out.extend((0..2).map(|_| Rigid3::new(random.rotation(1.5), random.vector(0.5))));
    out
}

fn errors(found: &Rigid3, truth: &Rigid3) -> (f64, f64) {
    (found.rotation.angle_to(&truth.rotation), (found.centre() - truth.centre()).norm())
}

#[test]
fn p3p_finds_the_truth_and_only_valid_poses() {
    for scale in [1.0, 1e3, 1e-3] {
        let mut missed = 0;
        for seed in 0..TRIALS {
            let mut random = Random::new(seed);
            let truth = world_pose(&mut random);
            let truth = Rigid3::new(truth.rotation, truth.translation * scale);
            let rays: [Vector3<f64>; 3] =
                std::array::from_fn(|_| Vector3::new(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7), 1.0).normalize());
            let x = rays.map(|r| truth.inverse().apply(&(r * random.uniform(2.0, 8.0) * scale)));
            let mut found = Vec::new();
            p3p(&rays, &x, &mut found);
            assert!(found.len() <= 4);
            let mut best = f64::INFINITY;
            for (r, t) in &found {
                assert!((r.transpose() * r - Matrix3::identity()).amax() < 1e-6 && r.determinant() > 0.0);
                for (ray, x) in rays.iter().zip(&x) {
                    let direction = (r * x + t).normalize();
                    assert!((direction - ray).norm() < 1e-5, "{} {}", seed, (direction - ray).norm());
                }
                best = best.min((r - truth.rotation_matrix()).norm() + (t - truth.translation).norm() / scale / 10.0);
            }
            missed += usize::from(best > 1e-6);
        }
        assert!(missed <= TRIALS as usize / 200, "{missed} of {TRIALS} missed");
    }
}

#[test]
fn p3p_refuses_degenerate_triangles() {
    let mut out = Vec::new();
    let rays =
        [Vector3::new(0.1, 0.2, 1.0).normalize(), Vector3::new(-0.3, 0.1, 1.0).normalize(), Vector3::new(0.2, -0.2, 1.0).normalize()];
    let line = [Vector3::new(0.0, 0.0, 4.0), Vector3::new(1.0, 1.0, 5.0), Vector3::new(3.0, 3.0, 7.0)];
    let nan = [Vector3::from_element(f64::NAN), line[1], line[2]];
    for x in [line, [line[0]; 3], [line[0], line[0], line[2]], nan] {
        p3p(&rays, &x, &mut out);
    }
    p3p(&[rays[0]; 3], &[line[0], line[1], Vector3::new(1.0, -2.0, 3.0)], &mut out);
    assert!(out.iter().all(|(r, t)| r.iter().chain(t.iter()).all(|v| v.is_finite())));
    assert!(out.is_empty(), "{out:?}");
}

#[test]
fn single_camera_and_rig_survive_sixty_percent_outliers() {
    for (cameras, planar) in [(1, false), (1, true), (3, false)] {
        for seed in 0..15 {
            let mut random = Random::new(seed);
            let sensors = rig(&mut random);
            let p = problem(&mut random, &sensors[..cameras], 300, 0.5, 180, planar);
            let o = RansacOptions { max_error: 3.0, ..RansacOptions::default() };
            let found = estimate_absolute_pose(&p.sensors, &p.correspondences, &o).unwrap();
            assert!(found.inliers.iter().filter(|i| **i >= 180).count() >= 119 && found.inliers.is_sorted());
            let (turn, shift) = errors(&found.model, &p.rig_from_world);
            // 120 points with half a pixel of 1100: 0.05 mrad a point pair at least; depth 2 to 8.
            assert!(turn < 2e-3 && shift < 1e-2, "{cameras} {planar} {seed}: {turn} {shift}");
        }
    }
}

#[test]
fn inliers_are_those_of_the_camera_model() {
    let mut random = Random::new(4);
    let p = problem(&mut random, &[Rigid3::identity()], 400, 2.0, 100, false);
    let o = RansacOptions { max_error: 4.0, ..RansacOptions::default() };
    let found = estimate_absolute_pose(&p.sensors, &p.correspondences, &o).unwrap();
    for (i, c) in p.correspondences.iter().enumerate() {
        let error = camera().project(&found.model.apply(&c.x_in_world)).map_or(f64::INFINITY, |q| (q - c.pixel).norm());
        assert_eq!(error < 4.0, found.inliers.contains(&i), "{i} {error}");
    }
}

#[test]
fn refinement_reaches_the_truth_and_shrugs_off_outliers() {
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let sensors = rig(&mut random);
        let p = problem(&mut random, &sensors, 90, 0.0, 5, false);
        let all: Vec<usize> = (0..90).collect();
        let start = Rigid3::new(random.rotation(0.02) * p.rig_from_world.rotation, p.rig_from_world.translation + random.vector(0.05));
        let clean = refine_absolute_pose(&p.sensors, &p.correspondences, &all[5..], &start);
        let (turn, shift) = errors(&clean, &p.rig_from_world);
        // Angles between quaternions are known to the root of the rounding error.
        assert!(turn < 1e-7 && shift < 1e-9, "{turn} {shift}");
        let robust = refine_absolute_pose(&p.sensors, &p.correspondences, &all, &start);
        assert!(errors(&robust, &p.rig_from_world).1 < 2e-3, "{:?}", errors(&robust, &p.rig_from_world));
        // Bad indices do not count.
        assert_eq!(refine_absolute_pose(&p.sensors, &p.correspondences, &[1000], &start), start);
    }
}

#[test]
fn derivatives_match_differences() {
    use super::refinement::Movable;
    let mut random = Random::new(1);
    let pose = world_pose(&mut random);
    let x = pose.inverse().apply(&Vector3::new(0.5, -0.4, 3.0));
    let at = |p: &Rigid3| camera().project_with_jacobians(&p.apply(&x)).unwrap();
    let rows = pose.pose_rows(&at(&pose).d_point, &pose.apply(&x));
    for k in 0..6 {
        let h = 1e-6;
        let mut step = nalgebra::SVector::<f64, 6>::zeros();
        step[k] = h;
        let numeric = (at(&pose.moved(&step)).pixel - at(&pose.moved(&-step)).pixel) / (2.0 * h);
        for i in 0..2 {
            // Pixels are of size 1e3: differences lose the rest.
            assert!((rows[i][k] - numeric[i]).abs() < 1e-5 * (1.0 + numeric[i].abs()), "{i} {k}");
        }
    }
}

#[test]
fn focal_length_is_found_from_a_rough_list() {
    let mut failed = 0;
    for seed in 0..15 {
        let mut random = Random::new(seed);
        let p = problem(&mut random, &[Rigid3::identity()], 200, 0.5, 60, false);
        let (pixels, points): (Vec<_>, Vec<_>) = p.correspondences.iter().map(|c| (c.pixel, c.x_in_world)).unzip();
        let mut guess = camera();
        guess.params_mut()[0] *= 1.5;
        guess.params_mut()[1] *= 1.5;
        let o = RansacOptions { max_error: 8.0, ..RansacOptions::default() };
        let focals = [600.0, 800.0, 1000.0, 1300.0, 1700.0, f64::NAN, -3.0];
        let found = estimate_absolute_pose_and_focal(&guess, &pixels, &points, &o, &focals).unwrap();
        let shift = errors(&found.model.0, &p.rig_from_world).1;
        failed += usize::from((found.model.1 - 1102.5).abs() > 11.0 || shift > 0.05 || found.inliers.len() < 139);
    }
    assert!(failed <= 1, "{failed} of 15");
}

#[test]
fn bad_input_gives_nothing() {
    let mut random = Random::new(2);
    let mut p = problem(&mut random, &[Rigid3::identity()], 30, 0.0, 0, false);
    let o = RansacOptions { max_iterations: 100, ..RansacOptions::default() };
    assert!(estimate_absolute_pose(&[], &p.correspondences, &o).is_none());
    assert!(estimate_absolute_pose(&p.sensors, &p.correspondences[..2], &o).is_none());
    let same = vec![p.correspondences[0]; 30];
    assert!(estimate_absolute_pose(&p.sensors, &same, &o).is_none());
    p.correspondences[3].x_in_world.x = f64::NAN;
    p.correspondences[5].sensor = 9;
    let found = estimate_absolute_pose(&p.sensors, &p.correspondences, &o).unwrap();
    assert_eq!(found.inliers, (0..30).filter(|i| ![3, 5].contains(i)).collect::<Vec<_>>());
}

#[test]
fn repeated_calls_agree_to_the_bit() {
    let mut random = Random::new(6);
    let sensors = rig(&mut random);
    let p = problem(&mut random, &sensors, 300, 0.5, 150, false);
    let o = RansacOptions::default();
    assert_eq!(estimate_absolute_pose(&p.sensors, &p.correspondences, &o), estimate_absolute_pose(&p.sensors, &p.correspondences, &o));
}
