//! The literal route: every patch is classified by itself.

use super::Logits;
use super::maps::normalised;
use crate::quadtree::Patch;
use imaging::resize_area_rgb;
use models::{InputCard, Model, ModelError, Tensor};
use rayon::prelude::*;
use scene::Raster;

/// Patches in one call of the network: enough that calls cost nothing, few enough to stay in the cache.
const BATCH: usize = 64;

/// The pixels that a classifier sees of a patch, columns and rows, each first and one past the last: the patch itself, or what lies around its middle, where it is smaller than
/// `min_patch` of the long side. Moved into the image at its border.
#[must_use]
pub fn window(patch: Patch, width: usize, height: usize, min_patch: f64) -> [usize; 4] {
    let [left, right, top, bottom] = patch.pixels(width, height);
    let least = (min_patch * width.max(height) as f64).round() as usize;
    let grown = |from: usize, to: usize, length: usize| {
        let size = (to - from).max(least).min(length);
        let first = (from + to).saturating_sub(size).div_euclid(2).min(length - size);
        (first, first + size)
    };
    let ((left, right), (top, bottom)) = (grown(left, right, width), grown(top, bottom, height));
    [left, right, top, bottom]
}

/// What the network sees of a patch, appended to `values`.
pub(crate) fn append_patch(image: &Raster<[u8; 3]>, patch: Patch, input: &InputCard, values: &mut Vec<f32>) {
    let [left, right, top, bottom] = window(patch, image.width(), image.height(), input.min_patch);
    let mut pixels = Vec::with_capacity((right - left) * (bottom - top));
    (top..bottom).for_each(|y| pixels.extend_from_slice(&image.row(y)[left..right]));
    let cut = Raster::from_vec(right - left, bottom - top, pixels).expect("one value a pixel was pushed");
    normalised(&resize_area_rgb(&cut, input.width, input.height), input, values);
}

/// Classifies patches in batches.
pub(super) struct Batches<'a> {
    pub model: &'a Model,
}

impl Logits for Batches<'_> {
    fn logits(&mut self, image: &Raster<[u8; 3]>, patches: &[Patch]) -> Result<Vec<f32>, ModelError> {
        let card = self.model.card();
        let structure = card.structure_index();
        // Batches of a fixed size: the values do not depend on the number of threads.
        let batches: Vec<Result<Vec<f32>, ModelError>> = patches
            .par_chunks(BATCH)
            .map(|patches| {
                let mut values = Vec::with_capacity(patches.len() * 3 * card.input.width * card.input.height);
                patches.iter().for_each(|&patch| append_patch(image, patch, &card.input, &mut values));
                let found = self.model.run([patches.len(), 3, card.input.height, card.input.width], &values, &[&card.output])?;
                Ok(rows(&found[0], patches.len(), &card.output)?.iter().map(|row| logit(row, structure)).collect())
            })
            .collect();
        let mut logits = Vec::with_capacity(patches.len());
        for batch in batches {
            logits.extend(batch?);
        }
        Ok(logits)
    }
}

/// One row of two values a patch. A network whose axes are of any length says only here how many classes it has.
fn rows<'t>(found: &'t Tensor, patches: usize, output: &str) -> Result<&'t [[f32; 2]], ModelError> {
    let wrong = |reason: String| ModelError::Shape { model: output.into(), reason };
    if found.shape != [patches, 2] {
        return Err(wrong(format!("it gives {:?} for {patches} patches; [{patches}, 2] is needed", found.shape)));
    }
    if found.data.iter().any(|v| v.is_nan()) {
        return Err(wrong("it gives values that are no numbers".to_owned()));
    }
    Ok(found.data.as_chunks::<2>().0)
}

/// The logit of structure from logits or probabilities of both classes.
fn logit(row: &[f32; 2], structure: usize) -> f32 {
    let (of_structure, of_background) = (row[structure], row[1 - structure]);
    // What lies in 0..=1 and sums to one are probabilities.
    let probabilities = row.iter().all(|v| (0.0..=1.0).contains(v)) && (of_structure + of_background - 1.0).abs() < 1e-4;
    if probabilities { (of_structure.max(1e-7) / of_background.max(1e-7)).ln() } else { of_structure - of_background }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_lie_around_their_cell_and_in_the_image() {
        let cell = |column, row| window(Patch { level: 7, column, row }, 1920, 1200, 0.025);
        assert_eq!(cell(64, 64), [943, 991, 580, 628]);
        assert_eq!(cell(0, 127), [0, 48, 1152, 1200]);
        // Larger patches are shown as they are.
        assert_eq!(window(Patch { level: 2, column: 1, row: 3 }, 1920, 1200, 0.025), [480, 960, 900, 1200]);
        assert_eq!(window(Patch::ROOT, 5, 3, 1.0), [0, 5, 0, 3]);
    }

    #[test]
    fn other_numbers_of_classes_and_no_numbers_are_refused() {
        let tensor = |shape: &[usize], value: f32| Tensor { shape: shape.to_vec(), data: vec![value; shape.iter().product()] };
        assert_eq!(rows(&tensor(&[2, 2], 0.5), 2, "logits").expect("two classes"), [[0.5; 2]; 2]);
        for (shape, value, expected) in
            [(&[2, 3][..], 0.5, "[2, 3]"), (&[2, 1], 0.5, "[2, 1]"), (&[4], 0.5, "[4]"), (&[2, 2], f32::NAN, "no numbers")]
        {
            let error = rows(&tensor(shape, value), 2, "logits").expect_err("refused").to_string();
            assert!(error.contains(expected) && error.contains("logits"), "{error}");
        }
    }

    #[test]
    fn logits_come_from_logits_or_probabilities() {
        assert_eq!(logit(&[-1.5, 2.0], 1), 3.5);
        assert_eq!(logit(&[-1.5, 2.0], 0), -3.5);
        assert!((logit(&[0.2, 0.8], 1) - 4f32.ln()).abs() < 1e-5);
        assert!(logit(&[0.0, 1.0], 1).is_finite());
    }
}
