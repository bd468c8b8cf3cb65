//! The engine with the simplest of estimators: a line `y = a x + b`.

use super::*;
use crate::testing::Random;
use nalgebra::{Matrix2, Vector2};

struct Line {
    points: Vec<Vector2<f64>>,
}

impl Estimator for Line {
    type Model = Vector2<f64>;

    fn sample_size(&self) -> usize {
        2
    }

    fn len(&self) -> usize {
        self.points.len()
    }

    fn solve(&self, sample: &[usize], models: &mut Vec<Vector2<f64>>) {
        let (p, q) = (self.points[sample[0]], self.points[sample[1]]);
        let a = (q.y - p.y) / (q.x - p.x);
        if a.is_finite() {
            models.push(Vector2::new(a, p.y - a * p.x));
        }
    }

    fn squared_errors(&self, model: &Vector2<f64>, start: usize, out: &mut [f64]) {
        for (e, p) in out.iter_mut().zip(&self.points[start..]) {
            *e = (model.x * p.x + model.y - p.y).powi(2);
        }
    }

    fn refine(&self, _: &Vector2<f64>, inliers: &[usize], _: f64) -> Option<Vector2<f64>> {
        let (mut a, mut b) = (Matrix2::zeros(), Vector2::zeros());
        for p in inliers.iter().map(|&i| self.points[i]) {
            let row = Vector2::new(p.x, 1.0);
            a += row * row.transpose();
            b += row * p.y;
        }
        a.try_inverse().map(|inverse| inverse * b)
    }
}

/// Of 500 points, the last 200 lie on y = 2 x - 1 with noise of 0.01; one is not a number.
fn line() -> Line {
    let mut random = Random::new(11);
    let mut points: Vec<_> = (0..300).map(|_| random.vector(5.0).xy()).collect();
    points.extend((0..200).map(|_| {
        let x = random.uniform(-2.0, 2.0);
        Vector2::new(x, 2.0 * x - 1.0 + 0.01 * random.normal())
    }));
    points[17].y = f64::NAN;
    Line { points }
}

fn options() -> RansacOptions {
    RansacOptions { max_error: 0.05, ..RansacOptions::default() }
}

#[test]
fn parts_combine_freely_and_find_the_line() {
    let estimator = line();
    let uniform = UniformSampler { len: 500 };
    let grouped = GroupedSampler { groups: vec![0..250, 250..500] };
    let limit = options().max_error.powi(2);
    let results = [
        run(&estimator, &uniform, &Msac { max_squared_error: limit }, &options()),
        run(&estimator, &uniform, &InlierCount { max_squared_error: limit }, &options()),
        run(&estimator, &grouped, &Msac { max_squared_error: limit }, &options()),
    ];
    for found in results.map(Option::unwrap) {
        // 200 points: 0.0007 in the offset, five times that allowed.
        assert!((found.model - Vector2::new(2.0, -1.0)).amax() < 0.0035, "{}", found.model);
        assert!(found.inliers.is_sorted() && found.inliers.iter().filter(|i| **i >= 300).count() == 200);
        assert!(!found.inliers.contains(&17));
        assert!(found.iterations >= 30 && found.iterations < 1000, "{}", found.iterations);
    }
}

#[test]
fn iterations_follow_the_confidence() {
    // (2/5)^2 of the samples are good (a few more by chance): ln(1 - c) / ln(1 - 0.16).
    for (confidence, expected) in [(0.9, 13.2), (0.9999, 52.8)] {
        let o = RansacOptions { confidence, min_iterations: 1, ..options() };
        let estimator = line();
        // Seeds under which the line is found late end after the draw that finds it.
        let iterations = (0..20).map(|seed| {
            let o = RansacOptions { seed, ..o };
            run(&estimator, &UniformSampler { len: 500 }, &Msac { max_squared_error: 0.0025 }, &o).unwrap().iterations
        });
        let median = {
            let mut all: Vec<_> = iterations.collect();
            all.sort_unstable();
            all[10] as f64
        };
        assert!((median / expected - 1.0).abs() < 0.15, "{median} {expected}");
    }
}

#[test]
fn nothing_comes_from_nothing() {
    let msac = Msac { max_squared_error: 1.0 };
    let empty = Line { points: Vec::new() };
    assert!(run(&empty, &UniformSampler { len: 0 }, &msac, &options()).is_none());
    let same = Line { points: vec![Vector2::new(1.0, 1.0); 50] };
    assert!(run(&same, &UniformSampler { len: 50 }, &msac, &options()).is_none());
    let none = RansacOptions { max_iterations: 0, ..options() };
    assert!(run(&line(), &UniformSampler { len: 500 }, &msac, &none).is_none());
}
