//! From a point in the camera frame to a pixel and back.

use super::distortion::distort;
use super::model::{Camera, CameraModel, MAX_CAMERA_PARAMS};
use nalgebra::{Matrix2x3, SMatrix, Vector2, Vector3};

/// Points nearer to the camera's plane than this share of their distance do not project.
const MIN_COSINE: f64 = 1e-6;
/// Newton steps in [`Camera::unproject`]: convergence is quadratic, strong distortion takes 6 to 8.
const MAX_UNPROJECT_STEPS: usize = 30;

/// A projection and its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct ProjectionJacobians {
    /// The pixel.
    pub pixel: Vector2<f64>,
    /// d pixel / d point in the camera frame.
    pub d_point: Matrix2x3<f64>,
    /// d pixel / d parameters; columns beyond the model's number of parameters are zero.
    pub d_params: SMatrix<f64, 2, MAX_CAMERA_PARAMS>,
}

impl Camera {
    /// Focal lengths along x and y.
    fn focals(&self) -> (f64, f64) {
        match self.model {
            CameraModel::Pinhole | CameraModel::OpenCv | CameraModel::Fisheye => (self.params[0], self.params[1]),
            CameraModel::SimpleRadial | CameraModel::Radial | CameraModel::Brown => (self.params[0], self.params[0]),
        }
    }

    /// The pixel of a point in the camera frame.
    ///
    /// `None` behind the camera, on its plane, and where the distortion polynomial has folded back (far outside the
    /// image); behind a port also within the housing. The pixel may lie outside the image.
    #[must_use]
    pub fn project(&self, x_in_cam: &Vector3<f64>) -> Option<Vector2<f64>> {
        match &self.port {
            None => self.project_in_air(x_in_cam),
            Some(port) => self.project_in_air(&port.direction_in_air(x_in_cam)?),
        }
    }

    /// The pixel of a direction from the projection centre: without a port that of any point on it, behind one that of the point at
    /// the port's object distance. [`Camera::unproject`] is its inverse.
    #[must_use]
    pub fn project_direction(&self, direction: &Vector3<f64>) -> Option<Vector2<f64>> {
        match &self.port {
            None => self.project_in_air(direction),
            Some(port) => self.project(&(direction * (port.object_distance_m / direction.norm()))),
        }
    }

    fn project_in_air(&self, x_in_cam: &Vector3<f64>) -> Option<Vector2<f64>> {
        if !in_front(x_in_cam) {
            return None;
        }
        let inverse_z = 1.0 / x_in_cam.z;
        let d = distort(self.model, &self.params, x_in_cam.x * inverse_z, x_in_cam.y * inverse_z)?;
        Some(self.pixel_from_distorted(d.u, d.v))
    }

    fn pixel_from_distorted(&self, u: f64, v: f64) -> Vector2<f64> {
        let (fx, fy) = self.focals();
        let [cx, cy] = self.principal_point();
        Vector2::new(fx * u + cx, fy * v + cy)
    }

    /// As [`Camera::project`], with derivatives; those by the parameters are of the lens.
    #[must_use]
    pub fn project_with_jacobians(&self, x_in_cam: &Vector3<f64>) -> Option<ProjectionJacobians> {
        let Some(port) = &self.port else { return self.project_in_air_with_jacobians(x_in_cam) };
        let (direction, d_point) = port.direction_with_jacobian(x_in_cam)?;
        let mut out = self.project_in_air_with_jacobians(&direction)?;
        out.d_point *= d_point;
        Some(out)
    }

    fn project_in_air_with_jacobians(&self, x_in_cam: &Vector3<f64>) -> Option<ProjectionJacobians> {
        if !in_front(x_in_cam) {
            return None;
        }
        let inverse_z = 1.0 / x_in_cam.z;
        let (u, v) = (x_in_cam.x * inverse_z, x_in_cam.y * inverse_z);
        let d = distort(self.model, &self.params, u, v)?;
        let (fx, fy) = self.focals();
        let rows = [(fx, d.d_uv[0]), (fy, d.d_uv[1])];
        let mut d_point = Matrix2x3::zeros();
        let mut d_params = SMatrix::zeros();
        for (i, (f, [du, dv])) in rows.into_iter().enumerate() {
            d_point[(i, 0)] = f * du * inverse_z;
            d_point[(i, 1)] = f * dv * inverse_z;
            d_point[(i, 2)] = -f * (du * u + dv * v) * inverse_z;
            for (j, &dp) in d.d_params[i].iter().enumerate() {
                d_params[(i, j)] = f * dp;
            }
        }
        match self.model {
            CameraModel::Pinhole | CameraModel::OpenCv | CameraModel::Fisheye => {
                d_params[(0, 0)] = d.u;
                d_params[(1, 1)] = d.v;
                d_params[(0, 2)] = 1.0;
                d_params[(1, 3)] = 1.0;
            }
            CameraModel::SimpleRadial | CameraModel::Radial | CameraModel::Brown => {
                d_params[(0, 0)] = d.u;
                d_params[(1, 0)] = d.v;
                d_params[(0, 1)] = 1.0;
                d_params[(1, 2)] = 1.0;
            }
        }
        Some(ProjectionJacobians { pixel: self.pixel_from_distorted(d.u, d.v), d_point, d_params })
    }

    /// Undistorted normalised coordinates (X/Z, Y/Z) of a pixel; behind a port those of the point of its ray at the port's object distance.
    ///
    /// `None` where the model has no inverse (pixels beyond the fold of the polynomial).
    #[must_use]
    pub fn unproject(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let uv = self.unproject_in_air(pixel)?;
        match &self.port {
            None => Some(uv),
            Some(port) => port.point_at_object_distance(&uv.push(1.0)).filter(in_front).map(|x| x.xy() / x.z),
        }
    }

    /// Newton's method from the distorted coordinates.
    fn unproject_in_air(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let (fx, fy) = self.focals();
        let [cx, cy] = self.principal_point();
        let target = Vector2::new((pixel.x - cx) / fx, (pixel.y - cy) / fy);
        let mut uv = target;
        if self.model == CameraModel::Fisheye {
            // The distorted radius is close to the angle, not to its tangent.
            let radius = target.norm();
            if radius > 1e-9 {
                uv *= radius.min(1.5).tan() / radius;
            }
        }
        for _ in 0..MAX_UNPROJECT_STEPS {
            let Some(d) = distort(self.model, &self.params, uv.x, uv.y) else {
                uv *= 0.7;
                continue;
            };
            let (eu, ev) = (d.u - target.x, d.v - target.y);
            let [[a, b], [c, e]] = d.d_uv;
            let determinant = a * e - b * c;
            if determinant.abs() < 1e-12 {
                return None;
            }
            let step = Vector2::new((e * eu - b * ev) / determinant, (a * ev - c * eu) / determinant);
            uv -= step;
            if !uv.x.is_finite() || !uv.y.is_finite() {
                return None;
            }
            if step.norm_squared() <= 1e-28 * (1.0 + uv.norm_squared()) {
                return distort(self.model, &self.params, uv.x, uv.y).map(|_| uv);
            }
        }
        None
    }

    /// Unit direction in the camera frame of a pixel; `None` as [`Camera::unproject`].
    #[must_use]
    pub fn ray(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        self.unproject(pixel).map(|uv| Vector3::new(uv.x, uv.y, 1.0).normalize())
    }
}

fn in_front(x: &Vector3<f64>) -> bool {
    x.z > MIN_COSINE * x.norm() && x.z > 0.0
}
