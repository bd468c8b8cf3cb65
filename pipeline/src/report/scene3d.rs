//! Points and cameras for the 3D view, packed small.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Point3;
use scene::Rigid3;
use serde_json::{Value, json};

/// Points shown at most in one set; more are thinned evenly.
const MAX_POINTS: usize = 250_000;
/// Share of the points cut off at each side before the extent is taken: stray points must not shrink the scene.
const EXTENT_QUANTILE: f64 = 0.005;
/// Points further out than this many extents from the middle are left out.
const MAX_EXTENTS: f64 = 3.0;

/// Coloured points.
#[derive(Clone, Debug, Default)]
pub struct PointSet {
    /// Name in the view.
    pub name: String,
    /// Positions in the world.
    pub positions: Vec<Point3<f64>>,
    /// sRGB, one a position.
    pub colours: Vec<[u8; 3]>,
}

/// An oriented image.
#[derive(Clone, Debug)]
pub struct CameraGlyph {
    /// Name of the image.
    pub name: String,
    /// Pose.
    pub cam_from_world: Rigid3,
    /// Half width and half height of the image at unit distance.
    pub half_extent: [f64; 2],
}

/// What the 3D view shows.
#[derive(Clone, Debug, Default)]
pub struct Scene3d {
    /// Clouds, the one shown first at the front.
    pub sets: Vec<PointSet>,
    /// Cameras.
    pub cameras: Vec<CameraGlyph>,
    /// Unit of the world: `m`, or what says that it is unknown.
    pub unit: String,
}

/// The scene as JSON: positions as 16-bit steps of a cube around the scene, colours as bytes, both in base64.
pub(super) fn packed(scene: &Scene3d) -> Value {
    let (centre, half) = extent(scene);
    let sets: Vec<Value> = scene.sets.iter().map(|set| packed_set(set, &centre, half)).collect();
    let cameras: Vec<Value> = scene
        .cameras
        .iter()
        .map(|camera| {
            let world_from_cam = camera.cam_from_world.inverse();
            let r = world_from_cam.rotation_matrix();
            let c = (world_from_cam.translation - centre.coords) / half;
            // Six decimals of the extent are a micrometre at a metre: enough to draw.
            let round = |v: f64| (v * 1e6).round() / 1e6;
            json!({
                "name": camera.name,
                "centre": [round(c.x), round(c.y), round(c.z)],
                "axes": r.iter().map(|&v| round(v)).collect::<Vec<_>>(),
                "half": [round(camera.half_extent[0]), round(camera.half_extent[1])],
            })
        })
        .collect();
    json!({ "sets": sets, "cameras": cameras, "half": half, "unit": scene.unit })
}

/// Middle and half side of the cube in which most points lie.
fn extent(scene: &Scene3d) -> (Point3<f64>, f64) {
    let all = || scene.sets.iter().flat_map(|s| &s.positions);
    let (mut centre, mut half) = (Point3::origin(), 0.0f64);
    for axis in 0..3 {
        let mut values: Vec<f64> = all().map(|p| p[axis]).filter(|v| v.is_finite()).collect();
        if values.is_empty() {
            continue;
        }
        values.sort_by(f64::total_cmp);
        let cut = (values.len() as f64 * EXTENT_QUANTILE) as usize;
        let (low, high) = (values[cut], values[values.len() - 1 - cut]);
        centre[axis] = (low + high) / 2.0;
        half = half.max((high - low) / 2.0);
    }
    (centre, if half > 0.0 { half } else { 1.0 })
}

fn packed_set(set: &PointSet, centre: &Point3<f64>, half: f64) -> Value {
    let step = set.positions.len().div_ceil(MAX_POINTS).max(1);
    let (mut places, mut colours, mut shown) = (Vec::new(), Vec::new(), 0usize);
    for (position, colour) in set.positions.iter().zip(&set.colours).step_by(step) {
        let place = (position - centre) / half / MAX_EXTENTS;
        if !place.iter().all(|v| v.abs() <= 1.0) {
            continue;
        }
        for v in place.iter() {
            places.extend((((v + 1.0) / 2.0 * 65535.0).round() as u16).to_le_bytes());
        }
        colours.extend(colour);
        shown += 1;
    }
    json!({
        "name": set.name,
        "total": set.positions.len(),
        "shown": shown,
        "extents": MAX_EXTENTS,
        "positions": STANDARD.encode(places),
        "colours": STANDARD.encode(colours),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_survive_packing() {
        let positions: Vec<_> = (0..1000).map(|i| Point3::new(f64::from(i) * 0.01, 5.0 - f64::from(i % 7), 2.0)).collect();
        let scene = Scene3d {
            sets: vec![PointSet { name: "sparse".into(), colours: vec![[1, 2, 3]; 1000], positions: positions.clone() }],
            ..Scene3d::default()
        };
        let (centre, half) = extent(&scene);
        let value = packed(&scene);
        assert_eq!(value["sets"][0]["shown"], 1000);
        let bytes = STANDARD.decode(value["sets"][0]["positions"].as_str().expect("text")).expect("base64");
        for (position, words) in positions.iter().zip(bytes.chunks(6)) {
            for axis in 0..3 {
                let word = u16::from_le_bytes([words[2 * axis], words[2 * axis + 1]]);
                let back = centre[axis] + half * MAX_EXTENTS * (f64::from(word) / 65535.0 * 2.0 - 1.0);
                // Half a step of 2 x 3 extents in 65535.
                assert!((back - position[axis]).abs() <= half * MAX_EXTENTS / 65535.0 * 1.01, "{back} {position}");
            }
        }
    }

    #[test]
    fn an_empty_scene_and_points_that_are_no_numbers_are_no_trouble() {
        assert_eq!(packed(&Scene3d::default())["half"], 1.0);
        let set = PointSet { name: "x".into(), positions: vec![Point3::new(f64::NAN, 0.0, 0.0)], colours: vec![[0; 3]] };
        assert_eq!(packed(&Scene3d { sets: vec![set], ..Scene3d::default() })["sets"][0]["shown"], 0);
    }
}
