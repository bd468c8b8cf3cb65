//! One image of a point.

use nalgebra::{Matrix3, Vector2, Vector3};
use scene::camera::ProjectionJacobians;
use scene::{Camera, Rigid3};

/// A pixel in a camera of known orientation, with what triangulation needs of them computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    camera: Camera,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    pixel: Vector2<f64>,
    centre: Vector3<f64>,
    ray: Vector3<f64>,
}

impl View {
    /// `None` when the pixel has no ray (beyond the fold of the distortion, not finite).
    #[must_use]
    pub fn new(camera: Camera, cam_from_world: &Rigid3, pixel: Vector2<f64>) -> Option<Self> {
        let ray_in_cam = camera.ray(&pixel)?;
        Some(Self::with_ray(camera, cam_from_world, pixel, &ray_in_cam))
    }

    /// The same for a caller that keeps [`Camera::ray`] of its keypoints: undistortion is most of the cost of a short
    /// track. `ray_in_cam` has length 1.
    #[must_use]
    pub fn with_ray(camera: Camera, cam_from_world: &Rigid3, pixel: Vector2<f64>, ray_in_cam: &Vector3<f64>) -> Self {
        let rotation = cam_from_world.rotation_matrix();
        let translation = cam_from_world.translation;
        let centre = -rotation.tr_mul(&translation);
        Self { camera, rotation, translation, pixel, centre, ray: rotation.tr_mul(ray_in_cam) }
    }

    /// Projection centre in the world.
    #[must_use]
    pub fn centre(&self) -> &Vector3<f64> {
        &self.centre
    }

    /// Unit direction of the pixel in the world.
    #[must_use]
    pub fn ray_in_world(&self) -> &Vector3<f64> {
        &self.ray
    }

    /// The observed pixel.
    #[must_use]
    pub fn pixel(&self) -> &Vector2<f64> {
        &self.pixel
    }

    /// Squared reprojection error of a point in the world, square pixels; infinite where it does not project.
    #[must_use]
    pub fn squared_error(&self, x_in_world: &Vector3<f64>) -> f64 {
        let projected = self.camera.project(&(self.rotation * x_in_world + self.translation));
        projected.map_or(f64::INFINITY, |p| (p - self.pixel).norm_squared())
    }

    pub(super) fn rotation(&self) -> &Matrix3<f64> {
        &self.rotation
    }

    pub(super) fn project_with_jacobians(&self, x_in_world: &Vector3<f64>) -> Option<ProjectionJacobians> {
        self.camera.project_with_jacobians(&(self.rotation * x_in_world + self.translation))
    }
}
