//! Guided matching against planted truth and against the exhaustive scan.

use super::cells::Cells;
use super::motion::Motion;
use super::search::{Band, Where, search};
use super::{GuidedOptions, MatchImage, distance, match_pair};
use crate::matching::{MatchOptions, Nearest, match_descriptors};
use crate::verify::{PairVerdict, VerifyOptions, verify_pair};
use nalgebra::{Rotation3, UnitQuaternion, Vector2, Vector3};
use scene::{Camera, CameraModel, Descriptor, Features, ImageId, Keypoint, Rigid3, VerifiedPair};
use solve::relative::essential_from_pose;
use std::f32::consts::TAU;
use synthetic::Random;

const SIZE: (u32, u32) = (1360, 1024);

fn pose(roll: f64) -> Rigid3 {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(0.05, -0.1, roll));
    Rigid3::new(rotation, Vector3::new(0.5, 0.1, 0.1))
}

fn camera() -> Camera {
    Camera::from_focal(CameraModel::Pinhole, SIZE.0, SIZE.1, 1000.0).expect("a valid camera")
}

/// A descriptor about as long as a RootSIFT descriptor, and as unlike others.
fn descriptor(random: &mut Random) -> Descriptor {
    std::array::from_fn(|_| (55.0 * random.normal().abs()) as u8)
}

/// The same thing seen again: a quarter as far as another thing.
fn again(random: &mut Random, d: &Descriptor) -> Descriptor {
    d.map(|v| (f64::from(v) + 12.0 * random.normal()).clamp(0.0, 255.0) as u8)
}

fn push(features: &mut Features, x: Vector2<f64>, orientation: f64, d: Descriptor) {
    let orientation = (orientation as f32).rem_euclid(TAU);
    features.keypoints.push(Keypoint { x: x.x as f32, y: x.y as f32, scale: 2.0, orientation });
    features.descriptors.push(d);
}

/// Two images of `n` points 3 to 5 m away, then `clutter` keypoints each of which the other image has none; keypoint i of one belongs to
/// keypoint i of the other.
struct Planted {
    features: [Features; 2],
}

impl Planted {
    fn new(seed: u64, roll: f64, n: usize, clutter: usize) -> Self {
        let mut random = Random::new(seed);
        let (pose, camera) = (pose(roll), camera());
        let mut planted = Self { features: [Features::default(), Features::default()] };
        while planted.features[0].len() < n {
            let (x, y) = (random.range(-0.65, 0.65), random.range(-0.5, 0.5));
            // A bed with waves of half the relief, and stones on it.
            let depth = 4.0 + 0.5 * (7.0 * x).sin() + random.range(-0.5, 0.5);
            let point = Vector3::new(x, y, 1.0) * depth;
            let (Some(a), Some(b)) = (camera.project(&point), camera.project(&pose.apply(&point))) else { continue };
            if !((0.0..1360.0).contains(&b.x) && (0.0..1024.0).contains(&b.y)) {
                continue;
            }
            let mut noise = || Vector2::new(random.normal(), random.normal()) * 0.5;
            let (a, b) = (a + noise(), b + noise());
            let (turn, d) = (random.range(0.0, 6.2), descriptor(&mut random));
            push(&mut planted.features[0], a, turn, d);
            let other = again(&mut random, &d);
            push(&mut planted.features[1], b, turn + roll + 0.1 * random.normal(), other);
        }
        for _ in 0..clutter {
            for features in &mut planted.features {
                let x = Vector2::new(random.range(0.0, 1360.0), random.range(0.0, 1024.0));
                let d = descriptor(&mut random);
                push(features, x, random.range(0.0, 6.2), d);
            }
        }
        planted
    }

    fn images(&self) -> [MatchImage; 2] {
        [0, 1].map(|i| MatchImage::new(ImageId(i as u32), camera(), true, self.features[i].clone()))
    }

    fn guided(&self) -> VerifiedPair {
        let [a, b] = self.images();
        let options = (GuidedOptions::default(), MatchOptions::default(), VerifyOptions::default());
        let verdict = match_pair(&a, &b, &options.0, &options.1, &options.2);
        assert_eq!(match_pair(&b, &a, &options.0, &options.1, &options.2), verdict, "the order of the images does not matter");
        verified(verdict)
    }

    fn exhaustive(&self) -> PairVerdict {
        let [a, b] = self.images();
        let tentative = match_descriptors(&a.features().descriptors, &b.features().descriptors, &MatchOptions::default());
        verify_pair(&a.for_pair(), &b.for_pair(), &tentative, &VerifyOptions::default())
    }
}

fn verified(verdict: PairVerdict) -> VerifiedPair {
    let PairVerdict::Verified(pair) = verdict else { panic!("{verdict:?}") };
    pair
}

fn right(pair: &VerifiedPair, n: usize) -> usize {
    pair.matches.iter().filter(|m| m.0 == m.1 && m.0.index() < n).count()
}

#[test]
fn as_much_is_found_as_by_comparing_all_with_all() {
    for (seed, roll) in [(1, 0.05), (2, 1.6), (3, 3.1)] {
        let n = 2500;
        let planted = Planted::new(seed, roll, n, 1500);
        let (all, near) = (verified(planted.exhaustive()), planted.guided());
        let (of_all, of_near) = (right(&all, n), right(&near, n));
        assert!(of_all > n * 95 / 100, "{of_all}");
        // The window lacks some whose depth differs from that of all that agree about them.
        assert!(of_near >= of_all * 98 / 100, "{of_near} of {of_all}");
        assert!(near.matches.len() - of_near <= 10 + all.matches.len() - of_all, "{} wrong", near.matches.len() - of_near);
    }
}

#[test]
fn where_the_strongest_show_nothing_all_are_compared() {
    // 1,800 clutter keypoints come first in both images, then 400 that belong together.
    let mut planted = Planted::new(4, 0.1, 400, 1900);
    for features in &mut planted.features {
        features.keypoints.rotate_left(400);
        features.descriptors.rotate_left(400);
    }
    assert_eq!(PairVerdict::Verified(planted.guided()), planted.exhaustive());
}

#[test]
fn small_images_are_compared_as_ever() {
    let planted = Planted::new(5, 0.1, 400, 100);
    assert_eq!(PairVerdict::Verified(planted.guided()), planted.exhaustive());
}

#[test]
fn what_repeats_within_the_window_is_no_match() {
    // Each of the last 300 things stands twice in the second image, 5 px apart.
    let mut planted = Planted::new(6, 0.05, 1500, 0);
    let mut random = Random::new(7);
    for i in 1200..1500 {
        let keypoint = planted.features[1].keypoints[i];
        let d = again(&mut random, &planted.features[0].descriptors[i]);
        let x = Vector2::new(f64::from(keypoint.x) + 5.0, f64::from(keypoint.y));
        push(&mut planted.features[1], x, f64::from(keypoint.orientation), d);
    }
    let pair = planted.guided();
    let repeated = pair.matches.iter().filter(|m| m.0.index() >= 1200).count();
    assert!(right(&pair, 1200) >= 1150 && repeated <= 3, "{} and {repeated}", right(&pair, 1200));
}

#[test]
fn bad_keypoints_are_no_panic() {
    let mut planted = Planted::new(8, 0.1, 1000, 500);
    for (k, v) in [(3, f32::NAN), (4, f32::INFINITY), (5, -1e30), (6, 1e30)] {
        planted.features[0].keypoints[k].x = v;
        planted.features[1].keypoints[k + 10].y = v;
    }
    assert!(right(&planted.guided(), 1000) >= 950);
    let [a, _] = planted.images();
    let empty = MatchImage::new(ImageId(7), camera(), true, Features::default());
    let verdict = match_pair(&a, &empty, &GuidedOptions::default(), &MatchOptions::default(), &VerifyOptions::default());
    assert!(matches!(verdict, PairVerdict::Rejected(_)));
}

#[test]
fn a_search_finds_the_nearest_of_each_window() {
    let planted = Planted::new(9, 0.3, 300, 300);
    let [a, b] = [0, 1].map(|i| Cells::new(&planted.features[i], &camera(), true));
    let place = |f: &Features, k: usize| Vector2::new(f64::from(f.keypoints[k].x), f64::from(f.keypoints[k].y));
    let some = |i: usize| -> Vec<Vector2<f64>> { (0..60).map(|k| place(&planted.features[i], k)).collect() };
    let motion = || Motion::new(some(0), &some(1));
    let essential = essential_from_pose(&pose(0.3));
    for width in [None, Some(0.02)] {
        let band = width.map(|width| Band { essential, width });
        check_search(&planted, &a, &b, &Where { motion: motion(), band });
    }
}

/// Against the definition.
fn check_search(planted: &Planted, a: &Cells, b: &Cells, searched: &Where) {
    let place = |f: &Features, k: usize| Vector2::new(f64::from(f.keypoints[k].x), f64::from(f.keypoints[k].y));
    let in_band = |i: usize, j: usize| {
        let [x, y] = [(0, i), (1, j)].map(|(f, k)| camera().unproject(&place(&planted.features[f], k)).expect("in a pinhole image"));
        let distance = |band: &Band| {
            let line = band.essential * x.push(1.0);
            (line.dot(&y.push(1.0)) / line.xy().norm()).abs()
        };
        searched.band.as_ref().is_none_or(|band| distance(band) <= band.width)
    };
    // The definition: every keypoint of a cell with every keypoint of the cells that its window touches.
    let (mut of_a, mut of_b) = (vec![Vec::new(); a.keypoints.len()], vec![Vec::new(); b.keypoints.len()]);
    let mut compared = 0;
    for (column, row, members) in a.occupied() {
        let side = f64::from(a.side_px);
        let window = searched.motion.window(Vector2::new(column as f64 * side, row as f64 * side), side);
        for member in members {
            let i = a.keypoints[member] as usize;
            let at = place(&planted.features[0], i) / side;
            assert_eq!((at.x as usize, at.y as usize), (column, row));
            for j in 0..b.keypoints.len() {
                let at = place(&planted.features[1], j);
                let cell = |v: f64| (v / f64::from(b.side_px)).floor();
                if in_band(i, j) && (0..2).all(|k| cell(window.low[k]).max(0.0) <= cell(at[k]) && cell(at[k]) <= cell(window.high[k])) {
                    let (x, y) = (&planted.features[0].descriptors[i], &planted.features[1].descriptors[j]);
                    let d: u32 = x.iter().zip(y).map(|(&x, &y)| u32::from(x.abs_diff(y)).pow(2)).sum();
                    of_a[i].push((d, j as u32));
                    of_b[j].push((d, i as u32));
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 1000 && compared < 600 * 600 / 4, "{compared}");
    let two = |mut all: Vec<(u32, u32)>| {
        all.sort_unstable();
        let first = all.first().copied().unwrap_or((u32::MAX, u32::MAX));
        Nearest { distance: first.0, index: first.1, second: all.get(1).map_or(u32::MAX, |s| s.0) }
    };
    let expected: [Vec<Nearest>; 2] = [of_a, of_b].map(|all| all.into_iter().map(two).collect());
    for products in [distance::portable, distance::best()] {
        let found = search(a, b, searched, products);
        assert!(found.of_a == expected[0] && found.of_b == expected[1]);
    }
}

#[test]
fn matches_in_line_leave_size_and_direction() {
    let line: Vec<Vector2<f64>> = (0..20).map(|k| Vector2::new(100.0 + 10.0 * f64::from(k), 300.0)).collect();
    let moved: Vec<Vector2<f64>> = line.iter().map(|x| x + Vector2::new(40.0, -30.0)).collect();
    let window = Motion::new(line, &moved).window(Vector2::new(190.0, 440.0), 20.0);
    let centre = [0, 1].map(|k| 0.5 * (window.low[k] + window.high[k]));
    assert!((centre[0] - 240.0).abs() < 1e-9 && (centre[1] - 420.0).abs() < 1e-9, "{centre:?}");
    let one = Vector2::new(5.0, 6.0);
    let window = Motion::new(vec![one], &[one]).window(Vector2::new(0.0, 0.0), 10.0);
    assert!(window.low[0] < 5.0 && window.high[0] > 5.0);
}
