//! Minimal solvers and robust estimators against planted truth.

use super::*;
use crate::ransac::RansacOptions;
use crate::testing::{Random, Scene, distance_up_to_scale, two_views, two_views_of};
use nalgebra::{Matrix3, Vector2, Vector3};
use scene::Rigid3;

const TRIALS: u64 = 500;
/// Noise-free solutions of a well-posed sample; ill-posed ones lose digits, hence a share of failures is allowed.
const MINIMAL_TOLERANCE: f64 = 1e-6;
/// Focal length to give normalised noise a size in pixels.
const FOCAL_PX: f64 = 1000.0;

fn first<const N: usize>(x: &[Vector2<f64>]) -> [Vector2<f64>; N] {
    std::array::from_fn(|i| x[i])
}

fn options(max_error: f64) -> RansacOptions {
    RansacOptions { max_error, ..RansacOptions::default() }
}

/// Independent of the truth: singular, equal singular values, epipolar constraints.
fn essential_defect(e: &Matrix3<f64>, x1: &[Vector2<f64>], x2: &[Vector2<f64>]) -> f64 {
    let cubic = 2.0 * e * e.transpose() * e - (e * e.transpose()).trace() * e;
    let algebraic = x1.iter().zip(x2).map(|(a, b)| b.push(1.0).dot(&(e * a.push(1.0))).abs()).fold(0.0, f64::max);
    e.determinant().abs().max(cubic.amax()).max(algebraic)
}

#[test]
fn five_point_finds_the_truth_and_only_essential_matrices() {
    for scene in [Scene::Volume, Scene::Plane] {
        let (mut missed, mut invalid, mut solutions) = (0, 0, 0);
        for seed in 0..TRIALS {
            let v = two_views(&mut Random::new(seed), scene, 5, 0.0, 0);
            let truth = essential_from_pose(&v.pose);
            let mut found = Vec::new();
            five_point(&first(&v.x1), &first(&v.x2), &mut found);
            solutions += found.len();
            invalid += found.iter().filter(|e| essential_defect(e, &v.x1, &v.x2) > MINIMAL_TOLERANCE).count();
            missed += usize::from(!found.iter().any(|e| distance_up_to_scale(e, &truth) < MINIMAL_TOLERANCE));
        }
        assert!(missed <= TRIALS as usize / 100, "{missed} of {TRIALS} missed");
        assert!(invalid <= solutions / 100, "{invalid} of {solutions} invalid");
    }
}

#[test]
fn seven_point_finds_the_truth_and_only_singular_matrices() {
    let mut missed = 0;
    for seed in 0..TRIALS {
        let v = two_views(&mut Random::new(seed), Scene::Volume, 7, 0.0, 0);
        let truth = essential_from_pose(&v.pose);
        let mut found = Vec::new();
        seven_point(&first(&v.x1), &first(&v.x2), &mut found);
        for f in &found {
            assert!(f.determinant().abs() < 1e-12, "{}", f.determinant());
            assert!(v.x1.iter().zip(&v.x2).all(|(a, b)| b.push(1.0).dot(&(f * a.push(1.0))).abs() < 1e-12));
        }
        missed += usize::from(!found.iter().any(|f| distance_up_to_scale(f, &truth) < MINIMAL_TOLERANCE));
    }
    assert!(missed <= TRIALS as usize / 100, "{missed} of {TRIALS} missed");
}

#[test]
fn homography_of_four_points_of_a_plane_predicts_the_others() {
    let mut failed = 0;
    for seed in 0..TRIALS {
        let v = two_views(&mut Random::new(seed), Scene::Plane, 20, 0.0, 0);
        let Some(h) = four_point_homography(&first(&v.x1), &first(&v.x2)) else {
            failed += 1;
            continue;
        };
        let wrong = v.x1.iter().zip(&v.x2).any(|(a, b)| {
            let p = h * a.push(1.0);
            (p.xy() / p.z - b).norm() > 1e-6 || p.z <= 0.0
        });
        failed += usize::from(wrong);
    }
    assert!(failed <= TRIALS as usize / 50, "{failed} of {TRIALS} failed");
}

#[test]
fn eight_point_is_exact_without_noise() {
    for seed in 0..50 {
        let v = two_views(&mut Random::new(seed), Scene::Volume, 30, 0.0, 0);
        let f = eight_point(&v.x1, &v.x2).unwrap();
        assert!(distance_up_to_scale(&f, &essential_from_pose(&v.pose)) < 1e-7);
    }
}

#[test]
fn pose_comes_back_from_the_essential_matrix() {
    for seed in 0..100 {
        let v = two_views(&mut Random::new(seed), Scene::Volume, 20, 0.0, 0);
        for sign in [1.0, -1.0] {
            let found = pose_from_essential(&(essential_from_pose(&v.pose) * sign * 3.0), &v.x1, &v.x2).unwrap();
            assert_eq!(found.in_front, 20);
            assert!(found.cam2_from_cam1.rotation.angle_to(&v.pose.rotation) < 1e-7);
            assert!((found.cam2_from_cam1.translation - v.pose.translation).norm() < 1e-9);
            // Against the angle at the points, from the centres.
            let centre = v.pose.centre();
            let mut angles: Vec<f64> = v.points.iter().map(|x| x.angle(&(x - centre))).collect();
            angles.sort_by(f64::total_cmp);
            assert!((found.median_angle_rad - angles[10]).abs() < 1e-7);
        }
    }
}

#[test]
fn essential_survives_sixty_percent_outliers() {
    let noise = 0.5 / FOCAL_PX;
    for scene in [Scene::Volume, Scene::Plane] {
        let mut failed = 0;
        for seed in 0..20 {
            let v = two_views(&mut Random::new(seed), scene, 300, noise, 180);
            let found = estimate_essential(&v.x1, &v.x2, &options(2.0 / FOCAL_PX)).unwrap();
            let true_found = found.inliers.iter().filter(|i| **i >= 180).count();
            let pose = pose_from_essential(&found.model, &v.x1, &v.x2).unwrap().cam2_from_cam1;
            let (turn, tilt) = (pose.rotation.angle_to(&v.pose.rotation), pose.translation.angle(&v.pose.translation));
            assert!(found.inliers.is_sorted() && essential_defect(&found.model, &[], &[]) < 1e-12);
            // 120 inliers with half a pixel: a good fit is within 0.5 degrees; planes have a second solution.
            failed += usize::from(true_found < 115 || (scene == Scene::Volume && (turn > 0.01 || tilt > 0.05)));
        }
        assert!(failed <= 1, "{failed} of 20");
    }
}

#[test]
fn fundamental_survives_half_outliers_in_pixels() {
    let mut failed = 0;
    for seed in 0..20 {
        let v = two_views(&mut Random::new(seed), Scene::Volume, 300, 0.5 / FOCAL_PX, 150);
        let to_pixels = |x: &[Vector2<f64>]| -> Vec<Vector2<f64>> { x.iter().map(|p| p * FOCAL_PX + Vector2::new(960.0, 600.0)).collect() };
        let (p1, p2) = (to_pixels(&v.x1), to_pixels(&v.x2));
        let found = estimate_fundamental(&p1, &p2, &options(2.0)).unwrap();
        assert!(found.model.determinant().abs() < 1e-12 && (found.model.norm() - 1.0).abs() < 1e-12);
        let true_found = found.inliers.iter().filter(|i| **i >= 150).count();
        let errors: f64 = (150..300).map(|i| sampson_squared(&found.model, &p1[i], &p2[i])).sum();
        failed += usize::from(true_found < 144 || (errors / 150.0).sqrt() > 0.6);
    }
    assert!(failed <= 1, "{failed} of 20");
}

#[test]
fn homography_survives_sixty_percent_outliers() {
    for seed in 0..20 {
        let v = two_views(&mut Random::new(seed), Scene::Plane, 300, 0.5 / FOCAL_PX, 180);
        let found = estimate_homography(&v.x1, &v.x2, &options(3.0 / FOCAL_PX)).unwrap();
        assert!(found.inliers.iter().filter(|i| **i >= 180).count() >= 116);
        // The points without noise, moved by H: 120 points leave a tenth of the noise, corners a little more.
        let worst = v.points.iter().map(|x| {
            let p = found.model * (x / x.z);
            let y = v.pose.apply(x);
            (p.xy() / p.z - y.xy() / y.z).norm()
        });
        assert!(worst.fold(0.0, f64::max) < 2.0 / FOCAL_PX);
    }
}

#[test]
fn pure_rotation_is_a_homography_and_its_rays_are_parallel() {
    let mut random = Random::new(5);
    let pose = Rigid3::new(random.rotation(0.4), Vector3::zeros());
    let v = two_views_of(&mut random, pose, Scene::Volume, 200, 0.3 / FOCAL_PX, 40);
    let h = estimate_homography(&v.x1, &v.x2, &options(2.0 / FOCAL_PX)).unwrap();
    assert!(h.inliers.len() >= 156);
    let e = estimate_essential(&v.x1, &v.x2, &options(2.0 / FOCAL_PX)).unwrap();
    let (i1, i2): (Vec<_>, Vec<_>) = e.inliers.iter().map(|&i| (v.x1[i], v.x2[i])).unzip();
    let found = pose_from_essential(&e.model, &i1, &i2);
    assert!(found.is_none_or(|p| p.median_angle_rad < 5e-3), "{found:?}");
}

#[test]
fn refinement_reaches_the_truth_from_a_distance() {
    for seed in 0..50 {
        let mut random = Random::new(seed);
        let v = two_views(&mut random, Scene::Volume, 60, 0.0, 0);
        let start = Rigid3::new(random.rotation(0.02) * v.pose.rotation, 3.0 * (v.pose.translation + random.vector(0.03)));
        let found = refine_relative_pose(&start, &v.x1, &v.x2, 0.1);
        assert!(found.rotation.angle_to(&v.pose.rotation) < 1e-6 && (found.translation - v.pose.translation).norm() < 1e-6, "{seed}");
    }
    let still = Rigid3::identity();
    assert_eq!(refine_relative_pose(&still, &[Vector2::zeros()], &[Vector2::zeros()], 1.0), still);
}

#[test]
fn degenerate_input_gives_nothing_or_something_finite() {
    let same = vec![Vector2::new(0.3, -0.2); 20];
    let line: Vec<Vector2<f64>> = (0..20).map(|i| Vector2::new(0.1 * f64::from(i), 0.05 * f64::from(i) + 0.1)).collect();
    let mut pairs_twice = line[..4].to_vec();
    pairs_twice.extend_from_within(..);
    let bad = vec![Vector2::new(f64::NAN, f64::INFINITY); 20];
    let few = vec![Vector2::new(0.1, 0.2)];
    for x in [&same, &line, &pairs_twice, &bad, &few, &Vec::new()] {
        let o = RansacOptions { max_iterations: 200, ..options(0.01) };
        let finite = |m: &Matrix3<f64>| m.iter().all(|v| v.is_finite());
        assert!(estimate_essential(x, x, &o).is_none_or(|r| finite(&r.model)));
        assert!(estimate_fundamental(x, x, &o).is_none_or(|r| finite(&r.model)));
        assert!(estimate_homography(x, x, &o).is_none());
    }
    let mut out = Vec::new();
    five_point(&first(&same), &first(&same), &mut out);
    seven_point(&first(&same), &first(&same), &mut out);
    seven_point(&first(&bad), &first(&bad), &mut out);
    five_point(&first(&bad), &first(&bad), &mut out);
    assert!(out.is_empty());
    assert!(four_point_homography(&first(&line), &first(&line)).is_none());
    assert!(pose_from_essential(&Matrix3::from_element(f64::NAN), &line, &line).is_none());
    assert!(pose_from_essential(&Matrix3::zeros(), &line, &line).is_none());
}

#[test]
fn bad_pairs_are_outliers_and_indices_are_those_of_the_input() {
    let mut v = two_views(&mut Random::new(3), Scene::Volume, 60, 0.0, 0);
    for i in [0, 7, 30] {
        v.x1[i].x = f64::NAN;
    }
    let found = estimate_essential(&v.x1, &v.x2, &options(1e-3)).unwrap();
    let expected: Vec<usize> = (0..60).filter(|i| ![0, 7, 30].contains(i)).collect();
    assert_eq!(found.inliers, expected);
    for o in [options(f64::NAN), options(-1.0), RansacOptions { confidence: f64::NAN, ..options(1.0) }] {
        assert!(estimate_fundamental(&v.x1, &v.x2, &o).is_none());
    }
}

#[test]
fn repeated_calls_agree_to_the_bit_and_seeds_matter() {
    let v = two_views(&mut Random::new(8), Scene::Volume, 400, 0.5 / FOCAL_PX, 200);
    let o = options(2.0 / FOCAL_PX);
    assert_eq!(estimate_essential(&v.x1, &v.x2, &o), estimate_essential(&v.x1, &v.x2, &o));
    assert_eq!(estimate_fundamental(&v.x1, &v.x2, &o), estimate_fundamental(&v.x1, &v.x2, &o));
    assert_eq!(estimate_homography(&v.x1, &v.x2, &o), estimate_homography(&v.x1, &v.x2, &o));
    let other = estimate_fundamental(&v.x1, &v.x2, &RansacOptions { seed: 1, ..o });
    assert_ne!(estimate_fundamental(&v.x1, &v.x2, &o), other);
}

#[test]
fn sampson_is_the_distance_to_the_nearest_consistent_pair() {
    // Rectified pair: the constraint is y1 = y2, and the nearest pair shares the mean.
    let e = essential_from_pose(&Rigid3::new(nalgebra::UnitQuaternion::identity(), Vector3::x()));
    let squared = sampson_squared(&e, &Vector2::new(0.1, 0.3), &Vector2::new(-0.4, 0.5));
    assert!((squared - 0.02).abs() < 1e-15, "{squared}");
}

#[test]
fn a_model_of_a_few_pairs_improves_to_that_of_all() {
    let to_pixels = |x: &[Vector2<f64>]| -> Vec<Vector2<f64>> { x.iter().map(|p| p * FOCAL_PX + Vector2::new(960.0, 600.0)).collect() };
    for seed in 0..20 {
        // 40 % outliers first, then right pairs, of which the model sees the first 25.
        let v = two_views(&mut Random::new(seed), Scene::Volume, 500, 0.5 / FOCAL_PX, 200);
        let (few1, few2) = (&v.x1[200..225], &v.x2[200..225]);
        let limit = 2.0 / FOCAL_PX;
        let start = estimate_essential(few1, few2, &options(limit)).unwrap();
        let (found, sampled) =
            (improve_essential(&start.model, &v.x1, &v.x2, limit).unwrap(), estimate_essential(&v.x1, &v.x2, &options(limit)).unwrap());
        assert!(essential_defect(&found.model, &[], &[]) < 1e-12 && found.iterations == 0);
        assert!(found.inliers.len() + 3 >= sampled.inliers.len(), "{} of {}", found.inliers.len(), sampled.inliers.len());
        assert!(distance_up_to_scale(&found.model, &sampled.model) < 0.01);

        let (p1, p2) = (to_pixels(&v.x1), to_pixels(&v.x2));
        let start = estimate_fundamental(&p1[200..225], &p2[200..225], &options(2.0)).unwrap();
        let (found, sampled) =
            (improve_fundamental(&start.model, &p1, &p2, 2.0).unwrap(), estimate_fundamental(&p1, &p2, &options(2.0)).unwrap());
        assert!(found.model.determinant().abs() < 1e-12 && (found.model.norm() - 1.0).abs() < 1e-12);
        assert!(found.inliers.len() + 6 >= sampled.inliers.len(), "{} of {}", found.inliers.len(), sampled.inliers.len());
    }
    let v = two_views(&mut Random::new(1), Scene::Volume, 30, 0.0, 0);
    let truth = essential_from_pose(&v.pose);
    for limit in [f64::NAN, -1.0, 0.0, f64::INFINITY] {
        assert!(improve_essential(&truth, &v.x1, &v.x2, limit).is_none() && improve_fundamental(&truth, &v.x1, &v.x2, limit).is_none());
    }
    assert!(improve_essential(&Matrix3::from_element(f64::NAN), &v.x1, &v.x2, 0.1).is_none());
    assert!(improve_essential(&truth, &v.x1[..4], &v.x2[..4], 0.1).is_none());
}

#[test]
fn transfer_errors_are_those_of_the_estimate() {
    let v = two_views(&mut Random::new(2), Scene::Plane, 300, 0.5 / FOCAL_PX, 100);
    let limit = 3.0 / FOCAL_PX;
    let found = estimate_homography(&v.x1, &v.x2, &options(limit)).unwrap();
    let errors = transfer_squared(&found.model, &v.x1, &v.x2);
    let within: Vec<usize> = (0..300).filter(|&i| errors[i] < limit * limit).collect();
    assert_eq!(within, found.inliers);
    // A shift by (3, 4) is off by 5 either way; a singular matrix has no way back.
    let x = [Vector2::new(1.0, 2.0)];
    assert!((transfer_squared(&Matrix3::identity(), &x, &[Vector2::new(4.0, 6.0)])[0] - 25.0).abs() < 1e-12);
    assert_eq!(transfer_squared(&Matrix3::zeros(), &x, &x), [f64::INFINITY]);
}
