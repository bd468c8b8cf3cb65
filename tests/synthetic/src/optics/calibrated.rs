//! The camera that a calibration in water gives: one projection centre and Brown's distortion, which take up what lens and window do.

use super::{Lens, Window};
use nalgebra::{Vector2, Vector3};
use scene::Camera;

/// Points of the calibration along each side of the frame.
const GRID: usize = 25;

/// An interior orientation calibrated in water.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// The camera.
    pub camera: Camera,
    /// What is left of the refraction at the distance of the calibration: root mean square over the frame, pixels.
    pub rms_px: f64,
    /// The largest of it, pixels.
    pub max_px: f64,
}

/// Fits Brown's model to what a lens sees through a window, at one distance from the camera.
///
/// Least squares on a grid of pixels that are followed to the sphere of that distance. Without a window it finds the lens itself.
/// `None` when the normal equations are singular, which frames of a few pixels lead to.
#[must_use]
pub fn calibrate(lens: &Lens, window: Option<&Window>, width: u32, height: u32, distance_m: f64) -> Option<Calibrated> {
    let (w, h) = (f64::from(width), f64::from(height));
    let mut seen = Vec::new();
    for j in 0..GRID {
        for i in 0..GRID {
            let pixel = Vector2::new(w * i as f64, h * j as f64) / (GRID - 1) as f64;
            let [u, v] = lens.tangents(pixel.x, pixel.y);
            let air = Vector3::new(u, v, 1.0).normalize();
            let (origin, direction) = window.map_or((Vector3::zeros(), air), |window| window.leave(&air));
            seen.push((pixel, origin + distance_m * direction));
        }
    }
    let start = lens.focal_px * window.map_or(1.0, |window| window.indices[2] / window.indices[0]);
    let camera = Camera::fit_brown(width, height, start, &seen)?;
    let misses: Vec<f64> = seen.iter().map(|(pixel, point)| camera.project(point).map(|p| (p - pixel).norm())).collect::<Option<_>>()?;
    let rms_px = (misses.iter().map(|m| m * m).sum::<f64>() / misses.len() as f64).sqrt();
    Some(Calibrated { camera, rms_px, max_px: misses.into_iter().fold(0.0, f64::max) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Lens = Lens { focal_px: 1000.0, axis_px: [963.0, 596.0], radial: [-0.09, 0.008], tangential: [1e-4, 2e-4] };

    #[test]
    fn without_a_window_the_lens_is_found() {
        let found = calibrate(&LENS, None, 1920, 1200, 3.0).expect("regular");
        let expected = [1000.0, 963.0, 596.0, -0.09, 0.008, 0.0, 1e-4, 2e-4, 0.0, 0.0];
        for (found, expected) in found.camera.params().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-7 * expected.abs().max(1.0), "{found} {expected}");
        }
        assert!(found.max_px < 1e-7);
    }

    #[test]
    fn in_water_the_principal_distance_is_a_third_longer() {
        let window = Window {
            normal: Vector3::new(0.008, -0.005, 1.0).normalize(),
            distance_m: 0.02,
            thickness_m: 0.008_42,
            indices: [1.0, 1.491, 1.3414],
        };
        let found = calibrate(&LENS, Some(&window), 1920, 1200, 3.5).expect("regular");
        // 1.34 x 4.8 mm = 6.43 mm to first order; Rofallski et al. 2020 found 6.71 to 6.74 mm with f nominal.
        assert!((found.camera.params()[0] / 1341.4 - 1.0).abs() < 0.01, "{:?}", found.camera);
        // The window's own polynomial has a pole at the angle of total reflection: three radial terms leave 2 px in the corners of a field
        // of view of 88 degrees, as they do for real surveys.
        assert!(found.rms_px < 0.4 && found.max_px < 2.0, "{} {}", found.rms_px, found.max_px);
    }
}
