//! A textured scene with known geometry, ray-cast: a slanted wall and a sphere in front of it.
#![allow(dead_code, reason = "each test file uses a part")]

use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rayon::prelude::*;
use scene::{Camera, CameraModel, ImageId, Raster, Rigid3};

/// Points of the wall: WALL . x = WALL_OFFSET.
const WALL: Vector3<f64> = Vector3::new(0.2, -0.1, 1.0);
const WALL_OFFSET: f64 = 6.0;
const CENTRE: Vector3<f64> = Vector3::new(0.3, 0.1, 4.0);
const RADIUS: f64 = 0.8;

/// How the scene looks.
#[derive(Clone, Copy, PartialEq)]
pub enum Look {
    Textured,
    /// Everything has one colour.
    Bare,
}

/// Distance along the unit `direction` and unit normal of the first surface.
pub fn cast(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let to_centre = CENTRE - origin;
    let along = to_centre.dot(direction);
    let inside = RADIUS * RADIUS - (to_centre.norm_squared() - along * along);
    if inside > 0.0 && along - inside.sqrt() > 0.0 {
        let distance = along - inside.sqrt();
        return Some((distance, (origin + direction * distance - CENTRE) / RADIUS));
    }
    let distance = (WALL_OFFSET - WALL.dot(origin)) / WALL.dot(direction);
    (distance > 0.0 && distance < 50.0).then(|| (distance, -WALL.normalize()))
}

/// Distance of a point to the nearest surface.
pub fn distance_to_surface(x: &Vector3<f64>) -> f64 {
    ((x - CENTRE).norm() - RADIUS).abs().min((WALL.dot(x) - WALL_OFFSET).abs() / WALL.norm())
}

/// Smooth noise in 0..=1 that changes over about one unit.
fn noise(x: Vector3<f64>, seed: u64) -> f64 {
    let cell = x.map(f64::floor);
    let f = (x - cell).map(|t| t * t * (3.0 - 2.0 * t));
    let corner = |i: i64, j: i64, k: i64| {
        let mut h = seed;
        for v in [cell.x as i64 + i, cell.y as i64 + j, cell.z as i64 + k] {
            h = (h ^ v as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            h ^= h >> 29;
        }
        (h.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / 16_777_216.0
    };
    let mix = |a: f64, b: f64, t: f64| a + t * (b - a);
    let face = |k| mix(mix(corner(0, 0, k), corner(1, 0, k), f.x), mix(corner(0, 1, k), corner(1, 1, k), f.x), f.y);
    mix(face(0), face(1), f.z)
}

fn colour(x: &Vector3<f64>, look: Look) -> [f64; 3] {
    if look == Look::Bare {
        return [120.0; 3];
    }
    let base = 0.4 * noise(x * 3.0, 1) + 0.35 * noise(x * 8.0, 2) + 0.25 * noise(x * 20.0, 3);
    [30.0 + 200.0 * base, 20.0 + 190.0 * base, 60.0 + 120.0 * noise(x * 6.0, 4)]
}

/// A view from `position`, turned by `turn` (axis times angle) from looking along +z.
pub fn view(id: usize, camera: Camera, position: [f64; 3], turn: [f64; 3], look: Look) -> View {
    scaled_view(id, camera, position, turn, look, 1.0)
}

/// The ray of a pixel in the frame of the camera, in water if that is behind a port: a point and the unit direction.
fn water_ray(camera: &Camera, pixel: &Vector2<f64>) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let in_air = camera.in_air().ray(pixel)?;
    let Some(port) = camera.port() else { return Some((Vector3::zeros(), in_air)) };
    let at = |object_distance_m| scene::FlatPort { object_distance_m, ..*port }.point_at_object_distance(&in_air);
    let (near, far) = (at(0.1)?, at(1.0)?);
    Some((near, (far - near).normalize()))
}

/// The same of the scene `scale` times as large, from a position `scale` times as far.
pub fn scaled_view(id: usize, camera: Camera, position: [f64; 3], turn: [f64; 3], look: Look, scale: f64) -> View {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    let position = Vector3::from(position);
    let cam_from_world = Rigid3::new(rotation, -(rotation * position) * scale);
    let (w, h) = (camera.width() as usize, camera.height() as usize);
    let pixel = |i: usize| {
        let mut sum = [0.0; 3];
        // Four rays a pixel against aliasing.
        for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
            let Some((from, ray)) = water_ray(&camera, &Vector2::new((i % w) as f64 + dx, (i / w) as f64 + dy)) else { continue };
            let (origin, direction) = (position + rotation.inverse() * from / scale, rotation.inverse() * ray);
            if let Some((distance, _)) = cast(&origin, &direction) {
                let c = colour(&(origin + direction * distance), look);
                sum = [0, 1, 2].map(|k| sum[k] + c[k] / 4.0);
            }
        }
        // Sensor noise, uniform with a deviation of about 0.6 grey levels.
        let noise = noise(Vector3::new(i as f64, 0.0, 0.0), 77 + id as u64) * 2.0 - 1.0;
        sum.map(|v| (v + noise + 0.5).clamp(0.0, 255.0) as u8)
    };
    let rgb = Raster::from_vec(w, h, (0..w * h).into_par_iter().map(pixel).collect()).expect("one value a pixel");
    View { image: ImageId::new(id), camera, cam_from_world, rgb, mask: None }
}

pub use dense::View;

pub fn pinhole() -> Camera {
    Camera::from_focal(CameraModel::Pinhole, 200, 150, 190.0).expect("valid")
}

/// Five views around the reference, which is the first.
pub fn views(camera: Camera, look: Look) -> Vec<View> {
    let at = [[0.0, 0.0, 0.0], [-0.6, 0.0, 0.1], [0.6, 0.1, 0.0], [0.0, 0.6, -0.2], [0.1, -0.5, 0.0]];
    let turn = [[0.0, 0.0, 0.0], [0.0, -0.1, 0.02], [0.0, 0.1, 0.0], [0.1, 0.0, 0.0], [-0.08, 0.0, -0.05]];
    (0..5).map(|i| view(i, camera, at[i], turn[i], look)).collect()
}

/// The same of the scene `scale` times as large.
pub fn scaled_views(camera: Camera, scale: f64) -> Vec<View> {
    let poses = views(pinhole(), Look::Bare);
    let pose = |v: &View| (v.cam_from_world.centre().into(), v.cam_from_world.rotation.scaled_axis().into());
    poses.iter().map(pose).enumerate().map(|(i, (at, turn))| scaled_view(i, camera, at, turn, Look::Textured, scale)).collect()
}

/// How a depth map compares with the scene.
#[derive(Debug)]
pub struct Truth {
    /// Share of the pixels with a depth.
    pub known: f64,
    /// Share of the known depths within 1 %.
    pub within_1_percent: f64,
    /// Median relative error.
    pub median_error: f64,
    /// Median angle between normals, degrees.
    pub median_normal_deg: f64,
}

pub fn compare(map: &dense::DepthMap) -> Truth {
    let (w, h) = (map.depth.width(), map.depth.height());
    let world_from_cam = map.cam_from_world.inverse();
    let (mut errors, mut angles) = (Vec::new(), Vec::new());
    for (x, y) in (0..w * h).map(|i| (i % w, i / w)) {
        let z = f64::from(map.depth[(x, y)]);
        let ray = map.camera.ray(&Vector2::new(x as f64 + 0.5, y as f64 + 0.5)).expect("pinhole");
        let truth = cast(&map.cam_from_world.centre(), &(world_from_cam.rotation * ray));
        if let Some((distance, normal)) = truth.filter(|_| z > 0.0) {
            errors.push((z / (distance * ray.z) - 1.0).abs());
            let found = world_from_cam.rotation * Vector3::from(map.normal[(x, y)].map(f64::from));
            angles.push(found.angle(&normal).to_degrees());
        }
    }
    let count = errors.len().max(1) as f64;
    let within_1_percent = errors.iter().filter(|e| **e < 0.01).count() as f64 / count;
    let median = |values: &mut Vec<f64>| {
        values.sort_unstable_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::INFINITY)
    };
    Truth {
        known: errors.len() as f64 / (w * h) as f64,
        within_1_percent,
        median_error: median(&mut errors),
        median_normal_deg: median(&mut angles),
    }
}
