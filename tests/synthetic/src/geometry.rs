//! Surveys of any size without rendering: cameras, rig, path, points, tracks.

use crate::dive::{DiveCamera, DiveOptions, Preset, dive_cameras};
use crate::motion::{Motion, MotionOptions};
use crate::random::{Random, mix};
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use scene::{
    Camera, CameraId, Frame, FrameId, Image, ImageId, KeypointIndex, Observation, Point, Reconstruction, Rig, RigId, RigSensor, Rigid3,
    Scale,
};
use serde::{Deserialize, Serialize};

/// Half the side and the height of the block that is surveyed, metres: a reef's hull.
const BLOCK_M: [f64; 2] = [1.5, 3.0];
/// What is further away is not seen through water, metres.
const SIGHT_M: f64 = 9.0;
/// Points of a piece of work: pieces do not depend on the number of threads.
const PIECE: usize = 4096;
/// Draws for one point before a piece gives up: a path that sees nothing would never end.
const PATIENCE: usize = 400;

/// A survey to make. Cameras and mounting are those of [`DiveOptions::preset`]'s survey, as calibrated in the water.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeometryOptions {
    /// Path and number of exposures.
    pub motion: MotionOptions,
    /// Cameras of the rig, 1 to 3: two look forward, one backward and down.
    pub cameras: usize,
    /// Scene points.
    pub points: usize,
    /// Mean and largest number of images that a point is observed in.
    pub track_length: [f64; 2],
    /// Exposures before and after the one that a point is first seen in, in which it may be observed again.
    pub overlap: usize,
    /// Share of points that may be observed in any exposure: what closes loops.
    pub revisited_share: f64,
    /// Share of observations at a wrong place.
    pub outlier_share: f64,
    /// Standard deviation of the observations, pixels.
    pub noise_px: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for GeometryOptions {
    fn default() -> Self {
        Self {
            motion: MotionOptions { frames: 20, arc_deg: 120.0, ..MotionOptions::default() },
            cameras: 3,
            points: 2000,
            track_length: [5.0, 24.0],
            overlap: 6,
            revisited_share: 0.2,
            outlier_share: 0.0,
            noise_px: 0.0,
            seed: 1,
        }
    }
}

impl GeometryOptions {
    /// A survey as large as that of Rofallski et al. 2020: 1,582 exposures of three cameras, 1.6 million points, about 8 million
    /// observations, of which 2 % are wrong.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            motion: MotionOptions { frames: 1582, arc_deg: 360.0 * 8.0, height_m: [0.8, 3.6], ..MotionOptions::default() },
            points: 1_600_000,
            track_length: [5.25, 24.0],
            overlap: 10,
            noise_px: 1.0,
            outlier_share: 0.02,
            ..Self::default()
        }
    }
}

/// The distance of two cameras of one exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameBaseline {
    /// The two images.
    pub images: [ImageId; 2],
    /// True distance of their projection centres, metres.
    pub length_m: f64,
}

/// A survey.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// True poses, points and tracks; its keypoints carry noise and outliers.
    pub truth: Reconstruction,
    /// The observations at wrong places, sorted.
    pub outliers: Vec<Observation>,
    /// The distances between the cameras of every exposure.
    pub baselines: Vec<FrameBaseline>,
}

/// A point and where it is seen: image, pixel, whether the place is wrong.
struct Drawn {
    xyz: Vector3<f64>,
    seen: Vec<(u32, [f32; 2], bool)>,
}

/// What points are drawn from.
struct Survey<'a> {
    options: &'a GeometryOptions,
    cameras: Vec<Camera>,
    /// Pose and projection centre of each image; those of an exposure follow each other.
    poses: Vec<(Rigid3, Vector3<f64>)>,
}

/// Makes a survey. The same options give the same bytes, on any number of threads. Fewer points come out where the path sees none.
///
/// # Errors
/// When the cameras are none or more than three.
pub fn geometry(options: &GeometryOptions) -> Result<Geometry, String> {
    if !(1..=3).contains(&options.cameras) {
        return Err(format!("cameras = {} must be from 1 to 3", options.cameras));
    }
    options.motion.check()?;
    let mut dive = DiveOptions::preset(Preset::Survey);
    dive.rig.cameras.truncate(options.cameras);
    let cameras = dive_cameras(&dive, options.motion.radius_m - BLOCK_M[0])?;
    let motion = Motion::new(&options.motion, Vector3::new(0.0, 0.0, 1.2));
    let mut truth = skeleton(&cameras, &motion, options.motion.frames);
    let poses = (0..truth.images.len())
        .map(|i| truth.cam_from_world(ImageId::new(i)).map(|pose| (pose, pose.centre())))
        .collect::<Option<Vec<_>>>()
        .ok_or("every exposure has a pose")?;
    let survey = Survey { options, cameras: truth.cameras.clone(), poses };
    let pieces: Vec<Vec<Drawn>> = (0..options.points.div_ceil(PIECE)).into_par_iter().map(|piece| survey.piece(piece)).collect();
    let outliers = gather(&mut truth, pieces);
    let baselines = baselines(&truth);
    Ok(Geometry { truth, outliers, baselines })
}

fn skeleton(cameras: &[DiveCamera], motion: &Motion, exposures: usize) -> Reconstruction {
    let sensors = cameras.iter().enumerate();
    let rig =
        Rig { sensors: sensors.map(|(c, camera)| RigSensor { camera: CameraId::new(c), cam_from_rig: camera.cam_from_rig }).collect() };
    let frames = (0..exposures)
        .map(|e| Frame { rig: RigId(0), exposure: e as u32, rig_from_world: Some(motion.rig_from_world(motion.frame_time_s(e))) })
        .collect();
    let shots = (0..exposures).flat_map(|e| (0..cameras.len()).map(move |c| (c, e)));
    let images: Vec<Image> =
        shots.map(|(c, e)| Image { name: format!("C{}/{e:04}.png", c + 1), camera: CameraId::new(c), frame: FrameId::new(e) }).collect();
    Reconstruction {
        cameras: cameras.iter().map(|camera| camera.calibrated.camera).collect(),
        rigs: vec![rig],
        frames,
        keypoints: vec![Vec::new(); images.len()],
        images,
        points: Vec::new(),
        scale: Scale::Metric,
    }
}

/// Moves the points of all pieces into a reconstruction; returns the outliers.
fn gather(truth: &mut Reconstruction, pieces: Vec<Vec<Drawn>>) -> Vec<Observation> {
    let mut outliers = Vec::new();
    truth.points.reserve_exact(pieces.iter().map(Vec::len).sum());
    for drawn in pieces.into_iter().flatten() {
        let mut track = Vec::with_capacity(drawn.seen.len());
        for (image, pixel, wrong) in drawn.seen {
            let keypoints = &mut truth.keypoints[image as usize];
            let observation = Observation { image: ImageId(image), keypoint: KeypointIndex::new(keypoints.len()) };
            keypoints.push(pixel);
            track.push(observation);
            if wrong {
                outliers.push(observation);
            }
        }
        truth.points.push(Point { xyz: drawn.xyz, colour: [128; 3], error_px: 0.0, track });
    }
    outliers.sort_unstable();
    outliers
}

fn baselines(truth: &Reconstruction) -> Vec<FrameBaseline> {
    let cameras = truth.cameras.len();
    let centres: Vec<Vector3<f64>> = truth.rigs[0].sensors.iter().map(|s| s.cam_from_rig.centre()).collect();
    let pairs = (1..cameras).flat_map(|b| (0..b).map(move |a| (a, b)));
    let pairs: Vec<(usize, usize)> = pairs.collect();
    (0..truth.frames.len())
        .flat_map(|e| {
            pairs.iter().map({
                let centres = &centres;
                move |&(a, b)| FrameBaseline {
                    images: [a, b].map(|c| ImageId::new(e * cameras + c)),
                    length_m: (centres[a] - centres[b]).norm(),
                }
            })
        })
        .collect()
}

impl Survey<'_> {
    fn piece(&self, piece: usize) -> Vec<Drawn> {
        let mut random = Random::new(mix(self.options.seed ^ mix(piece as u64 + 1)));
        let count = PIECE.min(self.options.points - piece * PIECE);
        let mut points = Vec::with_capacity(count);
        for _ in 0..count * PATIENCE {
            if points.len() == count {
                break;
            }
            points.extend(self.draw(&mut random));
        }
        points
    }

    /// A point in front of a random image, and its observations; `None` where there is nothing, or fewer than two images see it.
    fn draw(&self, random: &mut Random) -> Option<Drawn> {
        let first = random.index(self.poses.len());
        let camera = &self.cameras[first % self.cameras.len()];
        let pixel = Vector2::new(random.range(0.0, f64::from(camera.width())), random.range(0.0, f64::from(camera.height())));
        let (pose, centre) = &self.poses[first];
        let direction = pose.rotation.inverse() * camera.ray(&pixel)?.normalize();
        let xyz = meet(centre, &direction).filter(|p| (p - centre).norm() < SIGHT_M)?;
        let [mean, most] = self.options.track_length;
        // Lengths from 2 on fall off geometrically.
        let length = (2.0 + ((1.0 - random.unit()).ln() / (1.0 - 1.0 / (mean - 1.0).max(1.001)).ln()).floor()).min(most) as usize;
        let mut seen = vec![(first as u32, self.observe(random, first, &pixel))];
        for image in self.candidates(random, first, length) {
            if seen.len() == length {
                break;
            }
            if seen.iter().any(|(other, _)| *other as usize == image) {
                continue;
            }
            if let Some(pixel) = self.sees(image, &xyz) {
                seen.push((image as u32, self.observe(random, image, &pixel)));
            }
        }
        if seen.len() < 2 {
            return None;
        }
        seen.sort_unstable_by_key(|(image, _)| *image);
        Some(Drawn { xyz, seen: seen.into_iter().map(|(image, (pixel, wrong))| (image, pixel, wrong)).collect() })
    }

    /// Images that may see a point too, in random order, more than needed.
    fn candidates(&self, random: &mut Random, first: usize, length: usize) -> Vec<usize> {
        let cameras = self.cameras.len();
        let (exposure, exposures) = (first / cameras, self.poses.len() / cameras);
        let (from, to) = if random.unit() < self.options.revisited_share {
            (0, exposures)
        } else {
            (exposure.saturating_sub(self.options.overlap), (exposure + self.options.overlap + 1).min(exposures))
        };
        (0..6 * length).map(|_| random.index((to - from) * cameras) + from * cameras).collect()
    }

    /// Where an image sees a point, unless the block hides it.
    fn sees(&self, image: usize, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        let (pose, centre) = &self.poses[image];
        let camera = &self.cameras[image % self.cameras.len()];
        let pixel = camera.project(&pose.apply(point))?;
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < f64::from(camera.width()) && pixel.y < f64::from(camera.height());
        let way = point - centre;
        let distance = way.norm();
        if !inside || distance > SIGHT_M {
            return None;
        }
        let nearest = meet(centre, &(way / distance))?;
        ((nearest - centre).norm() > distance - 1e-6).then_some(pixel)
    }

    /// A pixel with noise, or a wrong one.
    fn observe(&self, random: &mut Random, image: usize, pixel: &Vector2<f64>) -> ([f32; 2], bool) {
        let camera = &self.cameras[image % self.cameras.len()];
        if random.unit() < self.options.outlier_share {
            return ([random.range(0.0, f64::from(camera.width())) as f32, random.range(0.0, f64::from(camera.height())) as f32], true);
        }
        let noisy = pixel + Vector2::new(random.normal(), random.normal()) * self.options.noise_px;
        ([noisy.x as f32, noisy.y as f32], false)
    }
}

/// Where a ray meets the block or the plane that it stands on.
fn meet(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Vector3<f64>> {
    let [half, top] = BLOCK_M;
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for (k, [low, high]) in [[-half, half], [-half, half], [0.0, top]].into_iter().enumerate() {
        let (a, b) = ((low - origin[k]) / direction[k], (high - origin[k]) / direction[k]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    let block = (near < far && near > 0.0).then_some(near);
    let ground = (direction.z < -1e-9).then(|| -origin.z / direction.z).filter(|t| *t > 0.0);
    let distance = match (block, ground) {
        (Some(a), Some(b)) => a.min(b),
        (a, b) => a.or(b)?,
    };
    Some(origin + distance * direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_noise_every_observation_is_where_its_point_projects() {
        let made = geometry(&GeometryOptions::default()).expect("possible");
        assert_eq!((made.truth.points.len(), made.truth.images.len(), made.baselines.len()), (2000, 60, 60));
        // Keypoints are stored as f32: half a unit in the last place of 1920 is 6e-5.
        assert!(made.truth.reprojection_rms() < 2e-4, "{}", made.truth.reprojection_rms());
        let mean = made.truth.observation_count() as f64 / 2000.0;
        assert!((3.0..5.5).contains(&mean), "{mean}");
        let back = made.truth.points.iter().flat_map(|p| &p.track).filter(|o| o.image.index() % 3 == 2).count();
        assert!(back > 500, "the backward camera sees the bottom: {back}");
        for p in &made.truth.points {
            assert!(p.track.windows(2).all(|w| w[0].image < w[1].image) && p.track.len() >= 2 && p.track.len() <= 24);
        }
    }

    #[test]
    fn noise_and_outliers_are_as_many_as_asked_for() {
        let made = geometry(&GeometryOptions { noise_px: 0.7, outlier_share: 0.05, points: 4000, ..GeometryOptions::default() })
            .expect("possible");
        let wrong: std::collections::BTreeSet<Observation> = made.outliers.iter().copied().collect();
        let (mut sum, mut count) = (0.0, 0.0);
        for p in &made.truth.points {
            for o in p.track.iter().filter(|o| !wrong.contains(o)) {
                let image = &made.truth.images[o.image.index()];
                let pose = made.truth.cam_from_world(o.image).expect("posed");
                let pixel = made.truth.cameras[image.camera.index()].project(&pose.apply(&p.xyz)).expect("seen");
                sum += (pixel - made.truth.pixel(*o)).norm_squared();
                count += 1.0;
            }
        }
        let (deviation, share): (f64, f64) = ((sum / count / 2.0f64).sqrt(), wrong.len() as f64 / (count + wrong.len() as f64));
        // Some 17,000 observations: standard errors of 0.4 % and 0.17 %; four of each.
        assert!((deviation / 0.7 - 1.0).abs() < 0.016 && (share - 0.05).abs() < 0.007, "{deviation} {share}");
    }

    #[test]
    fn the_same_bytes_on_one_and_two_threads() {
        let options = GeometryOptions { points: 10_000, noise_px: 1.0, outlier_share: 0.02, ..GeometryOptions::default() };
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| geometry(&options).expect("possible"))
        };
        let (one, two) = (on(1), on(2));
        assert_eq!(one.truth, two.truth);
        assert_eq!(one.outliers, two.outliers);
        assert_ne!(one.truth, geometry(&GeometryOptions { seed: 2, ..options }).expect("possible").truth);
    }

    #[test]
    fn loops_are_closed_where_asked_for() {
        let motion = MotionOptions { frames: 40, arc_deg: 720.0, ..MotionOptions::default() };
        let far = |share: f64| {
            let options = GeometryOptions { motion: motion.clone(), revisited_share: share, ..GeometryOptions::default() };
            let made = geometry(&options).expect("possible");
            let span = |p: &Point| p.track[p.track.len() - 1].image.index() / 3 - p.track[0].image.index() / 3;
            made.truth.points.iter().filter(|p| span(p) > 14).count()
        };
        assert_eq!(far(0.0), 0);
        assert!(far(0.5) > 100, "{}", far(0.5));
    }
}
