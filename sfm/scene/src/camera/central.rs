//! Brown's model fitted to what somebody sees: a camera of one projection centre that stands for one behind a port.

use super::model::{Camera, CameraModel};
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

/// Parameters that are fitted: c x0 y0 A1 A2 A3 B1 B2. Affinity and shear stay zero.
const FITTED: usize = 8;
/// Gauss-Newton steps: distortion is nearly linear in its parameters, and a third as many settle.
const ROUNDS: usize = 12;
/// Points along each side of the image.
const GRID: usize = 25;

impl Camera {
    /// The camera of Brown's model, without a port, that fits points in the camera's frame at their pixels best (least squares, Gauss-Newton). `focal_px` is the start of its
    /// principal distance.
    ///
    /// `None` where the points do not determine it.
    #[must_use]
    pub fn fit_brown(width: u32, height: u32, focal_px: f64, seen: &[(Vector2<f64>, Vector3<f64>)]) -> Option<Self> {
        let mut camera = Self::from_focal(CameraModel::Brown, width, height, focal_px).ok()?;
        for _ in 0..ROUNDS {
            let mut normal = SMatrix::<f64, FITTED, FITTED>::zeros();
            let mut right = SVector::<f64, FITTED>::zeros();
            for (pixel, point) in seen {
                let projected = camera.project_with_jacobians(point)?;
                let jacobian = projected.d_params.fixed_columns::<FITTED>(0);
                normal += jacobian.transpose() * jacobian;
                right += jacobian.transpose() * (pixel - projected.pixel);
            }
            let step = normal.cholesky()?.solve(&right);
            camera.params_mut().iter_mut().zip(step.iter()).for_each(|(p, s)| *p += s);
        }
        Self::new(CameraModel::Brown, width, height, camera.params()).ok()
    }

    /// A camera without a port that stands for this one: itself where it has none, else Brown's model fitted over the image at the port's
    /// object distance. Distortion takes up what it can of the refraction there; elsewhere it is off by up to some pixels. Where no
    /// such model fits, as with lenses that see more than half a sphere in air, it has the principal distance and point alone.
    #[must_use]
    pub fn central(&self) -> Self {
        let Some(port) = self.port() else { return *self };
        let (w, h) = (f64::from(self.width()), f64::from(self.height()));
        let mut seen = Vec::with_capacity(GRID * GRID);
        for j in 0..GRID {
            for i in 0..GRID {
                let pixel = Vector2::new(w * i as f64, h * j as f64) / (GRID - 1) as f64;
                let in_air = self.in_air().unproject(&pixel);
                seen.extend(in_air.and_then(|uv| Some((pixel, port.point_at_object_distance(&uv.push(1.0))?))));
            }
        }
        Self::fit_brown(self.width(), self.height(), self.mean_focal(), &seen).unwrap_or_else(|| self.without_distortion())
    }

    /// Brown's model with this camera's principal distance in the water, its principal point, and no distortion.
    fn without_distortion(&self) -> Self {
        let [x0, y0] = self.principal_point();
        let params = [self.mean_focal(), x0, y0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self::new(CameraModel::Brown, self.width(), self.height(), &params).unwrap_or_else(|_| self.in_air())
    }
}

#[cfg(test)]
mod tests {
    use super::super::FlatPort;
    use super::*;

    #[test]
    fn a_port_is_absorbed_at_its_object_distance_and_not_elsewhere() {
        let lens =
            Camera::new(CameraModel::Brown, 1920, 1200, &[1000.0, 963.0, 596.0, -0.09, 0.008, 0.0, 1e-4, 2e-4, 0.0, 0.0]).expect("valid");
        let port = FlatPort {
            normal: nalgebra::Unit::new_normalize(Vector3::new(0.008, -0.005, 1.0)),
            distance_m: 0.02,
            thickness_m: 0.008_42,
            index_air: 1.0,
            index_port: 1.491,
            index_water: 1.3414,
            object_distance_m: 3.5,
        };
        let camera = lens.behind(Some(port)).expect("possible");
        let central = camera.central();
        assert_eq!((central.port(), central.model()), (None, CameraModel::Brown));
        let miss = |x: &Vector3<f64>| (camera.project(x).expect("seen") - central.project(x).expect("seen")).norm();
        let direction = Vector3::new(0.35, 0.2, 1.0).normalize();
        // Three radial terms leave some tenths of a pixel within the image; half the distance moves a point by several.
        assert!(miss(&(3.5 * direction)) < 0.6, "{}", miss(&(3.5 * direction)));
        assert!(miss(&(0.5 * direction)) > 2.0, "{}", miss(&(0.5 * direction)));
        assert_eq!(lens.central(), lens);
        // Corners beyond what the lens images are left out of the fit; one that images nothing there still has a central camera.
        for k in [-0.4, -2.0] {
            let narrow = Camera::new(CameraModel::SimpleRadial, 1920, 1200, &[1000.0, 960.0, 600.0, k]).expect("valid");
            let central = narrow.behind(Some(port)).expect("possible").central();
            let focal = central.params()[0];
            assert!(central.port().is_none() && (1000.0..1800.0).contains(&focal), "{k}: {central:?}");
        }
    }
}
