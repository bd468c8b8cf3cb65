//! Interior orientation from synthetic pairs of a known camera.

use super::{InteriorEstimate, PairForInterior, interior_from_pairs};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use scene::{Camera, CameraModel, ImageId, Keypoint, KeypointIndex, PairConfiguration, Rigid3, VerifiedPair};
use synthetic::Random;

const SIZE: (u32, u32) = (1920, 1080);
const NOISE_PX: f64 = 0.5;
const ERROR_PX: f64 = 3.0;

fn camera(focal_px: f64, k: f64) -> Camera {
    Camera::new(CameraModel::SimpleRadial, SIZE.0, SIZE.1, &[focal_px, 960.0, 540.0, k]).expect("a valid camera")
}

/// Pairs of successive views of a cloud of points 4 to 9 away.
fn estimate(camera: &Camera, motion: impl Fn(&mut Random) -> Rigid3, thickness: f64) -> Option<InteriorEstimate> {
    let mut random = Random::new(7);
    let made: Vec<(VerifiedPair, [Vec<Keypoint>; 2])> = (0..12u32)
        .map(|i| {
            let cam2_from_cam1 = motion(&mut random);
            let mut keypoints = [Vec::new(), Vec::new()];
            while keypoints[0].len() < 250 {
                let ray = Vector3::new(random.range(-0.7, 0.7), random.range(-0.4, 0.4), 1.0) * (1325.0 / camera.mean_focal());
                let x = Vector3::new(ray.x, ray.y, 1.0) * (6.0 + thickness * random.range(-2.5, 2.5));
                let seen = [camera.project(&x), camera.project(&cam2_from_cam1.apply(&x))];
                let [Some(a), Some(b)] = seen else { continue };
                if [a, b].iter().all(|p| (0.0..1920.0).contains(&p.x) && (0.0..1080.0).contains(&p.y)) {
                    for (list, p) in keypoints.iter_mut().zip([a, b]) {
                        let [x, y] = [p.x, p.y].map(|v| (v + NOISE_PX * random.normal()) as f32);
                        list.push(Keypoint { x, y, scale: 2.0, orientation: 0.0 });
                    }
                }
            }
            let pair = VerifiedPair {
                images: (ImageId(i), ImageId(i + 1)),
                matches: (0..250).map(|k| (KeypointIndex(k), KeypointIndex(k))).collect(),
                configuration: PairConfiguration::Uncalibrated { fundamental: nalgebra::Matrix3::zeros() },
                homography_inliers: 60,
            };
            (pair, keypoints)
        })
        .collect();
    let pairs: Vec<_> = made.iter().map(|(pair, [a, b])| PairForInterior { pair, keypoints: (a, b) }).collect();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let found = one.install(|| interior_from_pairs(&pairs, SIZE, ERROR_PX, 3));
    assert_eq!(found, two.install(|| interior_from_pairs(&pairs, SIZE, ERROR_PX, 3)));
    found
}

/// Sideways and turning about all axes, as a vehicle does that looks around.
fn survey(random: &mut Random) -> Rigid3 {
    let turn = Rotation3::from_euler_angles(0.15 * random.normal(), 0.2 * random.normal(), 0.2 * random.normal());
    Rigid3::new(
        UnitQuaternion::from_rotation_matrix(&turn),
        Vector3::new(random.range(0.5, 1.2), 0.3 * random.normal(), 0.3 * random.normal()),
    )
}

#[test]
fn focal_length_and_distortion_are_found() {
    // The reef, a house, a long lens: over the guess of 1.2 x 1920 = 2304 and under.
    for (focal_px, k) in [(1325.0, 0.34), (2000.0, -0.15), (3500.0, 0.0), (1100.0, 0.1)] {
        let found = estimate(&camera(focal_px, k), survey, 1.0).unwrap();
        let f = found.focal_px.unwrap_or_else(|| panic!("undecided at {focal_px}: {found:?}"));
        // Half a pixel in a disparity of some hundreds leaves 1 % of a pair; a division model is not quite the radial one.
        assert!((f / focal_px - 1.0).abs() < 0.03, "{f} instead of {focal_px}, {found:?}");
        let start = found.with_focal(CameraModel::SimpleRadial, f).unwrap();
        // In the corner, r = 1101 / f; the term of fifth order that the models do not share is what is left.
        assert!((start.params()[3] - k).abs() < 0.08, "{found:?} {:?}", start.params());
    }
}

#[test]
fn motions_that_say_nothing_leave_it_open() {
    let camera = camera(1325.0, 0.0);
    let sideways =
        |random: &mut Random| Rigid3::new(UnitQuaternion::identity(), Vector3::new(random.range(0.5, 1.2), 0.1 * random.normal(), 0.0));
    let forward = |random: &mut Random| Rigid3::new(UnitQuaternion::identity(), Vector3::new(0.02 * random.normal(), 0.0, -1.0));
    // About a point 6 in front of the camera: the axes meet there at equal distances.
    let around = |random: &mut Random| {
        let rotation = UnitQuaternion::from_euler_angles(0.0, random.range(0.15, 0.35), 0.0);
        let centre = Vector3::new(0.0, 0.0, 6.0);
        Rigid3::new(rotation, centre - rotation * centre)
    };
    let found =
        [estimate(&camera, sideways, 1.0), estimate(&camera, forward, 1.0), estimate(&camera, around, 1.0), estimate(&camera, survey, 0.0)];
    for (i, found) in found.into_iter().enumerate() {
        assert_eq!(found.unwrap().focal_px, None, "motion {i}: {found:?}");
        assert!(found.unwrap().distortion.abs() < 0.03, "motion {i}: {found:?}");
    }
}

#[test]
fn too_few_pairs_and_empty_images_say_nothing() {
    assert_eq!(interior_from_pairs(&[], SIZE, ERROR_PX, 0), None);
    assert_eq!(interior_from_pairs(&[], (0, 0), ERROR_PX, 0), None);
}
