//! How good a classifier is.

use super::samples::Samples;
use models::Figures;
use serde::Serialize;

/// Patches by what they show and what they are called.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Confusion {
    /// Structure, called structure.
    pub true_structure: usize,
    /// Background, called structure.
    pub false_structure: usize,
    /// Background, called background.
    pub true_background: usize,
    /// Structure, called background.
    pub false_background: usize,
}

impl Confusion {
    pub(super) fn of(samples: &Samples, weights: &[f32], bias: f32) -> Self {
        let mut confusion = Self::default();
        for (row, structure) in samples.rows() {
            let count = match (structure, logit(row, weights, bias) >= 0.0) {
                (true, true) => &mut confusion.true_structure,
                (false, true) => &mut confusion.false_structure,
                (false, false) => &mut confusion.true_background,
                (true, false) => &mut confusion.false_background,
            };
            *count += 1;
        }
        confusion
    }

    /// Share of patches that are called what they show, 0..=1.
    #[must_use]
    pub fn accuracy(&self) -> f64 {
        ratio(self.true_structure + self.true_background, self.false_structure + self.false_background)
    }

    /// Share of structure among the patches that are called so, 0..=1.
    #[must_use]
    pub fn precision(&self) -> f64 {
        ratio(self.true_structure, self.false_structure)
    }

    /// Share of structure that is called so, 0..=1.
    #[must_use]
    pub fn recall(&self) -> f64 {
        ratio(self.true_structure, self.false_background)
    }
}

fn ratio(of: usize, rest: usize) -> f64 {
    of as f64 / (of + rest).max(1) as f64
}

/// A bin of the calibration curve: what a classifier says, and what is so.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Mean probability of structure that the classifier gives, 0..=1.
    pub predicted: f64,
    /// Share of structure, 0..=1.
    pub observed: f64,
    /// Patches.
    pub patches: usize,
}

/// The calibration curve, in tenths of the probability; without the bins that hold nothing.
pub(super) fn reliability(samples: &Samples, weights: &[f32], bias: f32) -> Vec<Bin> {
    let mut bins = [Bin { predicted: 0.0, observed: 0.0, patches: 0 }; 10];
    for (row, structure) in samples.rows() {
        let p = 1.0 / (1.0 + (-f64::from(logit(row, weights, bias))).exp());
        let bin = &mut bins[((p * 10.0) as usize).min(9)];
        bin.predicted += p;
        bin.observed += f64::from(u8::from(structure));
        bin.patches += 1;
    }
    let mean = |b: &Bin| Bin { predicted: b.predicted / b.patches as f64, observed: b.observed / b.patches as f64, ..*b };
    bins.iter().filter(|b| b.patches > 0).map(mean).collect()
}

fn logit(row: &[f32], weights: &[f32], bias: f32) -> f32 {
    row.iter().zip(weights).map(|(f, w)| f * w).sum::<f32>() + bias
}

/// An image on which the mask is far from the label.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstImage {
    /// Its number among those that were given.
    pub image: usize,
    /// Area of structure in mask and label over that in either, 0..=1.
    pub iou: f64,
}

/// How good a model is on the images that were held out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrainingFigures {
    /// Images that it was trained with.
    pub images: usize,
    /// Images held out.
    pub images_held_out: usize,
    /// Patches of them.
    pub patches_held_out: usize,
    /// These by class.
    pub confusion: Confusion,
    /// The calibration curve.
    pub reliability: Vec<Bin>,
    /// Mean over the images held out of the intersection over union of mask and label.
    pub mean_iou: f64,
    /// The images with the smallest, worst first.
    pub worst: Vec<WorstImage>,
}

impl TrainingFigures {
    pub(super) fn for_card(&self) -> Figures {
        let round = |v: f64| (v * 1e4).round() / 1e4;
        Figures {
            accuracy: round(self.confusion.accuracy()),
            precision: round(self.confusion.precision()),
            recall: round(self.confusion.recall()),
            mean_iou: round(self.mean_iou),
            patches: self.patches_held_out,
            images: self.images_held_out,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_four_patches() {
        // One feature that is the logit.
        let features = vec![3.0, -1.0, 0.5, -4.0];
        let samples = Samples { width: 1, features, structure: vec![true, true, false, false] };
        let confusion = Confusion::of(&samples, &[1.0], 0.0);
        assert_eq!(confusion, Confusion { true_structure: 1, false_structure: 1, true_background: 1, false_background: 1 });
        assert_eq!((confusion.accuracy(), confusion.precision(), confusion.recall()), (0.5, 0.5, 0.5));
        let bins = reliability(&samples, &[1.0], 0.0);
        // Probabilities 0.95, 0.27, 0.62, 0.02.
        assert_eq!(bins.iter().map(|b| (b.patches, b.observed)).collect::<Vec<_>>(), [(1, 0.0), (1, 1.0), (1, 0.0), (1, 1.0)]);
        assert!((bins[1].predicted - 0.2689).abs() < 1e-4);
    }
}
