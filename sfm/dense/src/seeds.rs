//! Spreads sparse depths over a raster, as a start for the search.

use crate::{DepthSeed, View};
use nalgebra::{Vector2, Vector3};
use scene::{Camera, Raster};

/// Inverse depth of the nearest seed of every pixel of a raster of `width` x `height`, at 1 / 2^`level` of `pinhole`; 0 without seeds.
///
/// Nearness is by steps to one of eight neighbours; the first seed in the list wins where two are equally near.
pub(crate) fn seed_raster(view: &View, pinhole: &Camera, seeds: &[DepthSeed], width: usize, height: usize, level: u32) -> Raster<f32> {
    let mut raster = Raster::filled(width, height, 0.0f32);
    let scale = 0.5f64.powi(level as i32);
    let size = Vector2::new(f64::from(view.camera.width()), f64::from(view.camera.height()));
    let mut queue = Vec::new();
    for seed in seeds.iter().filter(|s| s.depth.is_finite() && s.depth > 0.0) {
        let pixel = seed.position.component_mul(&size);
        let Some(uv) = view.camera.unproject(&pixel) else { continue };
        let Some(p) = pinhole.project(&Vector3::new(uv.x, uv.y, 1.0)).map(|p| p * scale) else { continue };
        if let Some(&value) = raster.at_point(p.x, p.y)
            && value == 0.0
        {
            let at = (p.x as usize, p.y as usize);
            raster[at] = (1.0 / seed.depth) as f32;
            queue.push(at);
        }
    }
    let mut next = 0;
    while let Some(&(x, y)) = queue.get(next) {
        next += 1;
        let value = raster[(x, y)];
        for ny in y.saturating_sub(1)..(y + 2).min(height) {
            for nx in x.saturating_sub(1)..(x + 2).min(width) {
                if raster[(nx, ny)] == 0.0 {
                    raster[(nx, ny)] = value;
                    queue.push((nx, ny));
                }
            }
        }
    }
    raster
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::{CameraModel, ImageId, Rigid3};

    #[test]
    fn each_pixel_gets_its_nearest_seed() {
        let camera = Camera::from_focal(CameraModel::Pinhole, 40, 20, 30.0).expect("valid");
        let view = View { image: ImageId(0), camera, cam_from_world: Rigid3::identity(), rgb: Raster::filled(40, 20, [0; 3]), mask: None };
        let seed = |x, y, depth| DepthSeed { position: Vector2::new(x, y), depth };
        let seeds = [seed(0.1, 0.5, 2.0), seed(0.9, 0.5, 4.0), seed(0.5, 0.5, f64::NAN), seed(7.0, 0.5, 1.0)];
        let raster = seed_raster(&view, &camera, &seeds, 20, 10, 1);
        for y in 0..10 {
            assert!(raster.row(y)[..9].iter().all(|&v| v == 0.5) && raster.row(y)[11..].iter().all(|&v| v == 0.25), "{:?}", raster.row(y));
        }
        assert!(seed_raster(&view, &camera, &[], 20, 10, 1).data().iter().all(|&v| v == 0.0));
    }
}
