//! The cameras of a dive: where they are and what they see of the water.

use super::options::{CameraOptions, DiveOptions, PortKind, RigOptions};
use crate::appearance::Jerlov;
use crate::optics::{Calibrated, Lens, Window, calibrate, refractive_index};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use scene::{Camera, CameraModel, Rigid3};

/// Wavelength of the refractive indices: green, in the middle of what a camera sees (as Rofallski et al. 2020).
const WAVELENGTH_NM: f64 = 540.0;

/// A camera model that misses the lens by more, as a share of the width of the frame, is none.
const MOST_RMS: f64 = 0.005;

/// One camera of the rig.
#[derive(Clone, Debug)]
pub struct DiveCamera {
    /// Its pose in the rig.
    pub cam_from_rig: Rigid3,
    /// The interior orientation in air.
    pub in_air: Camera,
    /// The interior orientation as a calibration in the water finds it; without a window the one in air.
    pub calibrated: Calibrated,
    pub(super) lens: Lens,
    window: Option<Window>,
}

impl DiveCamera {
    fn new(options: &CameraOptions, rig: &RigOptions, index_water: f64, distance_m: f64) -> Result<Self, String> {
        let px_per_mm = f64::from(rig.width) / rig.sensor_width_mm;
        let (w, h) = (f64::from(rig.width), f64::from(rig.height));
        let lens = Lens {
            focal_px: options.focal_mm * px_per_mm,
            axis_px: [w / 2.0 + options.axis_mm[0] * px_per_mm, h / 2.0 + options.axis_mm[1] * px_per_mm],
            radial: options.radial,
            tangential: options.tangential,
        };
        let port = &rig.port;
        let window = (port.kind == PortKind::Flat).then(|| Window {
            normal: Vector3::new(options.port_tilt_deg[0].to_radians().tan(), options.port_tilt_deg[1].to_radians().tan(), 1.0).normalize(),
            distance_m: options.port_distance_m,
            thickness_m: port.thickness_mm / 1000.0,
            indices: [1.0, port.index, index_water],
        });
        let ([x0, y0], [a1, a2], [b1, b2]) = (lens.axis_px, lens.radial, lens.tangential);
        let in_air = Camera::new(CameraModel::Brown, rig.width, rig.height, &[lens.focal_px, x0, y0, a1, a2, 0.0, b1, b2, 0.0, 0.0])
            .map_err(|e| e.to_string())?;
        let calibrated = calibrate(&lens, window.as_ref(), rig.width, rig.height, distance_m)
            .filter(|c| c.rms_px < MOST_RMS * f64::from(rig.width))
            .ok_or("the lens cannot be described by a camera model: its distortion is too strong for its field of view")?;
        let rotation = rotation(options.turn_deg);
        let cam_from_rig = Rigid3::new(rotation, -(rotation * Vector3::from(options.centre_m)));
        Ok(Self { cam_from_rig, in_air, calibrated, lens, window })
    }

    /// The window in water of a refractive index.
    #[must_use]
    pub fn window(&self, index_water: f64) -> Option<Window> {
        self.window.map(|window| Window { indices: [window.indices[0], window.indices[1], index_water], ..window })
    }

    /// Where a point in the frame of the camera is seen, in water of a refractive index: by the camera models of package `scene`.
    #[must_use]
    pub fn project(&self, x_in_cam: &Vector3<f64>, index_water: f64) -> Option<Vector2<f64>> {
        match self.window(index_water) {
            Some(window) => window.port().project(&self.in_air, x_in_cam),
            None => self.in_air.project(x_in_cam),
        }
    }
}

/// All cameras of a dive, calibrated at a distance.
pub(crate) fn cameras(options: &DiveOptions, distance_m: f64) -> Result<Vec<DiveCamera>, String> {
    let index = index_at(options, options.water.depth_m);
    options.rig.cameras.iter().map(|camera| DiveCamera::new(camera, &options.rig, index, distance_m)).collect()
}

/// Refractive index of the dive's water at a depth; of air where there is no water.
pub(super) fn index_at(options: &DiveOptions, depth_m: f64) -> f64 {
    match options.water.jerlov {
        Jerlov::Air => 1.0,
        _ => refractive_index(WAVELENGTH_NM, options.water.temperature_degc, options.water.salinity_ppt, depth_m.max(0.0)),
    }
}

/// `cam_from_rig` of a camera turned to the right, then up, then clockwise (seen from behind).
fn rotation(turn_deg: [f64; 3]) -> UnitQuaternion<f64> {
    let [right, up, clockwise] = turn_deg.map(f64::to_radians);
    let rig_from_cam = UnitQuaternion::from_scaled_axis(Vector3::y() * right)
        * UnitQuaternion::from_scaled_axis(Vector3::x() * up)
        * UnitQuaternion::from_scaled_axis(Vector3::z() * clockwise);
    rig_from_cam.inverse()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_go_where_they_say() {
        let axis = |turn: [f64; 3]| rotation(turn).inverse() * Vector3::z();
        assert!(axis([10.0, 0.0, 0.0]).x > 0.17, "to the right");
        assert!(axis([0.0, 10.0, 0.0]).y < -0.17, "up is -y");
        let right = rotation([0.0, 0.0, 10.0]).inverse() * Vector3::x();
        assert!(right.y > 0.17, "clockwise: the right side sinks");
        assert!((axis([180.0, 0.0, 0.0]) + Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn two_cameras_look_forward_and_one_back() {
        let cameras = cameras(&DiveOptions::default(), 3.5).expect("the default is possible");
        let axis = |c: usize| cameras[c].cam_from_rig.rotation.inverse() * Vector3::z();
        assert!(axis(0).z > 0.99 && axis(1).z > 0.99 && axis(2).z < -0.8 && axis(2).y > 0.4);
        assert!((cameras[1].cam_from_rig.centre().norm() - 0.4).abs() < 1e-4);
        // Principal distance in water over that in air: the index, to a percent.
        let c = cameras[0].calibrated.camera.params()[0];
        assert!((c / cameras[0].in_air.params()[0] / 1.341 - 1.0).abs() < 0.01, "{c}");
    }
}
