//! Local planes seen from a pinhole camera.

use scene::Camera;

/// Interior orientation of a pinhole in index coordinates, where the centre of the top-left pixel is (0, 0).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pinhole {
    pub fx: f32,
    pub fy: f32,
    pub cx: f32,
    pub cy: f32,
}

impl Pinhole {
    /// From the first four parameters of a [`scene::CameraModel::Pinhole`], at 1 / 2^`level` of its size.
    pub fn at_level(camera: &Camera, level: u32) -> Self {
        let s = 0.5f64.powi(level as i32);
        let p = camera.params();
        Self { fx: (p[0] * s) as f32, fy: (p[1] * s) as f32, cx: (p[2] * s - 0.5) as f32, cy: (p[3] * s - 0.5) as f32 }
    }
}

/// A plane at a pixel (x, y): 1/z = w + gx (x' - x) + gy (y' - y) at a pixel (x', y').
///
/// A plane n . X = d has 1/z = n . K^-1 (x, y, 1) / d: linear in pixel coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plane {
    /// Inverse depth at the pixel.
    pub w: f32,
    /// Its change a pixel along x.
    pub gx: f32,
    /// Its change a pixel along y.
    pub gy: f32,
}

impl Plane {
    /// The same plane, at the pixel (dx, dy) further.
    #[inline(always)]
    pub fn moved(self, dx: f32, dy: f32) -> Self {
        Self { w: self.w + self.gx * dx + self.gy * dy, ..self }
    }

    /// The normal over the distance to the origin, n / d: points away from the camera, and n / d . (direction with z = 1) = w.
    #[inline(always)]
    pub fn normal_over_distance(self, k: &Pinhole, x: f32, y: f32) -> [f32; 3] {
        [self.gx * k.fx, self.gy * k.fy, self.w + self.gx * (k.cx - x) + self.gy * (k.cy - y)]
    }

    /// Unit normal in the camera frame, towards the camera.
    pub fn normal(self, k: &Pinhole, x: f32, y: f32) -> [f32; 3] {
        let n = self.normal_over_distance(k, x, y);
        let norm = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        n.map(|v| -v / norm)
    }

    /// Square of the cosine between the normal and the ray through the pixel (x, y); `w` is positive.
    #[inline(always)]
    pub fn squared_cosine(self, k: &Pinhole, x: f32, y: f32) -> f32 {
        let n = self.normal_over_distance(k, x, y);
        let (u, v) = ((x - k.cx) / k.fx, (y - k.cy) / k.fy);
        self.w * self.w / ((n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) * (u * u + v * v + 1.0))
    }
}
