//! Ray offsets on a level of the pyramid.

use crate::RayOffsets;
use std::sync::Arc;

/// Where the rays of the pixels of a level pass.
#[derive(Clone)]
pub(crate) struct LevelOffsets {
    offsets: Arc<RayOffsets>,
    /// Pixels of the full raster a pixel of the level.
    scale: f32,
}

impl LevelOffsets {
    pub fn new(offsets: &Arc<RayOffsets>, level: u32) -> Self {
        Self { offsets: Arc::clone(offsets), scale: (1u32 << level) as f32 }
    }

    /// At a pixel of the level, in index coordinates.
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> [f32; 2] {
        self.offsets.at_index((x + 0.5) * self.scale - 0.5, (y + 0.5) * self.scale - 0.5)
    }
}
