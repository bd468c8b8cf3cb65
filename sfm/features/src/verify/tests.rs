//! Verification against planted truth.

use super::{ImageForPair, PairVerdict, Rejection, VerifyOptions, verify_pair};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use scene::{Camera, CameraModel, Features, ImageId, Keypoint, KeypointIndex, PairConfiguration, Rigid3, VerifiedPair};
use solve::relative::{essential_from_pose, sampson_squared};
use std::f32::consts::TAU;
use synthetic::Random;

/// A pair of images with planted matches: keypoint i of one belongs to keypoint i of the other.
struct Planted {
    camera: Camera,
    features: [Features; 2],
    cam2_from_cam1: Rigid3,
}

const FOCAL_PX: f64 = 1000.0;

fn camera(focal_px: f64) -> Camera {
    Camera::from_focal(CameraModel::Pinhole, 1360, 1024, focal_px).expect("a valid camera")
}

fn pose(angles: [f64; 3], t: [f64; 3]) -> Rigid3 {
    Rigid3::new(UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(angles[0], angles[1], angles[2])), Vector3::from(t))
}

impl Planted {
    fn new(cam2_from_cam1: Rigid3) -> Self {
        Self { camera: camera(FOCAL_PX), features: [Features::default(), Features::default()], cam2_from_cam1 }
    }

    fn push(&mut self, random: &mut Random, x: [Vector2<f64>; 2], turn: Option<f32>) {
        let first = random.range(-3.0, 3.0) as f32;
        let (anywhere, spread) = (random.range(-3.0, 3.0) as f32, 0.15 * random.normal() as f32);
        let second = turn.map_or(anywhere, |turn| first + turn + spread);
        for (features, (x, orientation)) in self.features.iter_mut().zip(x.into_iter().zip([first, second])) {
            let orientation = orientation.rem_euclid(TAU);
            features.keypoints.push(Keypoint { x: x.x as f32, y: x.y as f32, scale: 2.0, orientation });
        }
    }

    /// `n` points whose depths are `depth(x, y)` of their normalised coordinates, seen with noise.
    fn scene(mut self, random: &mut Random, n: usize, noise_px: f64, depth: impl Fn(&mut Random, f64, f64) -> f64) -> Self {
        let turn = self.cam2_from_cam1.rotation.euler_angles().2 as f32;
        let mut left = n;
        while left > 0 {
            let (x, y) = (random.range(-0.65, 0.65), random.range(-0.5, 0.5));
            let point = Vector3::new(x, y, 1.0) * depth(random, x, y);
            let (Some(a), Some(b)) = (self.camera.project(&point), self.camera.project(&self.cam2_from_cam1.apply(&point))) else {
                continue;
            };
            if (0.0..1360.0).contains(&b.x) && (0.0..1024.0).contains(&b.y) {
                let noise = Vector2::new(random.normal(), random.normal()) * noise_px;
                self.push(random, [a + noise, b - noise], Some(turn));
                left -= 1;
            }
        }
        self
    }

    fn noise(mut self, random: &mut Random, n: usize) -> Self {
        for _ in 0..n {
            let mut anywhere = || Vector2::new(random.range(0.0, 1360.0), random.range(0.0, 1024.0));
            let x = [anywhere(), anywhere()];
            self.push(random, x, None);
        }
        self
    }

    fn len(&self) -> usize {
        self.features[0].keypoints.len()
    }

    fn verify_with(&self, cameras: [&Camera; 2], known: bool, options: &VerifyOptions) -> PairVerdict {
        let image = |i: usize| ImageForPair { id: ImageId(i as u32), camera: cameras[i], camera_known: known, features: &self.features[i] };
        let tentative: Vec<_> = (0..self.len() as u32).map(|i| (KeypointIndex(i), KeypointIndex(i))).collect();
        let verdict = verify_pair(&image(0), &image(1), &tentative, options);
        let swapped: Vec<_> = tentative.iter().rev().map(|&(i, j)| (j, i)).collect();
        assert_eq!(verify_pair(&image(1), &image(0), &swapped, options), verdict, "the order of the images does not matter");
        verdict
    }

    fn verify(&self, known: bool) -> PairVerdict {
        self.verify_with([&self.camera; 2], known, &VerifyOptions::default())
    }
}

fn verified(verdict: PairVerdict) -> VerifiedPair {
    let PairVerdict::Verified(pair) = verdict else { panic!("{verdict:?}") };
    assert!(pair.matches.windows(2).all(|w| w[0] < w[1]));
    pair
}

fn volume(random: &mut Random, _: f64, _: f64) -> f64 {
    random.range(3.0, 8.0)
}

/// Right and wrong matches among the inliers.
fn split(pair: &VerifiedPair, right: usize) -> (usize, usize) {
    let good = pair.matches.iter().filter(|m| m.0.index() < right).count();
    (good, pair.matches.len() - good)
}

#[test]
fn right_matches_stay_and_wrong_ones_go() {
    let mut random = Random::new(1);
    for (roll, right, wrong) in [(0.1, 400, 400), (3.0, 300, 600), (-1.5, 60, 200)] {
        let planted =
            Planted::new(pose([0.05, -0.1, roll], [0.8, 0.1, 0.1])).scene(&mut random, right, 0.7, volume).noise(&mut random, wrong);
        for known in [true, false] {
            let pair = verified(planted.verify(known));
            let (good, bad) = split(&pair, right);
            // 0.7 px of noise in each of four coordinates stay below 4 px; by chance, a wrong match is within 4 px of its epipolar line with
            // a probability of about 0.014.
            assert!(good >= right * 98 / 100 && bad <= 3 + wrong / 25, "{good} of {right}, {bad} of {wrong}");
            match pair.configuration {
                PairConfiguration::Calibrated { essential } => {
                    assert!(known);
                    let truth = essential_from_pose(&planted.cam2_from_cam1).normalize();
                    let essential = essential.normalize();
                    // A pixel is 0.001.
                    assert!((essential - truth).norm().min((essential + truth).norm()) < 0.01);
                }
                PairConfiguration::Uncalibrated { fundamental } => {
                    assert!(!known);
                    let pixel = |f: &Features, i: usize| Vector2::new(f64::from(f.keypoints[i].x), f64::from(f.keypoints[i].y));
                    let agrees =
                        |i: usize| sampson_squared(&fundamental, &pixel(&planted.features[0], i), &pixel(&planted.features[1], i)) < 16.0;
                    assert_eq!((0..planted.len()).filter(|&i| agrees(i)).count(), pair.matches.len());
                }
                PairConfiguration::PlanarOrPanoramic { .. } => panic!("{} of {}", pair.homography_inliers, pair.matches.len()),
            }
        }
    }
}

#[test]
fn planes_and_turns_are_told() {
    let mut random = Random::new(2);
    let tilted = |_: &mut Random, x: f64, y: f64| 4.0 / (1.0 + 0.3 * x - 0.2 * y);
    let plane = Planted::new(pose([0.05, -0.1, 0.1], [0.8, 0.1, 0.1])).scene(&mut random, 300, 0.5, tilted).noise(&mut random, 100);
    let turn = Planted::new(pose([0.1, -0.2, 0.1], [0.0; 3])).scene(&mut random, 300, 0.5, volume).noise(&mut random, 100);
    for planted in [plane, turn] {
        for known in [true, false] {
            let pair = verified(planted.verify(known));
            let PairConfiguration::PlanarOrPanoramic { homography } = pair.configuration else { panic!("{:?}", pair.configuration) };
            assert!(pair.homography_inliers >= 297, "{}", pair.homography_inliers);
            for i in 0..300 {
                let [a, b] = [0, 1].map(|k| planted.features[k].keypoints[i]);
                let mapped = homography * Vector3::new(f64::from(a.x), f64::from(a.y), 1.0);
                let error = (mapped.xy() / mapped.z - Vector2::new(f64::from(b.x), f64::from(b.y))).norm();
                assert!(error < 5.0, "{error}");
            }
        }
    }
}

#[test]
fn chance_is_rejected_at_any_size() {
    // 30 to 1000 matches, half of them turning alike; chance finds 15 to 40 that agree.
    let mut random = Random::new(3);
    for n in [5, 15, 30, 60, 120, 300, 1000] {
        let mut planted = Planted::new(Rigid3::identity()).noise(&mut random, n / 2);
        for _ in 0..n.div_ceil(2) {
            let mut anywhere = || Vector2::new(random.range(0.0, 1360.0), random.range(0.0, 1024.0));
            let x = [anywhere(), anywhere()];
            planted.push(&mut random, x, Some(0.0));
        }
        for known in [true, false] {
            let verdict = planted.verify(known);
            assert!(matches!(verdict, PairVerdict::Rejected(_)), "{n}: {verdict:?}");
            assert_eq!(matches!(verdict, PairVerdict::Rejected(Rejection::FewMatches { .. })), n < 15);
        }
    }
}

#[test]
fn a_wrong_focal_length_is_said() {
    let mut random = Random::new(4);
    let planted = Planted::new(pose([0.1, -0.3, 0.2], [0.8, 0.2, 0.5])).scene(&mut random, 500, 0.5, volume).noise(&mut random, 200);
    let wrong = camera(2.0 * FOCAL_PX);
    let pair = verified(planted.verify_with([&wrong, &wrong], true, &VerifyOptions::default()));
    assert!(matches!(pair.configuration, PairConfiguration::Uncalibrated { .. }), "{:?}", pair.configuration);
    assert!(split(&pair, 500).0 >= 490);
}

#[test]
fn what_moves_with_the_camera_does_not_count() {
    let mut random = Random::new(5);
    let still = |planted: &mut Planted, random: &mut Random, n: usize, y: [f64; 2]| {
        for _ in 0..n {
            let x = Vector2::new(random.range(0.0, 1360.0), random.range(y[0], y[1]));
            let jitter = Vector2::new(random.normal(), random.normal()) * 0.3;
            planted.push(random, [x, x + jitter], Some(0.0));
        }
    };
    // Alone, along the lower border.
    let mut frame = Planted::new(Rigid3::identity()).noise(&mut random, 30);
    still(&mut frame, &mut random, 80, [900.0, 1024.0]);
    assert!(matches!(frame.verify(false), PairVerdict::Rejected(Rejection::Still { still: 80.., .. })));
    // More of it than of a scene that turns.
    let mut arm = Planted::new(pose([0.05, -0.2, 0.1], [0.8, 0.1, 0.1])).scene(&mut random, 100, 0.5, volume);
    still(&mut arm, &mut random, 150, [700.0, 1024.0]);
    for known in [true, false] {
        let pair = verified(arm.verify(known));
        assert!(split(&pair, 100).0 >= 98 && split(&pair, 100).1 < 15, "{:?}", split(&pair, 100));
        assert!(!matches!(pair.configuration, PairConfiguration::PlanarOrPanoramic { .. }));
    }
    // The same view twice: all of it agrees, and says nothing about the position.
    let mut same = Planted::new(Rigid3::identity());
    still(&mut same, &mut random, 300, [0.0, 1024.0]);
    let pair = verified(same.verify(true));
    let PairConfiguration::PlanarOrPanoramic { homography } = pair.configuration else { panic!("{:?}", pair.configuration) };
    assert_eq!(pair.matches.len(), 300);
    let scaled = homography / homography[(2, 2)];
    assert!((scaled - Matrix3::identity()).abs().max() < 0.5, "{scaled}");
}

#[test]
fn impossible_input_is_no_panic() {
    let mut random = Random::new(6);
    let mut planted = Planted::new(pose([0.0, -0.1, 0.1], [0.8, 0.0, 0.1])).scene(&mut random, 100, 0.5, volume);
    planted.features[0].keypoints[3].x = f32::NAN;
    planted.features[1].keypoints[4].orientation = f32::INFINITY;
    let image =
        |i: usize| ImageForPair { id: ImageId(i as u32), camera: &planted.camera, camera_known: true, features: &planted.features[i] };
    let beyond: Vec<_> = (0..200).map(|i| (KeypointIndex(i), KeypointIndex(i))).collect();
    let pair = verified(verify_pair(&image(0), &image(1), &beyond, &VerifyOptions::default()));
    assert!(pair.matches.len() >= 97 && pair.matches.len() <= 99);
    let nothing = VerifyOptions { max_error_px: f64::NAN, confidence: f64::NAN, max_iterations: 0, ..VerifyOptions::default() };
    assert!(matches!(verify_pair(&image(0), &image(1), &beyond, &nothing), PairVerdict::Rejected(_)));
    let none = VerifyOptions { min_inliers: 0, ..VerifyOptions::default() };
    assert!(matches!(verify_pair(&image(0), &image(1), &[], &none), PairVerdict::Rejected(_)));
    assert!(matches!(verify_pair(&image(0), &image(1), &beyond[..3], &none), PairVerdict::Rejected(_)));
    let one_place = vec![(KeypointIndex(0), KeypointIndex(0)); 50];
    assert!(matches!(verify_pair(&image(0), &image(1), &one_place, &none), PairVerdict::Rejected(_)));
}
