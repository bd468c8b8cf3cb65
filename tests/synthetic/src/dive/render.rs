//! From the scene to a frame.

use super::optics::Optics;
use super::scene::DiveOptions;
use super::surface::{Block, trace};
use super::texture::albedo;
use super::water::{srgb, through};
use crate::random::{Random, mix};
use nalgebra::Vector3;
use rayon::prelude::*;
use scene::{Mask, Raster, Rigid3};

/// Light from the surface, towards the scene.
const SUN: [f64; 3] = [0.35, -0.45, 0.82];

/// One exposure of one camera.
pub(super) struct Shot<'a> {
    pub lens: &'a Optics,
    pub world_from_cam: Rigid3,
    /// Seed of the noise of this frame.
    pub key: u64,
}

impl Shot<'_> {
    pub(super) fn render(&self, blocks: &[Block], options: &DiveOptions) -> (Raster<[u8; 3]>, Mask) {
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
        let colour = albedo(&(origin + hit.distance * direction), hit.material, footprint, options.seed);
        let light = 0.55 + 0.75 * hit.normal.dot(&Vector3::from(SUN)).max(0.0);
        let lit = colour.map(|v| v * light);
        (if options.water { through(Some((lit, hit.distance))) } else { lit }, true)
    }
}
