//! Where rays meet triangles: a hierarchy of boxes, walked by packets of neighbouring rays.

mod build;
mod packet;
#[cfg(test)]
mod tests;
mod tracer;

pub use packet::{HitPacket, RayPacket};
pub use tracer::{Hit, Tracer};
