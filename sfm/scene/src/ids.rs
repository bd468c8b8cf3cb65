//! Ids are newtypes, dense from 0, and never interchangeable.

use serde::{Deserialize, Serialize};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The id of the element at `index` of the dense vector that holds it.
            ///
            /// # Panics
            /// When `index` does not fit 32 bits.
            #[must_use]
            pub fn new(index: usize) -> Self {
                assert!(u32::try_from(index).is_ok(), "id out of range: {index}");
                Self(index as u32)
            }

            /// The position of the element in the dense vector that holds it.
            #[must_use]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

id!(
    /// A physical camera: one interior orientation.
    CameraId
);
id!(
    /// A calibration of several cameras with respect to each other.
    RigId
);
id!(
    /// One posed instant of a rig.
    FrameId
);
id!(
    /// One exposure of one camera.
    ImageId
);
id!(
    /// A scene point with its observations.
    PointId
);
id!(
    /// Position of a keypoint in its image's list.
    KeypointIndex
);
