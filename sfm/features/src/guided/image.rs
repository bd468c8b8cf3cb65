//! An image made ready for all of its pairs.

use super::cells::Cells;
use crate::verify::ImageForPair;
use scene::{Camera, Features, ImageId};

/// An image with what its pairs share: its keypoints sorted by place.
#[derive(Clone, Debug)]
pub struct MatchImage {
    id: ImageId,
    camera: Camera,
    camera_known: bool,
    features: Features,
    pub(super) cells: Cells,
}

impl MatchImage {
    /// From what an image is known by, as for [`ImageForPair`]: its id, its interior orientation, whether that is trusted, and its features, the
    /// strongest first, as [`extract`](crate::extract) gives them.
    #[must_use]
    pub fn new(id: ImageId, camera: Camera, camera_known: bool, features: Features) -> Self {
        let cells = Cells::new(&features, &camera, camera_known);
        Self { id, camera, camera_known, features, cells }
    }

    /// Its id.
    #[must_use]
    pub fn id(&self) -> ImageId {
        self.id
    }

    /// Its features.
    #[must_use]
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// What [`verify_pair`](crate::verify_pair) takes.
    #[must_use]
    pub fn for_pair(&self) -> ImageForPair<'_> {
        ImageForPair { id: self.id, camera: &self.camera, camera_known: self.camera_known, features: &self.features }
    }
}
