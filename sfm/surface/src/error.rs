//! Why there is no surface, or no measure of it.

use thiserror::Error;

/// Why there is no surface, or no measure of it.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SurfaceError {
    /// The cloud carries no normals.
    #[error("the cloud has {points} points and {normals} normals: a surface needs a normal at every point")]
    NoNormals {
        /// Its points.
        points: usize,
        /// Its normals.
        normals: usize,
    },
    /// Too few points are left to make a surface of.
    #[error("{usable} of {points} points have a finite position and a normal: at least {needed} are needed")]
    TooFewPoints {
        /// Points that can be used.
        usable: usize,
        /// Points given.
        points: usize,
        /// How many are needed.
        needed: usize,
    },
    /// All points lie in one place.
    #[error("all points lie in one place, or too far out for the arithmetic: the extent is {extent}")]
    NoExtent {
        /// Largest extent along an axis.
        extent: f64,
    },
    /// An option is outside its range.
    #[error("{name} = {value}: {what}")]
    BadOption {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it has to be.
        what: &'static str,
    },
    /// The cells are too small for the extent of the scene.
    #[error("cells of {cell} are too fine for an extent of {extent}: the finest that is possible is {finest:.3e}")]
    TooFine {
        /// Edge of a cell.
        cell: f64,
        /// Largest extent.
        extent: f64,
        /// Smallest edge that is possible.
        finest: f64,
    },
    /// The mesh has no faces.
    #[error("the mesh has no faces")]
    EmptyMesh,
    /// A face names a vertex that does not exist, or a vertex is not finite.
    #[error("face {face} of the mesh has vertices {vertices:?}, of {count}, or one that is not finite")]
    BadFace {
        /// Which face, from 0.
        face: usize,
        /// Its vertices.
        vertices: [u32; 3],
        /// How many vertices there are.
        count: usize,
    },
    /// The mesh encloses no volume.
    #[error("no volume: the mesh is not closed, {holes} holes with {length} of boundary{odd}")]
    NotClosed {
        /// Boundary loops.
        holes: usize,
        /// Their length together.
        length: f64,
        /// What else is wrong, as text that ends the sentence.
        odd: String,
    },
    /// The points lie on one line: no plane goes through them alone.
    #[error("no plane: the points lie in one place or on one line")]
    NoPlane,
    /// Writing failed.
    #[error("cannot write: {0}")]
    Write(String),
}
