//! Masks: which pixels show structure (reef, wreck, sea floor) and which show water.
//!
//! A mask has the size of its image, 255 for structure and 0 for background. This package makes masks from images by the image-processing
//! route of Rofallski et al., *Measuring artificial reefs using a multi-camera system for unmanned underwater vehicles* (ISPRS Archives, 2020),
//! or with a classifier over a quadtree, trains the classifier, and takes masks that were drawn elsewhere.

mod bits;
mod canny;
mod components;
mod error;
mod files;
mod ip;
mod lowpass;
mod ml;
mod morphology;
mod otsu;
mod preprocess;
pub mod quadtree;
pub mod train;
mod vote;

pub use bits::BitMask;
pub use canny::{CannyThresholds, canny};
pub use components::{fill_holes, fill_holes_in, keep_components, remove_specks};
pub use error::MaskError;
pub use files::{mask_from_file, masked_ratio, structure_share};
pub use ip::{IpMask, IpOptions, Polarity, histogram, ip_mask};
pub use lowpass::{Plane, reduced_channel, smooth};
pub use ml::{CellMask, CleanUp, MAX_LEVELS, MlMask, MlOptions, Route, WorkingSize, clean_up, ml_mask, window, working_sizes};
pub use morphology::{close, dilate, erode};
pub use otsu::{Otsu, otsu};
pub use preprocess::{Preprocessing, preprocess};
pub use vote::{Affine, Glimpse, Neighbour, motion, vote};
