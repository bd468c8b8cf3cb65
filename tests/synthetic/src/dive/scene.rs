//! A dive before its frames are rendered: options, cameras, rig, path, surface.

use super::bars::{ScaleBar, bar_blocks, scale_bars};
use super::mesh::mesh;
use super::optics::Optics;
use super::path::path;
use super::render::Shot;
use super::surface::{Block, reef};
use super::truth::reconstruction;
use crate::random::mix;
use ::scene::{Camera, CameraModel, Mask, Mesh, Raster, Reconstruction, Rigid3};
use nalgebra::{UnitQuaternion, Vector3};

/// What to render.
#[derive(Clone, Debug, PartialEq)]
pub struct DiveOptions {
    /// Exposures of the rig.
    pub exposures: usize,
    /// Cameras of the rig, one to three; what is outside is taken as the nearest.
    pub cameras: usize,
    /// Columns of a frame.
    pub width: u32,
    /// Rows of a frame.
    pub height: u32,
    /// Water between scene and camera; without it the scene stands in air before black.
    pub water: bool,
    /// Standard deviation of the sensor noise, grey values of 255.
    pub noise: f64,
    /// Seed of path, texture and noise.
    pub seed: u64,
}

impl Default for DiveOptions {
    fn default() -> Self {
        Self { exposures: 12, cameras: 2, width: 640, height: 400, water: true, noise: 1.5, seed: 7 }
    }
}

/// One rendered frame of one camera.
#[derive(Clone, Debug)]
pub struct DiveImage {
    /// Which camera.
    pub camera: usize,
    /// Which exposure.
    pub exposure: usize,
    /// The frame.
    pub rgb: Raster<[u8; 3]>,
    /// True mask: 255 where reef or bottom is seen.
    pub mask: Mask,
}

/// A dive whose frames are rendered one by one.
#[derive(Clone, Debug)]
pub struct DiveScene {
    /// True interior orientations.
    pub cameras: Vec<Camera>,
    /// True poses in the rig.
    pub cam_from_rig: Vec<Rigid3>,
    /// True poses of the exposures.
    pub rig_from_world: Vec<Rigid3>,
    /// Known lengths in the scene.
    pub scale_bars: Vec<ScaleBar>,
    pub(super) options: DiveOptions,
    pub(super) blocks: Vec<Block>,
    lenses: Vec<Optics>,
}

impl DiveScene {
    /// The scene: a reef on sand with two scale bars, and a rig of cameras about 0.4 m apart that converge a little, on
    /// an arc around it.
    #[must_use]
    pub fn new(options: &DiveOptions) -> Self {
        let count = options.cameras.clamp(1, 3);
        let all =
            [lens(options, 0.80, [2.0, -1.5], -0.06), lens(options, 0.81, [-1.0, 2.5], -0.07), lens(options, 0.79, [1.5, 1.0], -0.05)];
        let lenses = all[..count].to_vec();
        Self {
            cameras: lenses.iter().map(|lens| camera(lens, options)).collect(),
            cam_from_rig: mounting()[..count].to_vec(),
            rig_from_world: path(options.exposures, options.seed),
            scale_bars: scale_bars(),
            options: options.clone(),
            blocks: reef().into_iter().chain(bar_blocks()).collect(),
            lenses,
        }
    }

    /// A frame of one camera. The same bytes on any number of threads.
    ///
    /// # Panics
    /// When there is no such camera or exposure.
    #[must_use]
    pub fn render(&self, camera: usize, exposure: usize) -> DiveImage {
        let shot = Shot {
            lens: &self.lenses[camera],
            world_from_cam: self.cam_from_world(camera, exposure).inverse(),
            key: mix(self.options.seed ^ ((camera as u64) << 32 | exposure as u64)),
        };
        let (rgb, mask) = shot.render(&self.blocks, &self.options);
        DiveImage { camera, exposure, rgb, mask }
    }

    /// The true pose of a frame.
    ///
    /// # Panics
    /// As [`DiveScene::render`].
    #[must_use]
    pub fn cam_from_world(&self, camera: usize, exposure: usize) -> Rigid3 {
        self.cam_from_rig[camera] * self.rig_from_world[exposure]
    }

    /// True surface. Boxes overlap: some of its parts lie inside others.
    #[must_use]
    pub fn mesh(&self) -> Mesh {
        mesh(&self.blocks)
    }

    /// As [`Dive::truth`], before anything is rendered.
    #[must_use]
    pub fn truth(&self, extension: &str) -> Reconstruction {
        reconstruction(&self.cameras, &self.cam_from_rig, &self.rig_from_world, extension)
    }
}

/// A rendered dive and its truth.
#[derive(Clone, Debug)]
pub struct Dive {
    /// True interior orientations.
    pub cameras: Vec<Camera>,
    /// True poses in the rig.
    pub cam_from_rig: Vec<Rigid3>,
    /// True poses of the exposures.
    pub rig_from_world: Vec<Rigid3>,
    /// Frames, camera after camera.
    pub images: Vec<DiveImage>,
    /// True surface. Boxes overlap: some of its parts lie inside others.
    pub mesh: Mesh,
}

/// Renders all frames of a [`DiveScene`]. The same options give the same bytes, on any number of threads.
#[must_use]
pub fn render_dive(options: &DiveOptions) -> Dive {
    let scene = DiveScene::new(options);
    let all = (0..scene.cameras.len()).flat_map(|c| (0..options.exposures).map(move |e| (c, e)));
    let images = all.map(|(camera, exposure)| scene.render(camera, exposure)).collect();
    let mesh = scene.mesh();
    let DiveScene { cameras, cam_from_rig, rig_from_world, .. } = scene;
    Dive { cameras, cam_from_rig, rig_from_world, images, mesh }
}

/// A lens of a focal length given in image widths.
fn lens(options: &DiveOptions, focal: f64, shift: [f64; 2], radial: f64) -> Optics {
    let (w, h) = (f64::from(options.width), f64::from(options.height));
    Optics { focal_px: focal * w, axis_px: [w / 2.0 + shift[0], h / 2.0 + shift[1]], radial }
}

fn camera(lens: &Optics, options: &DiveOptions) -> Camera {
    let params = [lens.focal_px, lens.axis_px[0], lens.axis_px[1], lens.radial];
    Camera::new(CameraModel::SimpleRadial, options.width, options.height, &params).expect("a dive has frames with pixels")
}

/// Poses in the rig: the first camera, one to its right, one between them and higher.
fn mounting() -> [Rigid3; 3] {
    let at = |rotation: UnitQuaternion<f64>, centre: Vector3<f64>| Rigid3::new(rotation, -(rotation * centre));
    [
        Rigid3::identity(),
        at(UnitQuaternion::from_euler_angles(0.01, 0.07, 0.015), Vector3::new(0.3998, 0.006, 0.0105)),
        at(UnitQuaternion::from_euler_angles(0.06, 0.035, -0.01), Vector3::new(0.203, -0.302, -0.004)),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::surface::trace;
    use super::*;

    fn small() -> DiveOptions {
        DiveOptions { exposures: 2, width: 96, height: 60, ..DiveOptions::default() }
    }

    #[test]
    fn the_same_bytes_on_one_and_two_threads() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| render_dive(&small()))
        };
        let (one, two) = (on(1), on(2));
        for (a, b) in one.images.iter().zip(&two.images) {
            assert_eq!(a.rgb, b.rgb);
            assert_eq!(a.mask, b.mask);
        }
    }

    #[test]
    fn frames_show_reef_sand_and_water() {
        let dive = render_dive(&small());
        for image in &dive.images {
            let structure = image.mask.data().iter().filter(|&&v| v == 255).count() as f64 / image.mask.data().len() as f64;
            assert!((0.3..0.97).contains(&structure), "{structure}");
            let mean = image.rgb.data().iter().map(|c| f64::from(c[1])).sum::<f64>() / image.rgb.data().len() as f64;
            assert!((40.0..200.0).contains(&mean), "{mean}");
        }
    }

    #[test]
    fn mesh_vertices_project_onto_structure() {
        // A vertex that the camera sees lies on the traced surface: the distance along its ray is the same.
        let dive = render_dive(&small());
        let scene = DiveScene::new(&small());
        let (pose, optics) = (scene.cam_from_world(1, 0), scene.lenses[1]);
        let mut seen = 0;
        let mut points: Vec<Vector3<f64>> = dive.mesh.vertices.iter().map(|v| v.coords).collect();
        // A ray to the very corner of a box may pass it: corners are moved a little into their boxes.
        for (corners, block) in points.chunks_exact_mut(8).zip(&scene.blocks) {
            corners.iter_mut().for_each(|corner| *corner += 1e-6 * ((block.low + block.high) / 2.0 - *corner));
        }
        for point in points.iter().step_by(7) {
            let x_in_cam = pose.apply(point);
            let Some(pixel) = dive.cameras[1].project(&x_in_cam) else { continue };
            if dive.images[2].rgb.at_point(pixel.x, pixel.y).is_none() {
                continue;
            }
            let direction = pose.rotation.inverse() * optics.direction(pixel.x, pixel.y);
            let Some(hit) = trace(&scene.blocks, &pose.centre(), &direction) else { continue };
            // Hidden vertices lie behind what is hit; none lies before it. 0.1 mm: grazing rays over ripples.
            assert!(hit.distance <= x_in_cam.norm() + 1e-4, "{} {}", hit.distance, x_in_cam.norm());
            seen += usize::from((hit.distance - x_in_cam.norm()).abs() < 1e-6);
        }
        assert!(seen > 50, "{seen} vertices are seen");
    }
}
