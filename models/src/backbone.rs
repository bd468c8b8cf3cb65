//! A network that only describes pixels, for a head to be trained on.

use crate::network::{Network, names};
use crate::{InputCard, ModelError, Runtime, Tensor};
use std::borrow::Cow;
use std::path::PathBuf;

/// Outputs of a backbone that a head looks at: feature maps at strides 8, 16 and 32.
pub const TAPS: [&str; 3] = ["s8", "s16", "s32"];

/// A network with feature maps.
#[derive(Debug)]
pub struct Backbone {
    network: Network,
    input: InputCard,
    taps: Vec<(String, usize)>,
}

impl Backbone {
    /// A backbone from its bytes, `path` is only named; `taps` are the outputs that a head is to look at.
    ///
    /// # Errors
    /// Where the runtime refuses it, or an input or output is missing or no map of a known number of channels.
    pub fn new(path: PathBuf, bytes: Cow<'static, [u8]>, input: InputCard, taps: &[&str], runtime: &Runtime) -> Result<Self, ModelError> {
        let network = Network::new(path, bytes, runtime)?;
        if network.inputs.iter().all(|(name, _)| *name != input.name) {
            return Err(ModelError::Backbone(format!("it has no input {}; it has {}", input.name, names(&network.inputs))));
        }
        let channels = |tap: &&str| {
            let found = network.outputs.iter().find(|(name, axes)| name == tap && axes.len() == 4 && axes[1] > 0);
            let missing = || ModelError::Backbone(format!("it has no feature map {tap}; its outputs are {}", names(&network.outputs)));
            found.map(|(name, axes)| (name.clone(), axes[1] as usize)).ok_or_else(missing)
        };
        let taps = taps.iter().map(channels).collect::<Result<_, _>>()?;
        Ok(Self { network, input, taps })
    }

    /// Name and number of channels of each output that a head looks at.
    #[must_use]
    pub fn taps(&self) -> &[(String, usize)] {
        &self.taps
    }

    /// What goes in.
    #[must_use]
    pub fn input(&self) -> &InputCard {
        &self.input
    }

    /// The file as it was read.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.network.bytes
    }

    /// The feature maps of `[n, 3, height, width]` values, each `[n, channels, h, w]`.
    ///
    /// # Errors
    /// [`ModelError::Model`] where the runtime refuses.
    ///
    /// # Panics
    /// When the number of values is not that of the shape.
    pub fn run(&self, shape: [usize; 4], values: &[f32]) -> Result<Vec<Tensor>, ModelError> {
        let outputs: Vec<&str> = self.taps.iter().map(|(name, _)| name.as_str()).collect();
        self.network.run(&self.input.name, shape, values, &outputs)
    }
}
