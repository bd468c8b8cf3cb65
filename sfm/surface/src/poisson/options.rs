//! What can be chosen.

use crate::SurfaceError;

/// How fine the surface is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// 2^depth cells along the edge of the cube around all points, 2 to 14.
    Depth(u32),
    /// Edge of the finest cells in the unit of the cloud; about twice the GSD is as fine as a dense cloud carries.
    Cell(f64),
}

/// What can be chosen of a reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoissonOptions {
    /// How fine the surface is.
    pub resolution: Resolution,
    /// Weight of the points against their normals: 0 gives the unscreened surface, large values follow every point.
    pub screening: f64,
    /// Points that a cell holds at least: where there are fewer, cells are larger.
    pub samples_per_cell: f64,
    /// Whether points weigh by the inverse of their variance, where the cloud has standard deviations.
    pub sigma_weights: bool,
    /// Whether the points are those of a closed body: the faces of the cube around them are then outside, and holes are closed however near they
    /// lie to them. Not for a sea floor, whose surface has to leave the cube.
    pub closed: bool,
    /// Most steps of the conjugate gradients a level.
    pub max_iterations: u32,
    /// Steps end when the residual of a level has fallen to this share of its first.
    pub tolerance: f64,
}

impl Default for PoissonOptions {
    fn default() -> Self {
        Self {
            resolution: Resolution::Depth(8),
            screening: 4.0,
            samples_per_cell: 1.5,
            sigma_weights: false,
            closed: false,
            max_iterations: 30,
            tolerance: 1e-3,
        }
    }
}

/// Deepest level: coordinates of nodes stay below 2^21 with room, and no dive is finer than a cell in 16,384.
pub(super) const MAX_DEPTH: u32 = 14;

impl PoissonOptions {
    pub(super) fn check(&self) -> Result<(), SurfaceError> {
        let bad = |name, value, what| Err(SurfaceError::BadOption { name, value, what });
        match self.resolution {
            Resolution::Depth(depth) if !(2..=MAX_DEPTH).contains(&depth) => return bad("depth", f64::from(depth), "it must be 2 to 14"),
            Resolution::Cell(cell) if !(cell > 0.0 && cell.is_finite()) => return bad("cell", cell, "it must be a positive length"),
            _ => {}
        }
        if !(self.screening >= 0.0 && self.screening <= 1e4) {
            return bad("screening", self.screening, "it must be 0 to 10,000");
        }
        if !(self.samples_per_cell >= 0.1 && self.samples_per_cell <= 1000.0) {
            return bad("samples_per_cell", self.samples_per_cell, "it must be 0.1 to 1,000");
        }
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return bad("tolerance", self.tolerance, "it must lie between 0 and 1");
        }
        Ok(())
    }
}
