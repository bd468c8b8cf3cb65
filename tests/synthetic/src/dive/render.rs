//! From the scene to frames.

use super::mesh::mesh;
use super::optics::Optics;
use super::path::path;
use super::surface::{Block, reef, trace};
use super::texture::albedo;
use super::water::{srgb, through};
use crate::random::{Random, mix};
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use scene::{Camera, CameraModel, Mask, Mesh, Raster, Rigid3};

/// Light from the surface, towards the scene.
const SUN: [f64; 3] = [0.35, -0.45, 0.82];

/// What to render.
#[derive(Clone, Debug, PartialEq)]
pub struct DiveOptions {
    /// Exposures of the two-camera rig.
    pub exposures: usize,
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
        Self { exposures: 12, width: 640, height: 400, water: true, noise: 1.5, seed: 7 }
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

/// Renders a dive with two cameras, 0.4 m apart, that converge a little. The same options give the same bytes, on any
/// number of threads.
#[must_use]
pub fn render_dive(options: &DiveOptions) -> Dive {
    let blocks = reef();
    let optics = [lens(options, 0.80, [2.0, -1.5], -0.06), lens(options, 0.81, [-1.0, 2.5], -0.07)];
    let cameras = optics.iter().map(|lens| camera(lens, options)).collect();
    let cam_from_rig = vec![Rigid3::identity(), second_camera()];
    let rig_from_world = path(options.exposures, options.seed);
    let mut images = Vec::new();
    for (c, lens) in optics.iter().enumerate() {
        for (e, &pose) in rig_from_world.iter().enumerate() {
            let shot =
                Shot { lens, world_from_cam: (cam_from_rig[c] * pose).inverse(), key: mix(options.seed ^ ((c as u64) << 32 | e as u64)) };
            let (rgb, mask) = shot.render(&blocks, options);
            images.push(DiveImage { camera: c, exposure: e, rgb, mask });
        }
    }
    Dive { cameras, cam_from_rig, rig_from_world, images, mesh: mesh(&blocks) }
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

fn second_camera() -> Rigid3 {
    let rotation = UnitQuaternion::from_euler_angles(0.01, -0.07, 0.015);
    Rigid3::new(rotation, -(rotation * Vector3::new(0.3998, 0.006, 0.0105)))
}

struct Shot<'a> {
    lens: &'a Optics,
    world_from_cam: Rigid3,
    /// Seed of the noise of this frame.
    key: u64,
}

impl Shot<'_> {
    fn render(&self, blocks: &[Block], options: &DiveOptions) -> (Raster<[u8; 3]>, Mask) {
        let (width, height) = (options.width as usize, options.height as usize);
        let mut rgb = Raster::filled(width, height, [0u8; 3]);
        let mut mask = Mask::filled(width, height, 0);
        rgb.data_mut().par_chunks_mut(width).zip(mask.data_mut().par_chunks_mut(width)).enumerate().for_each(
            |(y, (colours, structure))| {
                let mut noise = Random::new(mix(self.key ^ y as u64));
                for x in 0..width {
                    let (colour, is_structure) = self.pixel(blocks, options, x, y);
                    structure[x] = if is_structure { 255 } else { 0 };
                    colours[x] = colour.map(|v| (srgb(v) + options.noise * noise.normal()).round().clamp(0.0, 255.0) as u8);
                }
            },
        );
        (rgb, mask)
    }

    /// Linear colour at the middle of a pixel, and whether it shows structure. One ray is enough: texture finer than a
    /// pixel fades out by itself.
    fn pixel(&self, blocks: &[Block], options: &DiveOptions, x: usize, y: usize) -> ([f64; 3], bool) {
        let origin = self.world_from_cam.translation;
        let direction = self.world_from_cam.rotation * self.lens.direction(x as f64 + 0.5, y as f64 + 0.5);
        let Some(hit) = trace(blocks, &origin, &direction) else {
            return (if options.water { through(None) } else { [0.0; 3] }, false);
        };
        let footprint = hit.distance / self.lens.focal_px;
        let colour = albedo(&(origin + hit.distance * direction), hit.is_reef, footprint, options.seed);
        let light = 0.55 + 0.75 * hit.normal.dot(&Vector3::from(SUN)).max(0.0);
        let lit = colour.map(|v| v * light);
        (if options.water { through(Some((lit, hit.distance))) } else { lit }, true)
    }
}

#[cfg(test)]
mod tests {
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
        let blocks = reef();
        let pose = dive.cam_from_rig[1] * dive.rig_from_world[0];
        let optics = lens(&small(), 0.81, [-1.0, 2.5], -0.07);
        let mut seen = 0;
        for vertex in dive.mesh.vertices.iter().step_by(7) {
            let x_in_cam = pose.apply(&vertex.coords);
            let Some(pixel) = dive.cameras[1].project(&x_in_cam) else { continue };
            if dive.images[2].rgb.at_point(pixel.x, pixel.y).is_none() {
                continue;
            }
            let direction = pose.rotation.inverse() * optics.direction(pixel.x, pixel.y);
            let Some(hit) = trace(&blocks, &pose.centre(), &direction) else { continue };
            // Hidden vertices lie behind what is hit; none lies before it. 0.1 mm: grazing rays over ripples.
            assert!(hit.distance <= x_in_cam.norm() + 1e-4, "{} {}", hit.distance, x_in_cam.norm());
            seen += usize::from((hit.distance - x_in_cam.norm()).abs() < 1e-6);
        }
        assert!(seen > 50, "{seen} vertices are seen");
    }
}
