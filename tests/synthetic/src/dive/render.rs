//! From the scene to a frame.

use super::blur::{blur, halo};
use super::moving::Moving;
use super::scene::DiveScene;
use super::shade::{Arriving, Light, Surface, haze_up_to};
use super::snow::add_snow;
use super::visible::{Apart, visible};
use crate::appearance::{Response, albedo};
use crate::optics::Window;
use crate::random::mix;
use crate::trace::{HitPacket, RayPacket};
use crate::world::Label;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use scene::{Mask, Raster};

/// Pixels along each side of a packet of rays.
const TILE: usize = 8;
const RAYS: usize = TILE * TILE;

/// One rendered frame of one camera, with its truth.
#[derive(Clone, Debug)]
pub struct DiveImage {
    /// Which camera.
    pub camera: usize,
    /// Which exposure.
    pub exposure: usize,
    /// The frame.
    pub rgb: Raster<[u8; 3]>,
    /// True mask: 255 where something of the scene that stays can be told from water, 0 for water, what moves, and what the water hides.
    pub mask: Mask,
    /// What each pixel shows: the numbers of [`Label`].
    pub labels: Raster<u8>,
    /// Depth along the axis of the camera of what the middle of each pixel shows, metres; 0 for water.
    pub depth: Raster<f32>,
    /// Face of [`crate::world::World::mesh`] that the middle of each pixel shows; [`NO_FACE`] for water and what moves.
    pub faces: Raster<u32>,
}

/// No face of the mesh.
pub const NO_FACE: u32 = u32::MAX;

/// What one ray brings home.
#[derive(Clone, Copy)]
struct Seen {
    light: Arriving,
    apart: Apart,
    label: Label,
    depth: f32,
    face: u32,
}

/// Rows of a frame before exposure.
#[derive(Default)]
struct Band {
    light: Vec<Arriving>,
    apart: Vec<Apart>,
    labels: Vec<u8>,
    depth: Vec<f32>,
    faces: Vec<u32>,
}

/// What does not change over a frame.
struct Shot<'a> {
    dive: &'a DiveScene,
    camera: usize,
    centre: Vector3<f64>,
    world_from_cam: Matrix3<f64>,
    window: Option<Window>,
    light: Light<'a>,
    moving: Moving,
    first_faces: Vec<u32>,
    px_per_rad: f32,
}

impl DiveScene {
    /// A frame of one camera. The same bytes on any number of threads.
    ///
    /// # Panics
    /// When there is no such camera.
    #[must_use]
    pub fn render(&self, camera: usize, exposure: usize) -> DiveImage {
        let (width, height) = (self.options.rig.width as usize, self.options.rig.height as usize);
        let world_from_cam = self.cam_from_world(camera, exposure).inverse();
        let shot = Shot {
            dive: self,
            camera,
            centre: world_from_cam.translation,
            world_from_cam: world_from_cam.rotation_matrix(),
            window: self.cameras[camera].window(self.refractive_index(exposure)),
            light: Light::new(self, exposure),
            moving: Moving::at(&self.world, self.motion.frame_time_s(exposure)),
            first_faces: self.world.first_faces(),
            px_per_rad: self.cameras[camera].calibrated.camera.params()[0] as f32,
        };
        let bands: Vec<Band> = (0..height.div_ceil(TILE)).into_par_iter().map(|band| shot.band(band * TILE)).collect();
        let whole = |len: usize| -> Band {
            let mut all = Band { light: Vec::with_capacity(len), ..Band::default() };
            for band in bands {
                all.light.extend(band.light);
                all.apart.extend(band.apart);
                all.labels.extend(band.labels);
                all.depth.extend(band.depth);
                all.faces.extend(band.faces);
            }
            all
        };
        let Band { light, apart, labels, depth, faces } = whole(width * height);
        let raster = "a band has the width of the frame";
        let depth = Raster::from_vec(width, height, depth).expect(raster);
        let labels = Raster::from_vec(width, height, labels).expect(raster);
        let (frame, response) = shot.develop(&light, &depth, exposure);
        let is_static: Vec<bool> = labels.data().iter().map(|&label| Label::ALL[usize::from(label)].is_static()).collect();
        DiveImage {
            camera,
            exposure,
            rgb: shot.expose(&frame, width, &response, exposure),
            mask: visible(&light, &apart, &is_static, width, &response),
            labels,
            depth,
            faces: Raster::from_vec(width, height, faces).expect(raster),
        }
    }
}

impl Shot<'_> {
    /// The rows from `top` on.
    fn band(&self, top: usize) -> Band {
        let (width, height) = (self.dive.options.rig.width as usize, self.dive.options.rig.height as usize);
        let rows = TILE.min(height - top);
        let nothing = Seen { light: Arriving::default(), apart: Apart::default(), label: Label::Water, depth: 0.0, face: NO_FACE };
        let mut seen = vec![nothing; width * rows];
        for left in (0..width).step_by(TILE) {
            let tile = self.tile(left, top);
            let columns = TILE.min(width - left);
            for y in 0..rows {
                seen[y * width + left..][..columns].copy_from_slice(&tile[y * TILE..][..columns]);
            }
        }
        Band {
            light: seen.iter().map(|s| s.light).collect(),
            apart: seen.iter().map(|s| s.apart).collect(),
            labels: seen.iter().map(|s| s.label as u8).collect(),
            depth: seen.iter().map(|s| s.depth).collect(),
            faces: seen.iter().map(|s| s.face).collect(),
        }
    }

    /// A tile of pixels: the light of all samples, the truth of the middle.
    fn tile(&self, left: usize, top: usize) -> [Seen; RAYS] {
        let n = self.dive.options.response.samples as usize;
        let mut middle = self.sample(left, top, 0.5, 0.5);
        if n == 1 {
            return middle;
        }
        let mut sum = [Arriving::default(); RAYS];
        for j in 0..n {
            for i in 0..n {
                let place = |k: usize| (k as f64 + 0.5) / n as f64;
                for (sum, seen) in sum.iter_mut().zip(self.sample(left, top, place(i), place(j))) {
                    sum.add(&seen.light, 1.0 / (n * n) as f32);
                }
            }
        }
        for (middle, sum) in middle.iter_mut().zip(sum) {
            middle.light = sum;
        }
        middle
    }

    /// One ray for each pixel of a tile, at the same place in every pixel.
    fn sample(&self, left: usize, top: usize, fx: f64, fy: f64) -> [Seen; RAYS] {
        let mut rays = RayPacket { origin: [[0.0; RAYS]; 3], direction: [[0.0; RAYS]; 3] };
        let table = &self.dive.tables[self.camera];
        let (width, height) = (self.dive.options.rig.width as usize, self.dive.options.rig.height as usize);
        for i in 0..RAYS {
            // Rays of a tile that hangs over the border repeat those of the border.
            let (x, y) = ((left + i % TILE).min(width - 1), (top + i / TILE).min(height - 1));
            let [u, v] = table.at(x, y, fx, fy);
            let air = Vector3::new(u, v, 1.0).normalize();
            let (origin, direction) = self.window.map_or((Vector3::zeros(), air), |window| window.leave(&air));
            let (origin, direction) = (self.centre + self.world_from_cam * origin, self.world_from_cam * direction);
            for k in 0..3 {
                rays.origin[k][i] = origin[k] as f32;
                rays.direction[k][i] = direction[k] as f32;
            }
        }
        let mut hits = HitPacket::default();
        self.dive.tracer.packet(&rays, &mut hits);
        let mut moving_hits = HitPacket { distance: hits.distance, ..HitPacket::default() };
        if let Some(tracer) = &self.moving.tracer {
            tracer.packet(&rays, &mut moving_hits);
        }
        let ray = |i: usize| {
            let at = |v: &[[f32; RAYS]; 3]| Vector3::new(v[0][i], v[1][i], v[2][i]);
            (at(&rays.origin), at(&rays.direction))
        };
        let (origin, direction) = ray(RAYS / 2 + TILE / 2);
        let haze = self.light.haze(&origin, &direction);
        std::array::from_fn(|i| {
            let (origin, direction) = ray(i);
            let mut seen = if moving_hits.triangle[i] != HitPacket::NONE {
                self.moving_surface(&origin, &direction, moving_hits.triangle[i])
            } else if hits.triangle[i] != HitPacket::NONE {
                self.surface(&origin, &direction, hits.triangle[i])
            } else {
                Seen { light: Arriving::default(), apart: Apart::default(), label: Label::Water, depth: 0.0, face: NO_FACE }
            };
            let distance = (seen.label != Label::Water).then_some(hits.distance[i].min(moving_hits.distance[i]));
            let veil = self.light.veil(origin.z, direction.z, distance);
            let endless = self.light.veil(origin.z, direction.z, None);
            let (haze, all_haze) = (haze_up_to(&haze, distance.unwrap_or(f32::INFINITY)), haze_up_to(&haze, f32::INFINITY));
            for c in 0..3 {
                seen.apart.own[c] = seen.light.straight[c];
                seen.apart.water[c] = endless[c] + all_haze[c];
                seen.light.straight[c] += veil[c] + haze[c];
            }
            seen
        })
    }

    /// What a ray sees of the scene that stays.
    fn surface(&self, origin: &Vector3<f32>, direction: &Vector3<f32>, triangle: u32) -> Seen {
        let hit = self.dive.tracer.hit(triangle, &origin.cast(), &direction.cast());
        let part = &self.dive.world.parts[hit.part as usize];
        let point = origin.cast::<f64>() + hit.distance * direction.cast::<f64>();
        let footprint = hit.distance as f32 / self.px_per_rad;
        let colour = albedo(&point, &part.material, &self.dive.world.panels, footprint, self.dive.options.seed as u32);
        let normal = facing(hit.shading_normal.cast(), direction);
        let open = self.dive.sky.at(&point.cast(), &normal);
        let light = self.arriving(&point, normal, colour, open, hit.distance as f32);
        Seen {
            light,
            apart: Apart::default(),
            label: part.label,
            depth: self.depth(&point),
            face: self.first_faces[hit.part as usize] + hit.face,
        }
    }

    fn moving_surface(&self, origin: &Vector3<f32>, direction: &Vector3<f32>, triangle: u32) -> Seen {
        let Some(tracer) = &self.moving.tracer else { unreachable!("something that moves was hit") };
        let hit = tracer.hit(triangle, &origin.cast(), &direction.cast());
        let part = &self.moving.parts[hit.part as usize];
        let point = origin.cast::<f64>() + hit.distance * direction.cast::<f64>();
        let in_body = self.moving.body_from_world[hit.part as usize].apply(&point);
        let footprint = hit.distance as f32 / self.px_per_rad;
        let colour = albedo(&in_body, &part.material, &self.dive.world.panels, footprint, self.dive.options.seed as u32);
        let light = self.arriving(&point, facing(hit.shading_normal.cast(), direction), colour, 1.0, hit.distance as f32);
        Seen { light, apart: Apart::default(), label: part.label, depth: self.depth(&point), face: NO_FACE }
    }

    fn arriving(&self, point: &Vector3<f64>, normal: Vector3<f32>, albedo: [f32; 3], open: f32, distance: f32) -> Arriving {
        let surface = Surface { point: point.cast(), normal, albedo, open };
        self.light.through(self.light.reflected(&surface), distance)
    }

    fn depth(&self, point: &Vector3<f64>) -> f32 {
        (point - self.centre).dot(&self.world_from_cam.column(2)) as f32
    }

    /// The light on the sensor, with what the water spreads, specks and the blur of the lens; and the camera's settings for it.
    fn develop(&self, light: &[Arriving], depth: &Raster<f32>, exposure: usize) -> (Vec<[f32; 3]>, Response) {
        let (width, options) = (depth.width(), &self.dive.options);
        let mut frame: Vec<[f32; 3]> = light.iter().map(|l| l.straight).collect();
        if self.dive.water.is_some() {
            let spread: Vec<[f32; 3]> = light.iter().map(|l| l.spread).collect();
            halo(&spread, width, options.water.forward_blur_rad * self.px_per_rad, &mut frame);
        }
        add_snow(self.dive, &self.light, self.camera, exposure, depth, &mut frame);
        blur(&mut frame, width, options.response.blur_px);
        let response = Response::new(&options.response, &frame, self.balance(exposure));
        (frame, response)
    }

    /// From light to bytes, with the noise of the sensor.
    fn expose(&self, frame: &[[f32; 3]], width: usize, response: &Response, exposure: usize) -> Raster<[u8; 3]> {
        let key = mix(self.dive.options.seed ^ mix((self.camera as u64) << 32 | exposure as u64));
        let mut rgb = Raster::filled(width, frame.len() / width, [0; 3]);
        rgb.data_mut().par_chunks_mut(width).zip(frame.par_chunks(width)).enumerate().for_each(|(y, (out, row))| {
            response.row(row, mix(key ^ y as u64), out);
        });
        rgb
    }

    /// Colour of the light where the camera is: what a white balance starts from.
    fn balance(&self, exposure: usize) -> [f32; 3] {
        let height = self.dive.rig_from_world(exposure).centre().z as f32;
        self.light.colour(height)
    }
}

/// The side of a surface that faces the ray.
fn facing(normal: Vector3<f32>, direction: &Vector3<f32>) -> Vector3<f32> {
    if normal.dot(direction) > 0.0 { -normal } else { normal }
}
