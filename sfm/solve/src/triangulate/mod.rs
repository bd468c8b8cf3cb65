//! Scene points from their images in cameras of known pose.

mod point;
mod robust;
#[cfg(test)]
mod tests;
mod view;

pub use point::{triangulate, triangulate_two, triangulation_angle};
pub use robust::{max_triangulation_angle, triangulate_robust};
pub use view::View;
