//! How the scene looks: texture, water, light, and what the camera makes of it. All colours are linear light in red, green and blue.

mod jerlov;
mod lamps;
mod material;
mod noise;
mod response;
mod water;

pub use jerlov::Jerlov;
pub use lamps::LampOptions;
pub(crate) use lamps::Lamps;
pub(crate) use material::albedo;
pub(crate) use noise::gradient as gradient_noise;
pub(crate) use response::Response;
pub use water::{Water, WaterOptions};
