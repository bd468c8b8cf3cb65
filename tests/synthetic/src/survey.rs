//! Geometry without pictures: a rig above an uneven sea bed.

use crate::random::Random;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use scene::{
    Camera, CameraId, CameraModel, Frame, FrameId, Image, ImageId, KeypointIndex, Observation, PairConfiguration, Point, Reconstruction,
    Rig, RigId, RigSensor, Rigid3, Scale, VerifiedPair,
};

/// Length of the part of the sea bed that is there twice, metres.
pub const LOOK_ALIKE_LENGTH_M: f64 = 2.0;

/// What to make.
#[derive(Clone, Debug)]
pub struct SurveyOptions {
    /// Simultaneous exposures along the path.
    pub exposures: usize,
    /// Cameras of the rig.
    pub cameras: usize,
    /// Scene points.
    pub points: usize,
    /// Distance between neighbouring cameras of the rig, metres.
    pub baseline_m: f64,
    /// Way of the rig from one exposure to the next, metres; it flies 3 m above the sea bed.
    pub step_m: f64,
    /// How much lower the rig is from one exposure to the next, metres: motion along the optical axis.
    pub descent_m: f64,
    /// Interior orientation of all cameras.
    pub camera: Camera,
    /// Standard deviation of keypoint positions, pixels.
    pub noise_px: f64,
    /// Wrong matches added to each pair, as a share of the right ones.
    pub outlier_share: f64,
    /// Fewest matches of a pair.
    pub min_matches: usize,
    /// Height of the relief, as a share of the usual one; 0 makes the sea bed a plane.
    pub relief: f64,
    /// Standard deviation of the place of every camera but the first along each axis of the rig, from one exposure to
    /// the next, metres. Above 0 the truth holds a frame for each image, and no rig.
    pub mount_play_m: f64,
    /// Exposures that a camera missed: (exposure, camera).
    pub missed: Vec<(usize, usize)>,
    /// Way along the path, metres, after which what lies in its first [`LOOK_ALIKE_LENGTH_M`] is there once more, as sister
    /// ships or the legs of a jetty are. Matches take the two for one wherever they can.
    pub look_alike_m: Option<f64>,
    /// Seed.
    pub seed: u64,
}

impl Default for SurveyOptions {
    fn default() -> Self {
        let camera = Camera::new(CameraModel::SimpleRadial, 960, 600, &[800.0, 480.0, 300.0, -0.05]).expect("a valid camera");
        Self {
            exposures: 12,
            cameras: 1,
            points: 2000,
            baseline_m: 0.5,
            step_m: 0.6,
            descent_m: 0.0,
            camera,
            noise_px: 0.0,
            outlier_share: 0.0,
            min_matches: 30,
            relief: 1.0,
            mount_play_m: 0.0,
            missed: Vec::new(),
            look_alike_m: None,
            seed: 0,
        }
    }
}

/// A survey: its truth, and what an orientation gets to see.
#[derive(Clone, Debug)]
pub struct Survey {
    /// True poses, points and tracks; its keypoints carry the noise. One frame an exposure.
    pub truth: Reconstruction,
    /// Matches between the keypoints, right and wrong ones.
    pub pairs: Vec<VerifiedPair>,
}

/// Makes a survey.
///
/// # Panics
/// When the options ask for no camera.
#[must_use]
pub fn survey(options: &SurveyOptions) -> Survey {
    assert!(options.cameras > 0, "a survey needs a camera");
    let mut random = Random::new(options.seed);
    let mount: Vec<Rigid3> = (0..options.cameras).map(|c| cam_from_rig(options, c)).collect();
    let single = options.mount_play_m > 0.0;
    let rigs = if single {
        (0..options.cameras).map(|c| Rig::single(CameraId::new(c))).collect()
    } else {
        vec![Rig {
            sensors: (0..).map(CameraId::new).zip(&mount).map(|(camera, &cam_from_rig)| RigSensor { camera, cam_from_rig }).collect(),
        }]
    };
    let (mut frames, mut images) = (Vec::new(), Vec::new());
    for e in 0..options.exposures {
        let pose = rig_from_world(options, e, &mut random);
        if !single {
            frames.push(Frame { rig: RigId(0), exposure: e as u32, rig_from_world: Some(pose) });
        }
        for (c, &mounted) in mount.iter().enumerate() {
            let play = if single && c > 0 { normal3(&mut random) * options.mount_play_m } else { Vector3::zeros() };
            if options.missed.contains(&(e, c)) {
                continue;
            }
            if single {
                let cam_from_rig = Rigid3::new(mounted.rotation, mounted.translation - mounted.rotation * play);
                frames.push(Frame { rig: RigId::new(c), exposure: e as u32, rig_from_world: Some(cam_from_rig * pose) });
            }
            images.push(Image { name: format!("C{}/{e:04}.png", c + 1), camera: CameraId::new(c), frame: FrameId::new(frames.len() - 1) });
        }
    }
    let mut truth = Reconstruction {
        cameras: vec![options.camera; options.cameras],
        rigs,
        frames,
        keypoints: vec![Vec::new(); images.len()],
        images,
        points: Vec::new(),
        scale: Scale::Metric,
    };
    scatter(&mut truth, options, &mut random);
    let twins = repeat(&mut truth, options, &mut random);
    let pairs = matches(&mut truth, &twins, options, &mut random);
    Survey { truth, pairs }
}

/// Cameras side by side, each a little turned against the first.
fn cam_from_rig(options: &SurveyOptions, camera: usize) -> Rigid3 {
    if camera == 0 {
        return Rigid3::identity();
    }
    let rotation = UnitQuaternion::from_euler_angles(0.01 * camera as f64, -0.03 * camera as f64, 0.005);
    let centre = Vector3::new(options.baseline_m * camera as f64, 0.01, -0.02);
    Rigid3::new(rotation, -(rotation * centre))
}

/// Along x with a gentle bend, looking down and a little ahead, with the unrest of a vehicle. World: z up.
fn rig_from_world(options: &SurveyOptions, exposure: usize, random: &mut Random) -> Rigid3 {
    let along = options.step_m * exposure as f64;
    let height = 3.0 + 0.2 * (along * 0.7).cos() - options.descent_m * exposure as f64;
    let centre = Vector3::new(along, 0.5 * (along * 0.3).sin(), height);
    // Columns: x right (-y of the world), y backwards, z down.
    let down = Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let tilt = Rotation3::from_euler_angles(0.25 + 0.05 * random.normal(), 0.05 * random.normal(), 0.1 * random.normal());
    let rotation = UnitQuaternion::from_rotation_matrix(&(tilt * Rotation3::from_matrix_unchecked(down)));
    Rigid3::new(rotation, -(rotation * centre))
}

fn normal3(random: &mut Random) -> Vector3<f64> {
    Vector3::new(random.normal(), random.normal(), random.normal())
}

fn scatter(truth: &mut Reconstruction, options: &SurveyOptions, random: &mut Random) {
    let length = options.step_m * options.exposures as f64;
    for _ in 0..options.points {
        let (x, y) = (random.range(-3.0, length + 4.0), random.range(-3.0, 3.0));
        let height = 0.4 * (0.9 * x).sin() + 0.3 * (1.3 * y).cos() + 0.1 * random.normal();
        show(truth, Vector3::new(x, y, options.relief * height), options, random);
    }
}

/// Adds a point, and a keypoint wherever it is seen.
fn show(truth: &mut Reconstruction, xyz: Vector3<f64>, options: &SurveyOptions, random: &mut Random) {
    let mut track = Vec::new();
    for i in 0..truth.images.len() {
        let image = ImageId::new(i);
        let Some(pose) = truth.cam_from_world(image) else { continue };
        let Some(pixel) = options.camera.project(&pose.apply(&xyz)) else { continue };
        let seen = pixel + Vector2::new(random.normal(), random.normal()) * options.noise_px;
        let inside = |v: f64, size: u32| v >= 0.0 && v < f64::from(size);
        if inside(seen.x, options.camera.width()) && inside(seen.y, options.camera.height()) {
            track.push(Observation { image, keypoint: KeypointIndex::new(truth.keypoints[i].len()) });
            truth.keypoints[i].push([seen.x as f32, seen.y as f32]);
        }
    }
    truth.points.push(Point { xyz, colour: [128; 3], error_px: 0.0, track });
}

/// Adds what is there once more; returns which points look the same.
fn repeat(truth: &mut Reconstruction, options: &SurveyOptions, random: &mut Random) -> Vec<(usize, usize)> {
    let Some(way) = options.look_alike_m else { return Vec::new() };
    let mut twins = Vec::new();
    for p in 0..truth.points.len() {
        let xyz = truth.points[p].xyz;
        if (0.0..LOOK_ALIKE_LENGTH_M).contains(&xyz.x) {
            twins.push((p, truth.points.len()));
            show(truth, xyz + Vector3::x() * way, options, random);
        }
    }
    twins
}

fn matches(truth: &mut Reconstruction, twins: &[(usize, usize)], options: &SurveyOptions, random: &mut Random) -> Vec<VerifiedPair> {
    let count = truth.images.len();
    let mut found = vec![Vec::new(); count * count];
    for point in &truth.points {
        for (i, a) in point.track.iter().enumerate() {
            for b in &point.track[i + 1..] {
                found[a.image.index() * count + b.image.index()].push((a.keypoint, b.keypoint));
            }
        }
    }
    for &(p, q) in twins {
        let sees = |track: &[Observation], image| track.iter().any(|o| o.image == image);
        let (one, other) = (&truth.points[p].track, &truth.points[q].track);
        // An image that sees both tells them apart.
        for a in one.iter().filter(|a| !sees(other, a.image)) {
            for b in other.iter().filter(|b| !sees(one, b.image)) {
                let (a, b) = if a.image < b.image { (a, b) } else { (b, a) };
                found[a.image.index() * count + b.image.index()].push((a.keypoint, b.keypoint));
            }
        }
    }
    let mut pairs = Vec::new();
    for a in 0..count {
        for b in a + 1..count {
            let mut matches = std::mem::take(&mut found[a * count + b]);
            if matches.len() < options.min_matches {
                continue;
            }
            for _ in 0..(matches.len() as f64 * options.outlier_share) as usize {
                let mut stray = |image: usize| {
                    let (width, height) = (f64::from(options.camera.width()), f64::from(options.camera.height()));
                    truth.keypoints[image].push([random.range(0.0, width) as f32, random.range(0.0, height) as f32]);
                    KeypointIndex::new(truth.keypoints[image].len() - 1)
                };
                matches.push((stray(a), stray(b)));
            }
            matches.sort_unstable();
            let images = (ImageId::new(a), ImageId::new(b));
            let Some(essential) = essential(truth, images) else { continue };
            pairs.push(VerifiedPair { images, matches, configuration: PairConfiguration::Calibrated { essential }, homography_inliers: 0 });
        }
    }
    pairs
}

/// `[t]x R` of the second camera from the first.
fn essential(truth: &Reconstruction, (a, b): (ImageId, ImageId)) -> Option<Matrix3<f64>> {
    let b_from_a = truth.cam_from_world(b)? * truth.cam_from_world(a)?.inverse();
    Some(b_from_a.translation.cross_matrix() * b_from_a.rotation_matrix())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_noise_every_observation_is_where_its_point_projects() {
        let made = survey(&SurveyOptions { cameras: 2, exposures: 4, points: 300, ..SurveyOptions::default() });
        let observations = made.truth.observation_count();
        assert!(observations > 300, "{observations}");
        // Keypoints are stored as f32: half a unit in the last place of 960 is 3e-5.
        assert!(made.truth.reprojection_rms() < 1e-4, "{}", made.truth.reprojection_rms());
        assert!(made.pairs.len() > 10, "{}", made.pairs.len());
    }

    #[test]
    fn the_same_seed_gives_the_same_survey() {
        let options = SurveyOptions { noise_px: 0.5, outlier_share: 0.3, exposures: 4, points: 200, ..SurveyOptions::default() };
        assert_eq!(survey(&options).truth, survey(&options).truth);
        let other = SurveyOptions { seed: 1, ..options.clone() };
        assert_ne!(survey(&options).truth, survey(&other).truth);
    }

    #[test]
    fn noise_and_wrong_matches_are_as_many_as_asked_for() {
        let clean = SurveyOptions { exposures: 4, points: 1000, ..SurveyOptions::default() };
        let made = survey(&SurveyOptions { noise_px: 0.5, outlier_share: 0.25, ..clean.clone() });
        // Noise along x and y: the root mean square distance is sqrt 2 of it, to 5 % with some thousand observations.
        let expected = 0.5 * 2f64.sqrt();
        assert!((made.truth.reprojection_rms() / expected - 1.0).abs() < 0.05, "{}", made.truth.reprojection_rms());
        let mut shown = made.truth.keypoints.iter().map(|k| vec![false; k.len()]).collect::<Vec<_>>();
        for o in made.truth.points.iter().flat_map(|p| &p.track) {
            shown[o.image.index()][o.keypoint.index()] = true;
        }
        for pair in &made.pairs {
            let right = pair.matches.iter().filter(|(a, _)| shown[pair.images.0.index()][a.index()]).count();
            assert_eq!(pair.matches.len() - right, right / 4);
        }
    }

    #[test]
    fn play_in_the_mount_is_as_large_as_asked_for() {
        let options = SurveyOptions { cameras: 2, exposures: 400, points: 0, mount_play_m: 0.01, ..SurveyOptions::default() };
        let truth = survey(&options).truth;
        assert_eq!(truth.frames.len(), truth.images.len());
        let centre = |i: usize| truth.cam_from_world(ImageId::new(i)).expect("oriented").centre();
        let lengths: Vec<f64> = (0..400).map(|e| (centre(2 * e) - centre(2 * e + 1)).norm()).collect();
        let mean = lengths.iter().sum::<f64>() / 400.0;
        let deviation = (lengths.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        // The standard error of a standard deviation from 400 values is 1 / sqrt(800) = 3.5 % of it: four of them.
        assert!((deviation / 0.01 - 1.0).abs() < 0.14, "{deviation}");
    }

    #[test]
    fn a_missed_exposure_takes_only_its_own_image() {
        let options = SurveyOptions { cameras: 2, exposures: 3, points: 50, ..SurveyOptions::default() };
        let missed = survey(&SurveyOptions { missed: vec![(1, 1)], ..options.clone() }).truth;
        let names: Vec<&str> = missed.images.iter().map(|i| i.name.as_str()).collect();
        assert_eq!(names, ["C1/0000.png", "C2/0000.png", "C1/0001.png", "C1/0002.png", "C2/0002.png"]);
        assert_eq!(missed.frames, survey(&options).truth.frames);
    }

    #[test]
    fn places_that_look_alike_are_matched_with_each_other() {
        let apart = SurveyOptions { exposures: 14, ..SurveyOptions::default() };
        let alike = SurveyOptions { look_alike_m: Some(5.0), ..apart.clone() };
        let far = |options: &SurveyOptions| survey(options).pairs.iter().filter(|p| p.images.1.0 - p.images.0.0 > 6).count();
        assert_eq!(far(&apart), 0);
        assert!(far(&alike) > 2, "{}", far(&alike));
    }

    #[test]
    fn right_matches_satisfy_the_epipolar_constraint() {
        let made = survey(&SurveyOptions { exposures: 4, points: 300, ..SurveyOptions::default() });
        for pair in &made.pairs {
            let PairConfiguration::Calibrated { essential } = &pair.configuration else { panic!("calibrated") };
            for &(a, b) in &pair.matches {
                let ray = |image: ImageId, k: KeypointIndex| {
                    let pixel = made.truth.pixel(Observation { image, keypoint: k });
                    made.truth.cameras[0].unproject(&pixel).expect("inside").push(1.0)
                };
                let residual = (ray(pair.images.1, b).transpose() * essential * ray(pair.images.0, a))[0];
                assert!(residual.abs() < 1e-6, "{residual}");
            }
        }
    }
}
