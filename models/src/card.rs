//! Cards: what has to be known about a model to run it, and to judge it.

use crate::ModelError;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Card of the model that comes with the program.
pub const BUILT_IN_CARD: &str = include_str!("../structure.toml");

/// What a model is, `NAME.toml` beside `NAME.onnx`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Its name.
    pub name: String,
    /// What it was trained for and with.
    #[serde(default)]
    pub description: String,
    /// Licence under which it may be used.
    #[serde(default)]
    pub licence: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Output with one value a class, `[n, 2]`: logits or probabilities.
    pub output: String,
    /// Order of the classes in the output.
    pub classes: [String; 2],
    /// What goes in.
    pub input: InputCard,
    /// Logit of structure from which a patch is split, one a level of the quadtree from the whole image on; the last one also holds below. Empty: `decision` for all.
    /// At the last level `decision` decides.
    #[serde(default)]
    pub thresholds: Vec<f32>,
    /// Logit from which a cell is structure. At 0, where nothing is said, it is as likely as not; below, structure that is doubted is kept, and some water with it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub decision: f32,
    /// A connected part of the structure is kept where one of its cells reaches this logit: hysteresis. None: every part is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub core: Option<f32>,
    /// Maps of the logit over the whole image, for the route that shares its computation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<MapsCard>,
    /// How good it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figures: Option<Figures>,
}

/// What goes into a model: `[n, 3, height, width]`, red, green, blue, each `(value - mean) / std` of a grey value in 0..=255.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputCard {
    /// Name of the input.
    pub name: String,
    /// Width that patches are brought to, pixels.
    pub width: usize,
    /// Height that patches are brought to, pixels.
    pub height: usize,
    /// Mean of each channel, grey values.
    pub mean: [f32; 3],
    /// Standard deviation of each channel, grey values.
    pub std: [f32; 3],
    /// A patch shows at least this share of the long side of the image, its cell in the middle: below, nobody could tell what a patch shows.
    #[serde(default)]
    pub min_patch: f64,
}

/// Outputs whose sum, pooled over a cell, is the cell's logit of structure (but for `bias`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapsCard {
    /// Names of the outputs, each `[n, 1, h, w]` at some stride.
    pub outputs: Vec<String>,
    /// What is added to their sum.
    pub bias: f32,
    /// Long sides that the whole image is brought to; the logits of all are averaged.
    pub long_sides_px: Vec<usize>,
}

/// How good a model is, on images that it was not trained with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Share of patches that are classified as labelled, 0..=1.
    pub accuracy: f64,
    /// Share of structure among patches that are called so, 0..=1.
    pub precision: f64,
    /// Share of structure that is called so, 0..=1.
    pub recall: f64,
    /// Mean over the images of the intersection over union of mask and label, 0..=1.
    pub mean_iou: f64,
    /// Patches that the figures are of.
    pub patches: usize,
    /// Images that they come from.
    pub images: usize,
}

impl Card {
    /// Reads a card; `path` is only named.
    ///
    /// # Errors
    /// [`ModelError::Card`] with the line where it is wrong.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ModelError> {
        let wrong = |reason: String| ModelError::Card { card: path.to_path_buf(), reason };
        let card: Self = toml::from_str(text).map_err(|e| wrong(e.to_string().trim_end().to_owned()))?;
        let known = ["background", "structure"];
        if card.classes[0] == card.classes[1] || card.classes.iter().any(|c| !known.contains(&c.as_str())) {
            return Err(wrong(r#"classes must be ["background", "structure"], or the other way round"#.to_owned()));
        }
        let sides = [card.input.width, card.input.height];
        if sides.iter().any(|s| !(1..=4096).contains(s)) {
            return Err(wrong("input.width and input.height must be from 1 to 4096".to_owned()));
        }
        if card.input.std.iter().any(|s| !(*s > 0.0 && s.is_finite())) || card.input.mean.iter().any(|m| !m.is_finite()) {
            return Err(wrong("input.std must be above 0, input.mean a number".to_owned()));
        }
        if !(0.0..=1.0).contains(&card.input.min_patch) {
            return Err(wrong("input.min_patch must be from 0 to 1".to_owned()));
        }
        if let Some(maps) = &card.maps
            && (maps.outputs.is_empty() || maps.long_sides_px.is_empty() || maps.long_sides_px.iter().any(|s| !(32..=16384).contains(s)))
        {
            return Err(wrong("maps.outputs must name outputs, maps.long_sides_px sizes from 32 to 16384".to_owned()));
        }
        let of_maps = card.maps.iter().map(|m| &m.bias);
        if card.thresholds.iter().chain(&card.core).chain(of_maps).any(|t| t.is_nan()) || !card.decision.is_finite() {
            return Err(wrong("thresholds, core, decision and bias must be numbers".to_owned()));
        }
        Ok(card)
    }

    /// The card as it is written.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// Place of the class of structure in the output.
    #[must_use]
    pub fn structure_index(&self) -> usize {
        usize::from(self.classes[1] == "structure")
    }
}

fn is_zero(value: &f32) -> bool {
    *value == 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
name = "mine"
sha256 = "00"
output = "logits"
classes = ["background", "structure"]
[input]
name = "image"
width = 64
height = 64
mean = [0.0, 0.0, 0.0]
std = [1.0, 1.0, 1.0]
"#;

    #[test]
    fn a_card_is_read_and_written() {
        let card = Card::parse(GOOD, Path::new("mine.toml")).expect("good");
        assert_eq!((card.structure_index(), card.core, card.maps.is_none()), (1, None, true));
        assert_eq!(Card::parse(&card.to_toml(), Path::new("mine.toml")).expect("good"), card);
        assert_eq!(card.decision, 0.0);
        let careful = Card { decision: -1.0, ..card.clone() };
        assert_eq!(Card::parse(&careful.to_toml(), Path::new("mine.toml")).expect("good"), careful);
        let turned = GOOD.replace(r#"["background", "structure"]"#, r#"["structure", "background"]"#);
        assert_eq!(Card::parse(&turned, Path::new("mine.toml")).expect("good").structure_index(), 0);
    }

    #[test]
    fn the_card_of_the_built_in_model_is_good() {
        let card = Card::parse(BUILT_IN_CARD, Path::new("structure.toml")).expect("good");
        assert_eq!(card.sha256, crate::model::sha256(crate::BUILT_IN));
        assert!(!card.licence.is_empty() && card.figures.is_some());
    }

    #[test]
    fn what_is_wrong_on_a_card_is_named() {
        for (from, to, expected) in [
            ("\"background\", ", "\"water\", ", "classes must be"),
            ("width = 64", "width = 0", "input.width"),
            ("std = [1.0", "std = [0.0", "input.std"),
            ("mean = [0.0", "mean = [nan", "input.mean"),
            ("output =", "decision = nan\noutput =", "decision"),
            ("output =", "outptu =", "outptu"),
            ("sha256 = \"00\"", "", "sha256"),
        ] {
            let text = GOOD.replace(from, to);
            assert_ne!(text, GOOD, "{from} is on the card");
            let error = Card::parse(&text, Path::new("mine.toml")).expect_err("wrong").to_string();
            assert!(error.contains(expected) && error.contains("mine.toml"), "{error}");
        }
    }
}
