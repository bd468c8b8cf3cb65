//! Time of whole adjustments of synthetic problems, from setting up to the summary.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use scene::{Camera, CameraModel, Rigid3};
use solve::adjust::{AdjustOptions, Baseline, CameraBlock, ImageObservation, Loss, PointBlock, PoseBlock, Problem, adjust};
use std::hint::black_box;

struct Random(ChaCha8Rng);

impl Random {
    /// In [-half, half).
    fn uniform(&mut self, half: f64) -> f64 {
        half * (2.0 * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 1.0)
    }

    fn vector(&mut self, half: f64) -> Vector3<f64> {
        Vector3::new(self.uniform(half), self.uniform(half), self.uniform(half))
    }
}

/// A strip: a rig of `sensors` moves along x, 0.3 m a frame, over a sea bed 3 m below; each point is seen from `track`
/// consecutive frames, with noise of up to half a pixel, and starts up to 1 cm off.
fn strip(frames: usize, sensors: usize, points: usize, track: usize, free_cameras: bool) -> Problem {
    let mut random = Random(ChaCha8Rng::seed_from_u64(1));
    let mut problem = Problem::default();
    let camera = Camera::new(CameraModel::OpenCv, 1920, 1080, &[1400.0, 1400.0, 960.0, 540.0, -0.1, 0.03, 0.001, 0.0]).expect("valid");
    for s in 0..sensors {
        let pose = Rigid3::new(UnitQuaternion::identity(), Vector3::new(0.0, -0.2 * s as f64, 0.0));
        problem.sensors.push(PoseBlock { free: s > 0 && free_cameras, ..PoseBlock::fixed(pose) });
        let mut block = CameraBlock::fixed(camera);
        block.free[..6].fill(free_cameras);
        problem.cameras.push(block);
        if s > 0 {
            problem.baselines.push(Baseline { a: (0, 0), b: (0, s as u32), length: 0.2 * s as f64, sigma: 0.001 });
        }
    }
    for f in 0..frames {
        let rotation = UnitQuaternion::from_scaled_axis(random.vector(0.05));
        problem.frames.push(PoseBlock::free(Rigid3::new(rotation, -(rotation * Vector3::new(0.3 * f as f64, 0.0, 0.0)))));
    }
    for p in 0..points {
        let first = p * (frames - track + 1) / points;
        let middle = 0.3 * (first as f64 + (track as f64 - 1.0) / 2.0);
        let xyz = Vector3::new(middle + random.uniform(0.5), random.uniform(0.8), 3.0 + random.uniform(0.5));
        for f in first..first + track {
            for s in 0..sensors {
                let x_in_cam = (problem.sensors[s].pose * problem.frames[f].pose).apply(&xyz);
                if let Some(pixel) = camera.project(&x_in_cam) {
                    let pixel = pixel + Vector2::new(random.uniform(0.5), random.uniform(0.5));
                    let (frame, sensor, camera) = (f as u32, s as u32, s as u32);
                    problem.observations.push(ImageObservation { frame, sensor, camera, point: p as u32, pixel, sigma_px: 1.0 });
                }
            }
        }
        problem.points.push(PointBlock { xyz: xyz + random.vector(0.01), free: true });
    }
    problem
}

fn benchmark(c: &mut Criterion) {
    let mut group = c.benchmark_group("adjust");
    group.sample_size(10);
    let cauchy = AdjustOptions { loss: Loss::Cauchy { scale_px: 1.0 }, ..AdjustOptions::default() };
    let mut local = strip(8, 1, 500, 4, false);
    local.frames[0].free = false;
    local.frames[1].free = false;
    let mut one_pose = strip(4, 1, 300, 4, false);
    one_pose.points.iter_mut().for_each(|p| p.free = false);
    one_pose.frames[1..].iter_mut().for_each(|f| f.free = false);
    let problems = [
        ("one pose, 300 points", one_pose),
        ("local, 8 frames, 2,000 observations", local),
        ("rig of 2, 50 frames, 20,000 observations", strip(50, 2, 2000, 5, true)),
        ("300 frames, 234,000 observations", strip(300, 1, 39_000, 6, true)),
    ];
    for (name, problem) in problems {
        group.bench_function(name, |b| {
            b.iter_batched(|| problem.clone(), |mut p| black_box(adjust(&mut p, &cauchy).expect("valid")), BatchSize::LargeInput);
        });
    }
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
