//! What moves, at one instant.

use crate::trace::Tracer;
use crate::world::{Part, World};
use scene::Rigid3;

/// The movers of a world where they are at one time.
pub(super) struct Moving {
    /// In the world frame.
    pub parts: Vec<Part>,
    /// For the texture of each part.
    pub body_from_world: Vec<Rigid3>,
    /// `None` where nothing moves.
    pub tracer: Option<Tracer>,
}

impl Moving {
    pub fn at(world: &World, time_s: f64) -> Self {
        let (mut parts, mut body_from_world) = (Vec::new(), Vec::new());
        for mover in &world.movers {
            let (placed, world_from_body) = mover.at(time_s);
            body_from_world.extend(std::iter::repeat_n(world_from_body.inverse(), placed.len()));
            parts.extend(placed);
        }
        let tracer = (!parts.is_empty()).then(|| Tracer::new(&parts));
        Self { parts, body_from_world, tracer }
    }
}
