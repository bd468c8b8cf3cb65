//! The nouns of the project: ids, rigid transforms, cameras, rigs, frames, images, keypoints, matches, tracks, masks,
//! clouds and meshes, and the file formats that carry them.
//!
//! Nothing here solves, reads an image or prints. Conventions, kept by every package:
//!
//! - transforms are named `b_from_a` and map `x_in_a` to `x_in_b`; a camera looks along +z, x right, y down;
//! - the centre of the top-left pixel is (0.5, 0.5);
//! - metres, radians, seconds and pixels; f64 for geometry, f32 for pixels, depth and descriptors.

pub mod camera;
pub mod cloud;
pub mod format;
pub mod ids;
pub mod keypoint;
pub mod mesh;
pub mod pair;
pub mod raster;
pub mod reconstruction;
pub mod rigid;

pub use camera::{Camera, CameraError, CameraModel, FlatPort, PortError};
pub use cloud::Cloud;
pub use ids::{CameraId, FrameId, ImageId, KeypointIndex, PointId, RigId};
pub use keypoint::{Descriptor, Features, Keypoint};
pub use mesh::Mesh;
pub use pair::{PairConfiguration, VerifiedPair};
pub use raster::{Mask, Raster};
pub use reconstruction::{Frame, Image, Observation, Point, Reconstruction, Rig, RigSensor, Scale};
pub use rigid::{Rigid3, Similarity3};
