//! Keypoints and their descriptors.

/// A keypoint in pixel coordinates (centre of the top-left pixel at (0.5, 0.5)).
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Keypoint {
    /// Column, pixels.
    pub x: f32,
    /// Row, pixels.
    pub y: f32,
    /// Standard deviation of the Gaussian at which it was found, pixels.
    pub scale: f32,
    /// Direction of the dominant gradient, radians, clockwise from +x in image axes (y down).
    pub orientation: f32,
}

/// A RootSIFT descriptor scaled to bytes: 4 x 4 cells (row-major) of 8 directions.
pub type Descriptor = [u8; 128];

/// What was found in one image: `descriptors[i]` belongs to `keypoints[i]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Positions, sizes and directions.
    pub keypoints: Vec<Keypoint>,
    /// Appearance.
    pub descriptors: Vec<Descriptor>,
}

impl Features {
    /// Number of keypoints.
    #[must_use]
    pub fn len(&self) -> usize {
        self.keypoints.len()
    }

    /// Whether nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.keypoints.is_empty()
    }
}
