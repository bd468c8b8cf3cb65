//! Which images help an image, and between which depths its scene lies, from the sparse points.

use nalgebra::Vector2;
use scene::{ImageId, Observation, Point, Reconstruction};

/// How neighbours are chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSelectionOptions {
    /// At most this many neighbours.
    pub max_views: usize,
    /// A neighbour shares at least this many points.
    pub min_shared_points: usize,
    /// The median triangulation angle of the shared points is at least this, radians.
    pub min_angle: f64,
    /// Angles above this count fully, smaller ones less (depth is uncertain), radians.
    pub good_angle: f64,
    /// Angles above this count less (appearance changes), radians.
    pub wide_angle: f64,
}

impl Default for ViewSelectionOptions {
    fn default() -> Self {
        let degrees = f64::to_radians;
        Self { max_views: 5, min_shared_points: 8, min_angle: degrees(1.0), good_angle: degrees(8.0), wide_angle: degrees(30.0) }
    }
}

/// The images that help most to find the depth of `image`, best first.
///
/// The score of an image is the sum over shared points of a weight for the triangulation angle, which falls to 0 below
/// `good_angle` and like a Gaussian above `wide_angle`, and one for the ratio of ground sample distances, 1 for equal
/// ones (after Schoenberger et al., *Pixelwise view selection for unstructured multi-view stereo*, ECCV 2016, whose priors
/// these are for whole images). The best image is taken first; then always the one with the best score when each point counts less the
/// better the images taken before show it, so that all parts of the image get neighbours. Images of the same exposure of a rig count as any
/// other. Of equal scores the lower id wins. Empty when `image` is not oriented or out of range.
#[must_use]
pub fn select_views(reconstruction: &Reconstruction, image: ImageId, options: &ViewSelectionOptions) -> Vec<ImageId> {
    let Some(pose) = pose_of(reconstruction, image) else { return Vec::new() };
    let centre = pose.centre();
    let poses: Vec<_> = (0..reconstruction.images.len()).map(|i| reconstruction.cam_from_world(ImageId::new(i))).collect();
    let focal = |i: ImageId| reconstruction.cameras[reconstruction.images[i.index()].camera.index()].mean_focal();
    // Of every image: the points that it shares, by their number in `image`, and their weights.
    let mut shared: Vec<Vec<(usize, f64)>> = vec![Vec::new(); poses.len()];
    let mut angles = vec![Vec::new(); poses.len()];
    let mut points = 0;
    for (number, (point, _)) in points_of(reconstruction, image).enumerate() {
        points = number + 1;
        let ray = point.xyz - centre;
        let gsd = pose.apply(&point.xyz).z / focal(image);
        for observation in &point.track {
            let Some(other_pose) = poses.get(observation.image.index()).copied().flatten() else { continue };
            let other_gsd = other_pose.apply(&point.xyz).z / focal(observation.image);
            if observation.image == image || other_gsd <= 0.0 || gsd <= 0.0 {
                continue;
            }
            let angle = ray.angle(&(point.xyz - other_pose.centre()));
            let narrow = (angle / options.good_angle).min(1.0);
            let wide = ((angle - options.wide_angle).max(0.0) / options.wide_angle.max(1e-9)).powi(2);
            let scale = (gsd / other_gsd).min(other_gsd / gsd);
            shared[observation.image.index()].push((number, narrow * narrow * (-2.0 * wide).exp() * scale));
            angles[observation.image.index()].push(angle);
        }
    }
    let mut candidates: Vec<usize> = (0..poses.len())
        .filter(|&i| angles[i].len() >= options.min_shared_points.max(1) && quantile(&mut angles[i], 0.5) >= options.min_angle)
        .collect();
    let mut covered = vec![0.0f64; points];
    let mut found = Vec::new();
    while found.len() < options.max_views {
        let score = |i: usize| shared[i].iter().map(|&(number, weight)| weight / (1.0 + covered[number])).sum::<f64>();
        let mut best: Option<(f64, usize)> = None;
        for (position, &candidate) in candidates.iter().enumerate() {
            let score = score(candidate);
            if best.is_none_or(|(highest, _)| score > highest) {
                best = Some((score, position));
            }
        }
        let Some((_, position)) = best else { break };
        let taken = candidates.remove(position);
        for &(number, weight) in &shared[taken] {
            covered[number] += weight;
        }
        found.push(ImageId::new(taken));
    }
    found
}

/// Smallest and largest depth (z in the camera frame) at which surfaces of `image` are looked for.
///
/// From its sparse points: the 2 % and 98 % quantiles, moved apart by a fifth of the nearest and a half of the farthest
/// depth, because the sparse points leave out most of the scene. `None` with fewer than five points in front.
#[must_use]
pub fn depth_range(reconstruction: &Reconstruction, image: ImageId) -> Option<(f64, f64)> {
    let pose = pose_of(reconstruction, image)?;
    let mut depths: Vec<f64> =
        points_of(reconstruction, image).map(|(p, _)| pose.apply(&p.xyz).z).filter(|z| z.is_finite() && *z > 0.0).collect();
    if depths.len() < 5 {
        return None;
    }
    Some((quantile(&mut depths, 0.02) * 0.8, quantile(&mut depths, 0.98) * 1.5))
}

/// A pixel of known depth, from which the search may start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthSeed {
    /// Where, in pixels of the *full* image that the reconstruction is about, divided by its size: both in 0..=1.
    pub position: Vector2<f64>,
    /// z in the camera frame.
    pub depth: f64,
}

/// The sparse points of an image as seeds, in order of the points.
#[must_use]
pub fn depth_seeds(reconstruction: &Reconstruction, image: ImageId) -> Vec<DepthSeed> {
    let Some(pose) = pose_of(reconstruction, image) else { return Vec::new() };
    let camera = &reconstruction.cameras[reconstruction.images[image.index()].camera.index()];
    let size = Vector2::new(f64::from(camera.width()), f64::from(camera.height()));
    points_of(reconstruction, image)
        .map(|(point, observation)| DepthSeed {
            position: reconstruction.pixel(observation).component_div(&size),
            depth: pose.apply(&point.xyz).z,
        })
        .filter(|seed| seed.depth.is_finite() && seed.depth > 0.0)
        .collect()
}

fn pose_of(reconstruction: &Reconstruction, image: ImageId) -> Option<scene::Rigid3> {
    (image.index() < reconstruction.images.len()).then(|| reconstruction.cam_from_world(image))?
}

/// Points that `image` observes, with the observation.
fn points_of(reconstruction: &Reconstruction, image: ImageId) -> impl Iterator<Item = (&Point, Observation)> {
    reconstruction.points.iter().filter_map(move |point| {
        // Tracks are sorted, at most one observation an image.
        let found = point.track.binary_search_by_key(&image, |o| o.image).ok()?;
        Some((point, point.track[found]))
    })
}

/// The value below which a share `q` of the values lies; sorts them. `values` is not empty.
fn quantile(values: &mut [f64], q: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * q).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use scene::{Camera, CameraId, CameraModel, Frame, FrameId, Image, KeypointIndex, Rig, RigId, Rigid3, Scale};

    /// Cameras at the given centres look along +z at points on a wall 10 away; each sees what falls into its image.
    fn wall(centres: &[Vector3<f64>], turned: &[f64]) -> Reconstruction {
        let camera = Camera::from_focal(CameraModel::Pinhole, 400, 300, 300.0).expect("valid");
        let mut scene = Reconstruction {
            cameras: vec![camera],
            rigs: vec![Rig::single(CameraId(0))],
            frames: Vec::new(),
            images: Vec::new(),
            keypoints: vec![Vec::new(); centres.len()],
            points: Vec::new(),
            scale: Scale::Metric,
        };
        for (i, (c, &angle)) in centres.iter().zip(turned).enumerate() {
            let rotation = UnitQuaternion::from_euler_angles(0.0, angle, 0.0);
            let pose = Rigid3::new(rotation, -(rotation * c));
            scene.frames.push(Frame { rig: RigId(0), exposure: i as u32, rig_from_world: Some(pose) });
            scene.images.push(Image { name: format!("c/{i}"), camera: CameraId(0), frame: FrameId::new(i) });
        }
        for i in 0..400 {
            let xyz = Vector3::new((i % 20) as f64 - 9.5, (i / 20) as f64 * 0.5 - 5.0, 10.0 + (i % 7) as f64 * 0.1);
            let mut track = Vec::new();
            for image in 0..centres.len() {
                let pose = scene.cam_from_world(ImageId::new(image)).expect("oriented");
                let Some(p) = camera.project(&pose.apply(&xyz)) else { continue };
                if p.x >= 0.0 && p.y >= 0.0 && p.x < 400.0 && p.y < 300.0 {
                    track.push(Observation { image: ImageId::new(image), keypoint: KeypointIndex::new(scene.keypoints[image].len()) });
                    scene.keypoints[image].push([p.x as f32, p.y as f32]);
                }
            }
            scene.points.push(Point { xyz, colour: [0; 3], error_px: 0.0, track });
        }
        scene
    }

    #[test]
    fn good_bases_come_before_short_long_and_turned_ones() {
        let x = |x: f64| Vector3::new(x, 0.0, 0.0);
        // 0 reference, 1 tiny base, 2 good base, 3 very wide, 4 turned away, 5 far behind (other scale).
        let centres = [x(0.0), x(0.02), x(2.0), x(6.0), x(1.0), Vector3::new(1.5, 0.0, -30.0)];
        let scene = wall(&centres, &[0.0, 0.0, 0.0, 0.0, 2.5, 0.0]);
        let found = select_views(&scene, ImageId(0), &ViewSelectionOptions::default());
        assert_eq!(found[0], ImageId(2));
        assert!(!found.contains(&ImageId(0)) && !found.contains(&ImageId(1)) && !found.contains(&ImageId(4)), "{found:?}");
        let two = ViewSelectionOptions { max_views: 2, ..Default::default() };
        assert_eq!(select_views(&scene, ImageId(0), &two), found[..2]);
        assert!(select_views(&scene, ImageId(77), &two).is_empty());
    }

    #[test]
    fn every_part_of_the_image_gets_a_neighbour() {
        // Three neighbours see the left two thirds alike, a fourth only the right half: it comes second though it shares the fewest points.
        let x = |x: f64| Vector3::new(x, 0.0, 0.0);
        let scene = wall(&[x(0.0), x(-3.0), x(-3.1), x(-2.9), x(4.5)], &[0.0; 5]);
        let found = select_views(&scene, ImageId(0), &ViewSelectionOptions::default());
        assert_eq!((found.len(), found[1]), (4, ImageId(4)), "{found:?}");
    }

    #[test]
    fn range_covers_the_points_and_ignores_one_outlier() {
        let mut scene = wall(&[Vector3::zeros(), Vector3::x()], &[0.0, 0.0]);
        let observed = scene.points.iter().position(|p| p.track.len() == 2).expect("shared");
        scene.points[observed].xyz.z = 1e5;
        let (near, far) = depth_range(&scene, ImageId(0)).expect("many points");
        assert!((6.0..=10.0).contains(&near) && (10.6..=20.0).contains(&far), "{near} {far}");
        scene.points.truncate(3);
        assert_eq!(depth_range(&scene, ImageId(0)), None);
    }

    #[test]
    fn seeds_lie_on_their_rays() {
        let scene = wall(&[Vector3::zeros(), Vector3::x()], &[0.0, 0.1]);
        let seeds = depth_seeds(&scene, ImageId(1));
        assert_eq!(seeds.len(), scene.keypoints[1].len());
        let pose = scene.cam_from_world(ImageId(1)).expect("oriented");
        for seed in &seeds {
            let pixel = seed.position.component_mul(&Vector2::new(400.0, 300.0));
            let uv = scene.cameras[0].unproject(&pixel).expect("pinhole");
            let in_cam = Vector3::new(uv.x, uv.y, 1.0) * seed.depth;
            let in_world = pose.inverse().apply(&in_cam);
            // Keypoints are f32.
            assert!(scene.points.iter().any(|p| (p.xyz - in_world).norm() < 1e-4), "{in_world}");
        }
    }
}
