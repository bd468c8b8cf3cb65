//! Targets with a known centre.

use crate::gaussian_blur;
use nalgebra::{Matrix2, Matrix3, SymmetricEigen, UnitQuaternion, Vector2, Vector3};
use scene::{Camera, Raster};

/// Samples along a side of a pixel.
const SAMPLES: usize = 16;

/// An image of what `grey` has at each place, averaged over a Gaussian of `blur_px` and over the squares of the pixels.
pub(super) fn rendered(width: usize, height: usize, blur_px: f64, grey: impl Fn(Vector2<f64>) -> f64) -> Raster<f32> {
    let (w, h) = (width * SAMPLES, height * SAMPLES);
    let place = |i: usize| (i as f64 + 0.5) / SAMPLES as f64;
    let values = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| grey(Vector2::new(place(x), place(y))) as f32).collect();
    let fine = Raster::from_vec(w, h, values).expect("one value a sample");
    let fine = gaussian_blur(&fine, (blur_px * SAMPLES as f64) as f32);
    let mean = |x: usize, y: usize| {
        let rows = (0..SAMPLES).flat_map(|j| &fine.row(y * SAMPLES + j)[x * SAMPLES..(x + 1) * SAMPLES]);
        rows.map(|v| f64::from(*v)).sum::<f64>() / (SAMPLES * SAMPLES) as f64
    };
    let values = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| mean(x, y) as f32).collect();
    Raster::from_vec(width, height, values).expect("one value a pixel")
}

/// Radius of a place in an ellipse with semi-axes a and b, turned: 1 on its edge.
pub(super) fn radius(at: Vector2<f64>, centre: [f64; 2], [a, b]: [f64; 2], turn: f64) -> f64 {
    let (d, (sin, cos)) = (at - Vector2::from(centre), turn.sin_cos());
    ((cos * d.x + sin * d.y) / a).hypot((cos * d.y - sin * d.x) / b)
}

/// Normal noise, the same for the same seed.
pub(super) struct Noise(u64);

impl Noise {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// SplitMix64 (Steele, Lea & Flood, OOPSLA 2014).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Box and Muller.
    pub(super) fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    pub(super) fn added(&mut self, image: &Raster<f32>, sigma: f64) -> Raster<f32> {
        image.map(|v| v + (sigma * self.normal()) as f32)
    }
}

/// The conic `x^T C x = 0` of the image of a circle, in pixels: from the plane of the circle by its homography.
pub(super) fn circle_image(camera: &Camera, centre: &Vector3<f64>, normal: &Vector3<f64>, radius: f64) -> Matrix3<f64> {
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), normal)
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
    let p = camera.params();
    let k = Matrix3::new(p[0], 0.0, p[2], 0.0, p[1], p[3], 0.0, 0.0, 1.0);
    let image_from_plane = k * Matrix3::from_columns(&[turn * Vector3::x(), turn * Vector3::y(), *centre]);
    let plane_from_image = image_from_plane.try_inverse().expect("seen from the front");
    plane_from_image.transpose() * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -radius * radius)) * plane_from_image
}

/// Centre and semi-axes of an ellipse, the longer one first.
pub(super) fn conic_centre_and_axes(conic: &Matrix3<f64>) -> (Vector2<f64>, [[f64; 2]; 2]) {
    let square: Matrix2<f64> = conic.fixed_view::<2, 2>(0, 0).into();
    let centre = -square.try_inverse().expect("an ellipse") * conic.fixed_view::<2, 1>(0, 2);
    let at_centre = (conic * centre.push(1.0)).dot(&centre.push(1.0));
    let eigen = SymmetricEigen::new(-square / at_centre);
    let axis = |k: usize| eigen.eigenvectors.column(k) / eigen.eigenvalues[k].sqrt();
    let (a, b) = if eigen.eigenvalues[0] < eigen.eigenvalues[1] { (axis(0), axis(1)) } else { (axis(1), axis(0)) };
    (centre, [[a[0], a[1]], [b[0], b[1]]])
}
