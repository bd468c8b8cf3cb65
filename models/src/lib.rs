//! Neural networks: the ONNX Runtime that runs them, the cards that describe them, and the assembly of a trained head with its backbone.
//!
//! The only package that links `ort`; none of its types leaves it. Tensors are rows of `f32` with a shape.

mod assemble;
mod backbone;
mod card;
mod error;
mod model;
mod network;
mod onnx;
mod runtime;

pub use assemble::{Head, LOGITS, Tap, colour_backbone, map_name, with_head};
pub use backbone::{Backbone, TAPS};
pub use card::{BUILT_IN_CARD, Card, Figures, InputCard, MapsCard};
pub use error::ModelError;
pub use model::{BUILT_IN, Model, sha256};
pub use network::Tensor;
pub use runtime::Runtime;
