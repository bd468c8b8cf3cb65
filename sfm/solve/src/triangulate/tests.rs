//! Triangulation against planted points.

use super::*;
use crate::testing::Random;
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use scene::{Camera, CameraModel, Rigid3};

fn camera() -> Camera {
    Camera::new(CameraModel::Radial, 1600, 1200, &[1200.0, 800.0, 600.0, -0.15, 0.03]).unwrap()
}

/// Cameras beside each other that look roughly along +z at a point 3 to 10 away; the first `outliers` pixels are random.
fn track(random: &mut Random, n: usize, noise_px: f64, outliers: usize) -> (Vec<View>, Vector3<f64>) {
    let x = Vector3::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(3.0, 10.0));
    let views = (0..n)
        .map(|i| {
            let centre = Vector3::new(i as f64 * 0.4, random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2));
            let rotation = random.rotation(0.1);
            let cam_from_world = Rigid3::new(rotation, -(rotation * centre));
            let mut pixel = camera().project(&cam_from_world.apply(&x)).unwrap();
            if i < outliers {
                pixel = Vector2::new(random.uniform(0.0, 1600.0), random.uniform(0.0, 1200.0));
            }
            View::new(camera(), &cam_from_world, pixel + Vector2::new(random.normal(), random.normal()) * noise_px).unwrap()
        })
        .collect();
    (views, x)
}

#[test]
fn exact_observations_give_the_point() {
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let (views, x) = track(&mut random, 5, 0.0, 0);
        assert!((triangulate(&views).unwrap() - x).norm() < 1e-8);
        assert!((triangulate_two(&views[0], &views[4]).unwrap() - x).norm() < 1e-8);
        let (robust, inliers) = triangulate_robust(&views, 1.0, 0.01).unwrap();
        assert!((robust - x).norm() < 1e-8 && inliers == [true; 5]);
    }
}

#[test]
fn result_is_a_minimum_of_the_reprojection_error() {
    for seed in 0..50 {
        let mut random = Random::new(seed);
        let (views, _) = track(&mut random, 4, 1.0, 0);
        let cost = |x: &Vector3<f64>| views.iter().map(|v| v.squared_error(x)).sum::<f64>();
        let x = triangulate(&views).unwrap();
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            for h in [1e-4, -1e-4] {
                assert!(cost(&(x + axis * h)) > cost(&x), "{seed}");
            }
        }
    }
}

#[test]
fn two_view_point_is_near_the_optimum() {
    let (mut two, mut best) = (0.0, 0.0);
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let (views, _) = track(&mut random, 2, 1.0, 0);
        let cost = |x: &Vector3<f64>| views.iter().map(|v| v.squared_error(x)).sum::<f64>();
        two += cost(&triangulate_two(&views[0], &views[1]).unwrap());
        best += cost(&triangulate(&views).unwrap());
    }
    assert!(two < 1.1 * best && best <= two, "{two} {best}");
}

#[test]
fn wrong_observations_are_found() {
    for (n, outliers) in [(3, 1), (6, 3), (10, 6), (40, 20)] {
        let mut failed = 0;
        for seed in 0..50 {
            let mut random = Random::new(seed);
            let (views, x) = track(&mut random, n, 0.5, outliers);
            let expected: Vec<bool> = (0..n).map(|i| i >= outliers).collect();
            // Noise beyond 2.5 px (five sigma) is no inlier; a random pixel may be one by chance.
            let good =
                triangulate_robust(&views, 2.5, 0.01).is_some_and(|(found, inliers)| inliers == expected && (found - x).norm() < 0.5);
            failed += usize::from(!good);
        }
        assert!(failed <= 3, "{n} {outliers}: {failed} of 50");
    }
}

#[test]
fn parallel_rays_and_points_behind_have_no_point() {
    let view =
        |centre: Vector3<f64>, pixel: Vector2<f64>| View::new(camera(), &Rigid3::new(UnitQuaternion::identity(), -centre), pixel).unwrap();
    let middle = Vector2::new(800.0, 600.0);
    let (left, right) = (view(Vector3::zeros(), middle), view(Vector3::x(), middle));
    assert!(triangulate_two(&left, &right).is_none() && triangulate(&[left, right]).is_none());
    assert!(triangulate_two(&left, &left).is_none() && triangulate(&[left, left]).is_none());
    assert!(triangulate(&[left]).is_none() && triangulate(&[]).is_none());
    // Rays that diverge meet behind the cameras.
    let diverging = view(Vector3::x(), middle + Vector2::new(100.0, 0.0));
    assert!(triangulate_two(&left, &diverging).is_none() && triangulate(&[left, diverging]).is_none());
    for views in [&[left, right][..], &[left, diverging], &[left, left, left], &[left], &[]] {
        assert!(triangulate_robust(views, 4.0, 0.0).is_none());
    }
    assert!(View::new(camera(), &Rigid3::identity(), Vector2::new(f64::NAN, 3.0)).is_none());
}

#[test]
fn angle_limit_is_kept() {
    let (views, x) = track(&mut Random::new(3), 4, 0.0, 0);
    let widest = max_triangulation_angle(views.iter().map(View::centre), &x);
    let by_hand = (views[0].centre() - x).angle(&(views[3].centre() - x));
    assert!((widest - by_hand).abs() < 1e-9 && (triangulation_angle(views[0].centre(), views[3].centre(), &x) - by_hand).abs() < 1e-9);
    assert!(triangulate_robust(&views, 1.0, widest * 0.99).is_some());
    assert!(triangulate_robust(&views, 1.0, widest * 1.01).is_none());
}

#[test]
fn repeated_calls_agree_to_the_bit() {
    let (views, _) = track(&mut Random::new(9), 40, 0.5, 20);
    assert_eq!(triangulate_robust(&views, 2.0, 0.01), triangulate_robust(&views, 2.0, 0.01));
}
