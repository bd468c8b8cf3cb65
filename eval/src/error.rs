//! Why nothing could be measured.

use thiserror::Error;

/// Why nothing could be measured.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EvalError {
    /// The cloud has no points.
    #[error("the cloud is empty")]
    EmptyCloud,
    /// The reference has no triangles, or no points.
    #[error("the reference is empty: {0}")]
    EmptyReference(&'static str),
    /// A position is not finite, or too far away for the arithmetic.
    #[error("{what} {index} lies at {position:?}, which is not a usable position")]
    BadPosition {
        /// Point of the cloud, or vertex or point of the reference.
        what: &'static str,
        /// Which one, from 0.
        index: usize,
        /// Its coordinates.
        position: [f64; 3],
    },
    /// A face of the reference names a vertex that does not exist.
    #[error("face {face} of the reference names vertices {vertices:?} of {count}")]
    BadFace {
        /// Which face, from 0.
        face: usize,
        /// Its vertices.
        vertices: [u32; 3],
        /// How many vertices there are.
        count: usize,
    },
    /// An option is not positive.
    #[error("{name} = {value} must be a positive number")]
    BadOption {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Neither the GSD nor the threshold is known.
    #[error("neither gsd_m nor threshold_m is given: without one of them no point can be called noise")]
    NoThreshold,
    /// The cells are too small for the extent of the scene.
    #[error("{what} of {cell_m} m are too fine for a scene of {extent_m} m")]
    TooFine {
        /// What is too fine.
        what: &'static str,
        /// Edge of a cell, metres.
        cell_m: f64,
        /// Largest extent, metres.
        extent_m: f64,
    },
    /// The lists to compare differ in length, or hold too few values.
    #[error("{found} values against {truth} true ones; {needed} or more of each are needed")]
    BadCount {
        /// How many were found.
        found: usize,
        /// How many true ones there are.
        truth: usize,
        /// How many of each are needed.
        needed: usize,
    },
    /// The cloud could not be read, or changed while it was.
    #[error("{0}")]
    Input(String),
    /// No motion aligns the positions.
    #[error("the positions lie in one place or on one line: no alignment is defined")]
    NoAlignment,
}
