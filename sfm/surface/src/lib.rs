//! Surfaces from oriented points, and what is measured on them.
//!
//! [`reconstruct`] makes a mesh by screened Poisson reconstruction and [`trim`] cuts off what no points support; [`closed_volume`],
//! [`volume_over_plane`], [`standing_volume`], [`rugosity`], [`profile_rugosity`], [`holes()`] and [`surface_area`] measure it.
//!
//! Lengths are in the unit of the cloud. All results are the same to the bit at any number of threads.

mod clean;
mod error;
mod lattice;
mod measure;
mod poisson;
mod trim;

pub use error::SurfaceError;
pub use measure::{
    Footprint, Hole, Holes, Plane, PlaneVolume, ProfileRugosity, Rugosity, StandingVolume, closed_volume, fit_plane, holes,
    profile_rugosity, rim_plane, rugosity, standing_volume, surface_area, volume_over_plane,
};
pub use poisson::{LevelSummary, PoissonOptions, PoissonSummary, PoissonSurface, Resolution, reconstruct};
pub use trim::{TrimSummary, trim};
