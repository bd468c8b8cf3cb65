//! What can be wrong with a model or with what runs it.

use std::path::PathBuf;

/// Why a network cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// No library was found.
    #[error(
        "ONNX Runtime is not installed: `pip install onnxruntime` does it, or name libonnxruntime with mask.onnxruntime or ORT_DYLIB_PATH"
    )]
    NoRuntime,
    /// A library was named or found, and does not load.
    #[error("{path} cannot be loaded as ONNX Runtime: {reason}")]
    Runtime {
        /// The library.
        path: PathBuf,
        /// What the loader says.
        reason: String,
    },
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A model without a card.
    #[error("the model {model} has no card: write {card}, as docs/masks.md shows")]
    NoCard {
        /// The model.
        model: PathBuf,
        /// Where its card was looked for.
        card: PathBuf,
    },
    /// A card that does not say what it must.
    #[error("the card {card}: {reason}")]
    Card {
        /// The card.
        card: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Another file than the card describes.
    #[error("the model {model} is not the one that its card describes: its sha256 is {found}, the card says {stated}")]
    Hash {
        /// The model.
        model: PathBuf,
        /// Hash of the file.
        found: String,
        /// Hash on the card.
        stated: String,
    },
    /// The runtime refuses the model.
    #[error("the model {model} cannot be used: {reason}")]
    Model {
        /// The model.
        model: PathBuf,
        /// What the runtime says.
        reason: String,
    },
    /// A network that is no classifier of two classes.
    #[error("the model {model} is no classifier of two classes: {reason}")]
    Shape {
        /// The model.
        model: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A backbone that takes no head.
    #[error("no head can be set on the backbone: {0}")]
    Backbone(String),
}

impl From<prost::DecodeError> for ModelError {
    fn from(error: prost::DecodeError) -> Self {
        Self::Backbone(format!("it is no ONNX file: {error}"))
    }
}
