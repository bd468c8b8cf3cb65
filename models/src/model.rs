//! A network that is ready to run.

use crate::network::{Network, Port, names};
use crate::{BUILT_IN_CARD, Card, ModelError, Runtime, Tensor};
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The model that comes with the program.
pub const BUILT_IN: &[u8] = include_bytes!("../structure.onnx");

/// A network with its card, ready to classify. May be shared among threads; values do not depend on their number.
#[derive(Debug)]
pub struct Model {
    card: Card,
    network: Network,
}

impl Model {
    /// The model that comes with the program.
    ///
    /// # Errors
    /// Where the runtime refuses it.
    pub fn built_in(runtime: &Runtime) -> Result<Self, ModelError> {
        let card = Card::parse(BUILT_IN_CARD, Path::new("structure.toml"))?;
        Self::new(card, PathBuf::from("structure.onnx"), Cow::Borrowed(BUILT_IN), runtime)
    }

    /// The model in a file, with the card that lies beside it under the same name with the ending `toml`.
    ///
    /// # Errors
    /// Where either is missing or wrong, the file is not that of the card, or the network is no classifier of two classes.
    pub fn open(path: &Path, runtime: &Runtime) -> Result<Self, ModelError> {
        let bytes = std::fs::read(path).map_err(|source| ModelError::Read { path: path.to_path_buf(), source })?;
        let card_path = path.with_extension("toml");
        let text = match std::fs::read_to_string(&card_path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Err(ModelError::NoCard { model: path.to_path_buf(), card: card_path });
            }
            Err(source) => return Err(ModelError::Read { path: card_path, source }),
        };
        Self::new(Card::parse(&text, &card_path)?, path.to_path_buf(), Cow::Owned(bytes), runtime)
    }

    /// A model from its bytes; `path` is only named.
    ///
    /// # Errors
    /// As for [`Model::open`].
    pub fn new(card: Card, path: PathBuf, bytes: Cow<'static, [u8]>, runtime: &Runtime) -> Result<Self, ModelError> {
        let found = sha256(&bytes);
        if !found.eq_ignore_ascii_case(&card.sha256) {
            return Err(ModelError::Hash { model: path, found, stated: card.sha256 });
        }
        let network = Network::new(path, bytes, runtime)?;
        check(&card, &network)?;
        Ok(Self { card, network })
    }

    /// Its card.
    #[must_use]
    pub fn card(&self) -> &Card {
        &self.card
    }

    /// The file as it was read.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.network.bytes
    }

    /// Runs the network on `[n, 3, height, width]` values and gives the outputs that are named.
    ///
    /// # Errors
    /// [`ModelError::Model`] where the runtime refuses, or an output is missing.
    ///
    /// # Panics
    /// When the number of values is not that of the shape.
    pub fn run(&self, shape: [usize; 4], values: &[f32], outputs: &[&str]) -> Result<Vec<Tensor>, ModelError> {
        self.network.run(&self.card.input.name, shape, values, outputs)
    }
}

/// That input and outputs are what the card says, and what a classifier of two classes has.
fn check(card: &Card, network: &Network) -> Result<(), ModelError> {
    let shape = |reason: String| ModelError::Shape { model: network.path.clone(), reason };
    let find = |ports: &'_ [Port], name: &str| ports.iter().find(|p| p.0 == name).map(|p| p.1.clone());
    let axes = find(&network.inputs, &card.input.name);
    let axes = axes.ok_or_else(|| shape(format!("it has no input {}; it has {}", card.input.name, names(&network.inputs))))?;
    let (width, height) = (card.input.width as i64, card.input.height as i64);
    let fits = |axis: i64, wanted: i64| axis < 0 || axis == wanted;
    if axes.len() != 4 || !fits(axes[1], 3) || !fits(axes[2], height) || !fits(axes[3], width) {
        return Err(shape(format!("its input is {axes:?}; [n, 3, {height}, {width}] is needed, -1 for any length")));
    }
    let mut wanted = vec![(card.output.as_str(), 2, 2)];
    wanted.extend(card.maps.iter().flat_map(|m| &m.outputs).map(|name| (name.as_str(), 4, 1)));
    for (name, rank, channels) in wanted {
        let axes = find(&network.outputs, name);
        let axes = axes.ok_or_else(|| shape(format!("it has no output {name}; it has {}", names(&network.outputs))))?;
        if axes.len() != rank || !fits(axes[1], channels) {
            let rest = if rank == 4 { ", h, w" } else { "" };
            return Err(shape(format!("its output {name} is {axes:?}; [n, {channels}{rest}] is needed")));
        }
    }
    Ok(())
}

/// SHA-256 in hexadecimal.
#[must_use]
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Head, MapsCard, Tap, colour_backbone, map_name, with_head};

    /// The runtime, or nothing on a machine without it.
    fn runtime() -> Option<Runtime> {
        let runtime = Runtime::load(None);
        if let Err(error) = &runtime {
            println!("skipped: {error}");
        }
        runtime.ok()
    }

    fn redness() -> Vec<u8> {
        let head = Head { taps: vec![Tap { output: "colour".to_owned(), weights: vec![1.0, 0.0, -1.0] }], bias: 0.5 };
        with_head(&colour_backbone(), &head).expect("a head")
    }

    fn card(bytes: &[u8]) -> Card {
        let text = format!(
            "name = 'red'\nsha256 = '{}'\noutput = 'logits'\nclasses = ['background', 'structure']\n[input]\nname = 'image'\nwidth = 4\nheight = 2\n\
             mean = [0.0, 0.0, 0.0]\nstd = [1.0, 1.0, 1.0]\n",
            sha256(bytes)
        );
        let maps = MapsCard { outputs: vec![map_name("colour")], bias: 0.5, long_sides_px: vec![64] };
        Card { maps: Some(maps), ..Card::parse(&text, Path::new("red.toml")).expect("good") }
    }

    fn open(card: Card, bytes: Vec<u8>, runtime: &Runtime) -> Result<Model, ModelError> {
        Model::new(card, PathBuf::from("red.onnx"), Cow::Owned(bytes), runtime)
    }

    #[test]
    fn a_head_on_colours_gives_the_logit_and_its_map() {
        let Some(runtime) = runtime() else { return };
        let model = open(card(&redness()), redness(), &runtime).expect("good");
        // Red 3, green 7, blue 1 but for one pixel of red 5.
        let mut values = [[3.0f32; 8], [7.0; 8], [1.0; 8]].concat();
        values[5] = 5.0;
        let found = model.run([1, 3, 2, 4], &values, &["logits", "map_colour"]).expect("runs");
        // The mean of red minus blue, 2.25, plus the bias, and half of it to either side.
        assert_eq!((found[0].shape.as_slice(), found[0].data.as_slice()), ([1, 2].as_slice(), [-1.375, 1.375].as_slice()));
        assert_eq!(found[1].data, [2.0, 2.0, 2.0, 2.0, 2.0, 4.0, 2.0, 2.0]);
    }

    #[test]
    fn models_that_are_no_classifiers_are_refused_with_the_reason() {
        let Some(runtime) = runtime() else { return };
        let good = card(&redness());
        let with = |change: fn(&mut Card)| {
            let mut card = good.clone();
            change(&mut card);
            open(card, redness(), &runtime).expect_err("refused").to_string()
        };
        assert!(with(|c| c.sha256 = "00".to_owned()).contains("the card says 00"));
        assert!(with(|c| c.input.name = "picture".to_owned()).contains("no input picture; it has image"));
        assert!(with(|c| c.output = "classes".to_owned()).contains("no output classes; it has colour, map_colour, logits"));
        // A map of the features is no classification: of rank four.
        let rank = with(|c| c.output = "colour".to_owned());
        assert!(rank.contains("colour is [-1, 3, -1, -1]; [n, 2] is needed"), "{rank}");
        assert!(with(|c| c.maps.as_mut().expect("maps").outputs = vec!["colour".to_owned()]).contains("[n, 1, h, w] is needed"));
    }

    #[test]
    fn files_that_are_no_models_are_refused() {
        let Some(runtime) = runtime() else { return };
        let broken = redness()[..40].to_vec();
        let error = open(card(&broken), broken, &runtime).expect_err("broken").to_string();
        assert!(error.contains("red.onnx cannot be used"), "{error}");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("red.onnx");
        assert!(matches!(Model::open(&path, &runtime), Err(ModelError::Read { .. })));
        std::fs::write(&path, redness()).expect("written");
        let error = Model::open(&path, &runtime).expect_err("no card").to_string();
        assert!(error.contains("red.toml"), "{error}");
        std::fs::write(folder.path().join("red.toml"), card(&redness()).to_toml()).expect("written");
        Model::open(&path, &runtime).expect("good");
    }

    #[test]
    fn the_built_in_model_loads() {
        let Some(runtime) = runtime() else { return };
        let model = Model::built_in(&runtime).expect("good");
        let side = model.card().input.width;
        let found = model.run([2, 3, side, side], &vec![100.0; 2 * 3 * side * side], &[&model.card().output]).expect("runs");
        assert_eq!(found[0].shape, [2, 2]);
        assert_eq!(found[0].data[..2], found[0].data[2..], "the same picture twice");
    }
}
