//! dive.toml: read with the place of every value ([`read`]), checked, and resolved into a [`Config`].

mod calib;
mod error;
mod files;
mod interior;
mod keys;
mod model;
mod path_text;
mod raw;
mod resolve;
mod rig;
mod sensors;
mod stage_options;
mod stages;
#[cfg(test)]
mod tests;
mod values;

pub use calib::{BoardConfig, CalibConfig, read_calib};
pub use error::{ConfigError, ConfigProblem};
pub use files::IMAGE_EXTENSIONS;
pub(crate) use files::{NamePart, images_of_folder, is_image, natural_key};
pub(crate) use interior::read_file as read_interior;
pub use keys::KEYS;
pub use model::*;
pub(crate) use resolve::is_safe_name;
pub use resolve::{parse, read};
pub(crate) use sensors::MAX_FROM_ORIGIN_M;
pub use stage_options::*;
