//! What dense matching finds in one image.

use crate::RayOffsets;
use nalgebra::{Vector2, Vector3};
use scene::{Camera, ImageId, Raster, Rigid3};

/// Each step leaves the share of the error by which offsets grow over the distance: centimetres over decimetres.
const PROJECTION_STEPS: usize = 3;

/// Depth, normal and confidence at the pixels of a distortion-free version of an image.
///
/// It carries its own camera, pose and colours, so that fusion needs nothing else. Normals and confidences hold only values that the
/// serialised form keeps: a map that was stored and read is the same map.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// The image.
    pub image: ImageId,
    /// A [`scene::CameraModel::Pinhole`] of the size of the rasters.
    pub camera: Camera,
    /// Pose of the image.
    pub cam_from_world: Rigid3,
    /// Behind a port, where the rays of the pixels pass; else they pass the projection centre.
    pub offsets: Option<RayOffsets>,
    /// The images that it was matched with, best first.
    pub neighbours: Vec<ImageId>,
    /// z in the camera frame, 0 where it is unknown.
    pub depth: Raster<f32>,
    /// Unit normals in the camera frame, towards the camera; 0 where the depth is unknown.
    pub normal: Raster<[f32; 3]>,
    /// Normalised correlation with the best neighbours in 0..=1, in steps of 1/255; 0 where the depth is unknown.
    pub confidence: Raster<f32>,
    /// sRGB colours; black where the depth is unknown.
    pub rgb: Raster<[u8; 3]>,
}

impl DepthMap {
    /// Number of pixels with a depth.
    #[must_use]
    pub fn known(&self) -> usize {
        self.depth.data().iter().filter(|&&z| z > 0.0).count()
    }

    /// Median of the known depths.
    #[must_use]
    pub fn median_depth(&self) -> Option<f64> {
        let mut depths: Vec<f32> = self.depth.data().iter().copied().filter(|&z| z > 0.0).collect();
        if depths.is_empty() {
            return None;
        }
        let middle = depths.len() / 2;
        Some(f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1))
    }

    /// Point in the camera frame of a pixel; `None` outside and where the depth is unknown.
    #[must_use]
    pub fn point_in_cam(&self, x: usize, y: usize) -> Option<Vector3<f64>> {
        let z = f64::from(*self.depth.get(x, y)?);
        (z > 0.0).then(|| self.along_ray(&Vector2::new(x as f64 + 0.5, y as f64 + 0.5), z))
    }

    /// The point with this z on the ray of a place in the raster.
    pub(crate) fn along_ray(&self, pixel: &Vector2<f64>, z: f64) -> Vector3<f64> {
        ray(&self.camera, pixel.x, pixel.y) * z + self.offset(pixel)
    }

    /// Where the ray of a place in the raster passes the plane z = 0.
    pub(crate) fn offset(&self, pixel: &Vector2<f64>) -> Vector3<f64> {
        self.offsets.as_ref().map_or(Vector3::zeros(), |o| o.at(pixel).push(0.0))
    }

    /// The place in the raster of a point in front of the camera, in its frame.
    pub(crate) fn project(&self, x_in_cam: &Vector3<f64>) -> Vector2<f64> {
        let p = self.camera.params();
        let at = |x: f64, y: f64| Vector2::new(p[0] * x / x_in_cam.z + p[2], p[1] * y / x_in_cam.z + p[3]);
        let mut pixel = at(x_in_cam.x, x_in_cam.y);
        if let Some(offsets) = &self.offsets {
            for _ in 0..PROJECTION_STEPS {
                let o = offsets.at(&pixel);
                pixel = at(x_in_cam.x - o.x, x_in_cam.y - o.y);
            }
        }
        pixel
    }
}

/// Direction with z = 1 of a place of a pinhole image.
pub(crate) fn ray(camera: &Camera, x: f64, y: f64) -> Vector3<f64> {
    let p = camera.params();
    Vector3::new((x - p[2]) / p[0], (y - p[3]) / p[1], 1.0)
}

/// Ground sample distance at the median depth of a map: what one pixel of the working resolution covers on a surface that faces the camera,
/// in metres where the scale is metric. `None` when nothing is known.
#[must_use]
pub fn ground_sample_distance(map: &DepthMap) -> Option<f64> {
    Some(map.median_depth()? / map.camera.mean_focal())
}

/// Removes connected groups of fewer than `min_pixels` pixels. Pixels are connected with their four neighbours where depths differ by less
/// than `tolerance` of the smaller one.
pub(crate) fn remove_small_segments(depth: &mut Raster<f32>, min_pixels: usize, tolerance: f32) {
    let (w, h) = (depth.width(), depth.height());
    let mut visited = vec![false; w * h];
    let mut segment = Vec::new();
    for start in 0..w * h {
        if visited[start] || depth.data()[start] <= 0.0 {
            continue;
        }
        segment.clear();
        segment.push(start);
        visited[start] = true;
        let mut next = 0;
        while let Some(&at) = segment.get(next) {
            next += 1;
            let (x, y) = (at % w, at / w);
            let z = depth.data()[at];
            let around = [(x > 0, at.wrapping_sub(1)), (x + 1 < w, at + 1), (y > 0, at.wrapping_sub(w)), (y + 1 < h, at + w)];
            for (_, other) in around.into_iter().filter(|(inside, _)| *inside) {
                let other_z = depth.data()[other];
                if !visited[other] && other_z > 0.0 && (other_z - z).abs() < tolerance * z.min(other_z) {
                    visited[other] = true;
                    segment.push(other);
                }
            }
        }
        if segment.len() < min_pixels {
            for &at in &segment {
                depth.data_mut()[at] = 0.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::CameraModel;

    #[test]
    fn small_segments_go_and_large_ones_stay() {
        let mut depth = Raster::filled(20, 10, 0.0f32);
        for y in 0..10 {
            depth.row_mut(y)[..8].fill(2.0 + 0.01 * y as f32);
        }
        depth[(12, 5)] = 2.0;
        depth[(13, 5)] = 2.0;
        // Inside the large segment, but at another depth.
        depth[(4, 4)] = 5.0;
        remove_small_segments(&mut depth, 10, 0.02);
        assert_eq!(depth.data().iter().filter(|&&z| z > 0.0).count(), 79);
        assert_eq!((depth[(12, 5)], depth[(4, 4)]), (0.0, 0.0));
    }

    #[test]
    fn ground_sample_distance_is_depth_over_focal_length() {
        let camera = Camera::new(CameraModel::Pinhole, 4, 1, &[200.0, 200.0, 2.0, 0.5]).expect("valid");
        let mut map = DepthMap {
            image: ImageId(0),
            camera,
            cam_from_world: Rigid3::identity(),
            offsets: None,
            neighbours: Vec::new(),
            depth: Raster::from_vec(4, 1, vec![0.0, 2.0, 4.0, 9.0]).expect("four"),
            normal: Raster::filled(4, 1, [0.0; 3]),
            confidence: Raster::filled(4, 1, 0.0),
            rgb: Raster::filled(4, 1, [0; 3]),
        };
        assert_eq!(ground_sample_distance(&map), Some(0.02));
        assert_eq!(map.point_in_cam(3, 0), Some(Vector3::new(9.0 * 1.5 / 200.0, 0.0, 9.0)));
        assert_eq!((map.point_in_cam(0, 0), map.known()), (None, 3));
        map.depth.data_mut().fill(0.0);
        assert_eq!(ground_sample_distance(&map), None);
    }
}
