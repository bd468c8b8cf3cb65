//! Averaging against truth.

use super::*;
use crate::testing::Random;
use nalgebra::{UnitQuaternion, Vector3};

/// True rotations and the edges of a chain with loops: each node with the next, the fourth next, and some far ones.
fn network(nodes: usize, noise_rad: f64, outliers: f64, seed: u64) -> (Vec<UnitQuaternion<f64>>, Vec<RelativeRotation>) {
    let mut random = Random::new(seed);
    let mut truth: Vec<UnitQuaternion<f64>> = (0..nodes).map(|_| random.rotation(3.0)).collect();
    truth[0] = UnitQuaternion::identity();
    let mut edges = Vec::new();
    for a in 0..nodes {
        for b in [a + 1, a + 2, a + 4, a + 7, a + nodes / 3].into_iter().filter(|&b| b < nodes) {
            let wrong = random.uniform(0.0, 1.0) < outliers && b != a + 1;
            let noise = UnitQuaternion::from_scaled_axis(Vector3::new(random.normal(), random.normal(), random.normal()) * noise_rad);
            let exact = truth[b] * truth[a].inverse();
            let b_from_a = if wrong { random.rotation(3.0) } else { noise * exact };
            // Wrong ones rest on fewer matches.
            edges.push(RelativeRotation { a, b, b_from_a, weight: if wrong { 0.5 } else { 1.0 } });
        }
    }
    (truth, edges)
}

fn errors(found: &[UnitQuaternion<f64>], truth: &[UnitQuaternion<f64>]) -> Vec<f64> {
    found.iter().zip(truth).map(|(a, b)| a.angle_to(b)).collect()
}

#[test]
fn exact_rotations_give_the_truth() {
    let (truth, edges) = network(60, 0.0, 0.0, 1);
    let found = average_rotations(60, &edges, &AveragingOptions::default()).expect("connected");
    // angle_to cannot tell angles below the root of the rounding error.
    assert!(errors(&found.rotations, &truth).iter().all(|e| *e < 1e-7));
    assert!(found.residuals_rad.iter().all(|r| *r < 1e-12));
}

#[test]
fn noise_averages_out_and_wrong_edges_do_not_matter() {
    let noise = 1f64.to_radians();
    let mean = |outliers: f64| {
        let (truth, edges) = network(200, noise, outliers, 2);
        let found = average_rotations(200, &edges, &AveragingOptions::default()).expect("connected");
        let wrong = edges.iter().zip(&found.residuals_rad).filter(|(e, _)| e.weight < 1.0);
        // What is wrong by more than 20 degrees shows.
        assert!(wrong.filter(|(_, r)| **r < 5f64.to_radians()).count() < 10);
        errors(&found.rotations, &truth).iter().sum::<f64>() / 200.0
    };
    let (clean, with_outliers) = (mean(0.0), mean(0.3));
    // An edge errs by 1.7 degrees; a chain of 200 nodes with loops of 66 averages that down to about as much.
    assert!(clean < 1.5 * noise, "{}", clean.to_degrees());
    assert!(with_outliers < 1.6 * clean, "{} {}", with_outliers.to_degrees(), clean.to_degrees());
}

#[test]
fn graphs_that_fall_apart_are_refused() {
    let (_, mut edges) = network(10, 0.0, 0.0, 3);
    edges.retain(|e| (e.a < 6) == (e.b < 6));
    assert_eq!(average_rotations(10, &edges, &AveragingOptions::default()), Err(AveragingError::NotConnected(6)));
    assert_eq!(components(10, edges.iter().map(|e| (e.a, e.b))), vec![(0..6).collect::<Vec<_>>(), (6..10).collect()]);
    edges[3].a = 99;
    assert_eq!(average_rotations(10, &edges, &AveragingOptions::default()), Err(AveragingError::BadEdge(3)));
    assert_eq!(average_rotations(1, &[], &AveragingOptions::default()).map(|a| a.rotations.len()), Ok(1));
}

/// Nodes on a loop about points; each sees those within reach, in directions with noise and outliers.
fn scene(arm: f64, noise_rad: f64, outliers: f64) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Vec<Bearing>) {
    let mut random = Random::new(5);
    let nodes: Vec<Vector3<f64>> = (0..40)
        .map(|i| {
            let angle = std::f64::consts::TAU * f64::from(i) / 40.0;
            Vector3::new(6.0 * angle.cos(), 6.0 * angle.sin(), 0.3 * f64::from(i % 3))
        })
        .collect();
    let points: Vec<Vector3<f64>> = (0..400)
        .map(|_| {
            let angle = random.uniform(0.0, std::f64::consts::TAU);
            let radius = random.uniform(2.5, 4.0);
            Vector3::new(radius * angle.cos(), radius * angle.sin(), random.uniform(-1.0, 1.0))
        })
        .collect();
    let mut bearings = Vec::new();
    for (p, x) in points.iter().enumerate() {
        for (n, c) in nodes.iter().enumerate().filter(|(_, c)| (x - **c).norm() < 4.5) {
            // Two cameras of a rig, or one.
            for side in if arm > 0.0 { vec![-1.0, 1.0] } else { vec![0.0] } {
                let offset = Vector3::new(-c.y, c.x, 0.0).normalize() * (side * arm);
                let noise = Vector3::new(random.normal(), random.normal(), random.normal()) * noise_rad;
                let exact = (x - c - offset).normalize() + noise;
                let wrong = random.uniform(0.0, 1.0) < outliers;
                let direction = if wrong { random.rotation(3.0) * exact } else { exact }.normalize();
                bearings.push(Bearing { node: n as u32, point: p as u32, direction, offset });
            }
        }
    }
    (nodes, points, bearings)
}

/// Largest error of a node after a translation, and a scale where there is none.
fn deviation(found: &[Vector3<f64>], truth: &[Vector3<f64>], metric: bool) -> (f64, f64) {
    let mean = |v: &[Vector3<f64>]| v.iter().sum::<Vector3<f64>>() / v.len() as f64;
    let (f, t) = (mean(found), mean(truth));
    let up: f64 = found.iter().zip(truth).map(|(a, b)| (a - f).dot(&(b - t))).sum();
    let scale = up / found.iter().map(|a| (a - f).norm_squared()).sum::<f64>();
    let used = if metric { 1.0 } else { scale };
    (found.iter().zip(truth).map(|(a, b)| (used * (a - f) - (b - t)).norm()).fold(0.0, f64::max), scale)
}

#[test]
fn positions_follow_from_directions_from_any_start() {
    let (nodes, points, bearings) = scene(0.0, 0.0, 0.0);
    for seed in 0..4 {
        let options = PositioningOptions { seed, function_tolerance: 1e-12, ..PositioningOptions::default() };
        let found = position(nodes.len(), points.len(), &bearings, &options).expect("sound");
        let (worst, _) = deviation(&found.nodes, &nodes, false);
        assert!(worst < 1e-4, "seed {seed}: {worst} after {}", found.iterations);
    }
}

#[test]
fn rigs_give_metres() {
    let (nodes, points, bearings) = scene(0.3, 0.0005, 0.1);
    let found = position(nodes.len(), points.len(), &bearings, &PositioningOptions::default()).expect("sound");
    let (worst, scale) = deviation(&found.nodes, &nodes, true);
    // 0.5 mrad at 3 m is 1.5 mm a direction; a tenth of the directions is wrong.
    assert!(worst < 0.05 && (scale - 1.0).abs() < 0.01, "{worst} {scale} after {}", found.iterations);
}

#[test]
fn bad_bearings_are_refused() {
    let (nodes, points, mut bearings) = scene(0.0, 0.0, 0.0);
    bearings[3].direction *= 2.0;
    assert_eq!(position(nodes.len(), points.len(), &bearings, &PositioningOptions::default()), None);
}
