//! From a pixel to a ray in the water: lens, window, water. Written apart from `scene::Camera` and `scene::FlatPort`, so that each
//! checks the other: here a pixel is followed outwards by Snell's law, there the ray to a point is searched.

mod calibrated;
mod index;
mod lens;
mod window;

pub use calibrated::{Calibrated, calibrate};
pub use index::refractive_index;
pub use lens::{Lens, RayTable};
pub use window::Window;
