//! Time of a minimal sample, of one robust estimation and of one triangulation.
//!
//! `cargo bench -p solve --bench solvers`

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::{Camera, CameraModel, Rigid3};
use solve::absolute::{Correspondence, Sensor, estimate_absolute_pose, p3p};
use solve::ransac::RansacOptions;
use solve::relative::{estimate_essential, estimate_fundamental, estimate_homography, five_point, four_point_homography, seven_point};
use solve::triangulate::{View, triangulate, triangulate_robust, triangulate_two};
use std::hint::black_box;

const FOCAL_PX: f64 = 1100.0;
/// Problems that a bench goes round, so that no branch is learnt.
const PROBLEMS: usize = 256;

struct Random(ChaCha8Rng);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn vector(&mut self, half_side: f64) -> Vector3<f64> {
        Vector3::new(self.uniform(-half_side, half_side), self.uniform(-half_side, half_side), self.uniform(-half_side, half_side))
    }

    fn noise(&mut self, half_side: f64) -> Vector2<f64> {
        self.vector(half_side).xy()
    }
}

type Pairs = (Vec<Vector2<f64>>, Vec<Vector2<f64>>);

/// `n` pairs in normalised coordinates, the first `outliers` of them random, the others with up to a pixel of noise.
fn pairs(random: &mut Random, n: usize, outliers: usize) -> Pairs {
    let pose = Rigid3::new(UnitQuaternion::from_scaled_axis(random.vector(0.2)), random.vector(1.0));
    let noise = 1.0 / FOCAL_PX;
    (0..n)
        .map(|i| {
            let x = Vector3::new(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7), 1.0) * random.uniform(3.0, 8.0);
            let y = pose.apply(&x);
            let b = if i < outliers { random.noise(0.7) } else { y.xy() / y.z };
            (x.xy() / x.z + random.noise(noise), b + random.noise(noise))
        })
        .unzip()
}

fn first<const N: usize>(x: &[Vector2<f64>]) -> [Vector2<f64>; N] {
    std::array::from_fn(|i| x[i])
}

/// Goes round the problems.
fn each<P>(c: &mut Criterion, name: &str, problems: &[P], mut f: impl FnMut(&P)) {
    let mut next = 0;
    c.bench_function(name, |b| {
        b.iter(|| {
            next = (next + 1) % problems.len();
            f(black_box(&problems[next]));
        });
    });
}

fn minimal(c: &mut Criterion) {
    let mut random = Random(ChaCha8Rng::seed_from_u64(1));
    let problems: Vec<Pairs> = (0..PROBLEMS).map(|_| pairs(&mut random, 7, 0)).collect();
    let mut out = Vec::new();
    each(c, "five_point", &problems, |(x1, x2)| {
        out.clear();
        five_point(&first(x1), &first(x2), &mut out);
    });
    each(c, "seven_point", &problems, |(x1, x2)| {
        out.clear();
        seven_point(&first(x1), &first(x2), &mut out);
    });
    each(c, "four_point_homography", &problems, |(x1, x2)| {
        black_box(four_point_homography(&first(x1), &first(x2)));
    });
    let triples: Vec<_> = (0..PROBLEMS)
        .map(|_| {
            let pose = Rigid3::new(UnitQuaternion::from_scaled_axis(random.vector(1.0)), random.vector(5.0));
            let rays = [(); 3].map(|()| Vector3::new(random.uniform(-0.7, 0.7), random.uniform(-0.7, 0.7), 1.0).normalize());
            (rays, rays.map(|r| pose.inverse().apply(&(r * random.uniform(2.0, 8.0)))))
        })
        .collect();
    let mut poses = Vec::new();
    each(c, "p3p", &triples, |(rays, x)| {
        poses.clear();
        p3p(rays, x, &mut poses);
    });
}

fn robust(c: &mut Criterion) {
    let mut random = Random(ChaCha8Rng::seed_from_u64(2));
    for (name, outliers) in [("10", 100), ("50", 500)] {
        let problems: Vec<Pairs> = (0..16).map(|_| pairs(&mut random, 1000, outliers)).collect();
        let o = RansacOptions { max_error: 3.0 / FOCAL_PX, ..RansacOptions::default() };
        each(c, &format!("essential_1000_{name}%"), &problems, |(x1, x2)| {
            black_box(estimate_essential(x1, x2, &o));
        });
        each(c, &format!("fundamental_1000_{name}%"), &problems, |(x1, x2)| {
            black_box(estimate_fundamental(x1, x2, &o));
        });
        let o = RansacOptions { max_iterations: 1000, ..o };
        each(c, &format!("homography_of_a_volume_1000_{name}%"), &problems, |(x1, x2)| {
            black_box(estimate_homography(x1, x2, &o));
        });
        let camera = camera();
        let problems: Vec<_> = (0..16).map(|_| correspondences(&mut random, &camera, 1000, outliers)).collect();
        let sensors = [Sensor { camera, cam_from_rig: Rigid3::identity() }];
        each(c, &format!("absolute_1000_{name}%"), &problems, |p| {
            black_box(estimate_absolute_pose(&sensors, p, &RansacOptions::default()));
        });
    }
}

fn camera() -> Camera {
    Camera::new(CameraModel::OpenCv, 1920, 1200, &[FOCAL_PX, FOCAL_PX, 955.0, 610.0, -0.2, 0.05, 0.001, -0.002]).expect("valid parameters")
}

fn correspondences(random: &mut Random, camera: &Camera, n: usize, outliers: usize) -> Vec<Correspondence> {
    let pose = Rigid3::new(UnitQuaternion::from_scaled_axis(random.vector(1.0)), random.vector(5.0));
    let mut pixel = || Vector2::new(random.uniform(0.0, 1920.0), random.uniform(0.0, 1200.0));
    (0..n)
        .map(|i| {
            let seen = pixel();
            let ray = camera.unproject(&seen).expect("inside the image").push(1.0);
            let depth = 2.0 + 6.0 * (i % 97) as f64 / 97.0;
            let pixel = if i < outliers { pixel() } else { seen };
            Correspondence { sensor: 0, pixel, x_in_world: pose.inverse().apply(&(ray * depth)) }
        })
        .collect()
}

fn tracks(c: &mut Criterion) {
    let mut random = Random(ChaCha8Rng::seed_from_u64(3));
    for (n, outliers) in [(2, 0), (5, 0), (5, 1), (15, 3)] {
        let problems: Vec<Vec<View>> = (0..PROBLEMS)
            .map(|_| {
                let x = Vector3::new(0.0, 0.0, 6.0) + random.vector(1.0);
                (0..n)
                    .map(|i| {
                        let centre = Vector3::x() * (0.4 * i as f64) + random.vector(0.2);
                        let rotation = UnitQuaternion::from_scaled_axis(random.vector(0.1));
                        let pose = Rigid3::new(rotation, -(rotation * centre));
                        let seen = camera().project(&pose.apply(&x)).expect("in front");
                        let pixel = if i < outliers { Vector2::new(900.0, 600.0) + random.noise(500.0) } else { seen + random.noise(1.0) };
                        View::new(camera(), &pose, pixel).expect("inside the image")
                    })
                    .collect()
            })
            .collect();
        if n == 2 {
            each(c, "triangulate_two", &problems, |v| {
                black_box(triangulate_two(&v[0], &v[1]));
            });
        }
        each(c, &format!("triangulate_{n}"), &problems, |v| {
            black_box(triangulate(v));
        });
        each(c, &format!("triangulate_robust_{n}_{outliers}_wrong"), &problems, |v| {
            black_box(triangulate_robust(v, 4.0, 0.02));
        });
    }
    c.bench_function("view", |b| {
        b.iter(|| black_box(View::new(camera(), &Rigid3::identity(), black_box(Vector2::new(1500.0, 200.0)))));
    });
}

fn settings() -> Criterion {
    Criterion::default()
        .warm_up_time(std::time::Duration::from_millis(200))
        .measurement_time(std::time::Duration::from_millis(800))
        .sample_size(20)
}

criterion_group! { name = benches; config = settings(); targets = minimal, robust, tracks }
criterion_main!(benches);
