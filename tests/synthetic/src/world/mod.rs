//! What stands in the scene, as triangles: the truth that frames are rendered from.
//!
//! World frame: metres, z up, sand at about z = 0, what is surveyed about the origin; cameras come from -y first.

mod all;
mod bars;
mod bottom;
mod movers;
mod nets;
mod options;
mod panel;
mod part;
mod scenes;
mod solid;
mod structure;
mod tag36h11;
#[cfg(test)]
mod tests;

pub use all::World;
pub use bars::Bar;
#[cfg(test)]
pub(crate) use bottom::ball as ball_mesh;
pub use movers::{CARRIED_BAR_M, Mover, Way};
pub use options::{SceneKind, WorldOptions};
pub use panel::{Art, Panel, tag_cell};
pub use part::{Label, Material, Part};
#[cfg(test)]
pub(crate) use scenes::sheet as panel_mesh;
