//! The classifier route.

mod cells;
mod maps;
mod patches;

pub use cells::{CellMask, CleanUp, clean_up};
pub use maps::{WorkingSize, working_sizes};
pub use patches::window;

pub(crate) use maps::normalised;
pub(crate) use patches::append_patch;

use crate::quadtree::{Patch, PatchClassifier, leaves, usable_levels};
use models::{Model, ModelError};
use scene::{Mask, Raster};

/// How the patches of the quadtree get their logits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Route {
    /// The network runs over the whole image at a few sizes, and the logit of a cell is the mean of the maps over it. Needs a model with maps.
    #[default]
    Shared,
    /// The network runs for every patch, all patches of a level in batches: as in the paper, for any classifier.
    Patches,
}

/// Options of the classifier route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MlOptions {
    /// How the patches get their logits.
    pub route: Route,
    /// Depth of the quadtree: at 7 the cells of an image of 1920 x 1200 have 15 x 9 pixels.
    pub levels: usize,
    /// What is done with the cells.
    pub clean_up: CleanUp,
}

/// Most levels of the quadtree: 4^10 cells.
pub const MAX_LEVELS: usize = 10;

impl Default for MlOptions {
    fn default() -> Self {
        Self { route: Route::Shared, levels: 7, clean_up: CleanUp::default() }
    }
}

/// A mask, and how sure the classifier is of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MlMask {
    /// 255 structure, 0 background; the size of the image.
    pub mask: Mask,
    /// Patches that were classified.
    pub patches: usize,
    /// Mean over the area of the probability of the class that was not taken, of what the last level classified, 0..=0.5; 0 where the whole image is background at a glance.
    pub doubt: f64,
}

/// Masks an image by split and merge with a classifier, see [`crate::quadtree::segment`]. By [`Route::Patches`] a patch is split where its logit reaches the threshold of its level on
/// the card of the model, by [`Route::Shared`] where one of its cells is structure; the patches of the last level are structure from the card's `decision` on. The cells are cleaned up then, see [`clean_up`].
///
/// The route [`Route::Shared`] falls back to [`Route::Patches`] where the card names no maps.
///
/// # Errors
/// Where the runtime refuses an image.
pub fn ml_mask(rgb: &Raster<[u8; 3]>, model: &Model, options: &MlOptions) -> Result<MlMask, ModelError> {
    let (width, height) = (rgb.width(), rgb.height());
    let empty = || MlMask { mask: Raster::filled(width, height, 0), patches: 0, doubt: 0.0 };
    let Some(levels) = usable_levels(width, height, options.levels.min(MAX_LEVELS)) else { return Ok(empty()) };
    let card = model.card();
    let (found, last, patches) = match (&card.maps, options.route) {
        (Some(maps), Route::Shared) => {
            let pyramid = maps::logits(rgb, model, maps, levels)?;
            search(rgb, maps::Lookup { pyramid }, &[], card.decision, levels)?
        }
        _ => search(rgb, patches::Batches { model }, &card.thresholds, card.decision, levels)?,
    };
    let mut cells = CellMask::new(levels);
    for patch in found {
        cells.add(patch);
    }
    let core = card.core.map(|core| {
        let mut cells = CellMask::new(levels);
        last.iter().filter(|(_, logit)| *logit >= core).for_each(|(patch, _)| cells.add(*patch));
        cells
    });
    let doubt = last.iter().map(|(_, logit)| 1.0 / (1.0 + f64::from(logit.abs()).exp())).sum::<f64>() / last.len().max(1) as f64;
    Ok(MlMask { mask: clean_up(&cells, core.as_ref(), &options.clean_up).to_mask(width, height), patches, doubt })
}

/// The logits of all patches down to a level, whether a quadtree would ask for them or not.
pub(crate) struct CellLogits(Vec<cells::Grid>);

impl CellLogits {
    /// Row after row.
    pub fn of_level(&self, level: usize) -> &[f32] {
        &self.0[level].values
    }
}

pub(crate) fn cell_logits(rgb: &Raster<[u8; 3]>, model: &Model, route: Route, levels: usize) -> Result<CellLogits, ModelError> {
    if let (Some(maps), Route::Shared) = (&model.card().maps, route) {
        return Ok(CellLogits(maps::logits(rgb, model, maps, levels)?));
    }
    let mut batches = patches::Batches { model };
    let of_level = |level| Ok(cells::Grid { level, values: batches.logits(rgb, &Patch::of_level(level))? });
    Ok(CellLogits((0..=levels).map(of_level).collect::<Result<_, ModelError>>()?))
}

/// Gives patches of one level their logits.
trait Logits {
    fn logits(&mut self, image: &Raster<[u8; 3]>, patches: &[Patch]) -> Result<Vec<f32>, ModelError>;
}

/// What has a logit is a classifier by thresholds.
struct Thresholded<'a, L> {
    logits: L,
    thresholds: &'a [f32],
    /// From which a patch of the last level is structure.
    decision: f32,
    levels: usize,
    /// Patches that were classified.
    count: usize,
    /// Those of the last call, with their logits.
    last: Vec<(Patch, f32)>,
}

impl<L: Logits> PatchClassifier for Thresholded<'_, L> {
    type Error = ModelError;

    fn classify(&mut self, image: &Raster<[u8; 3]>, patches: &[Patch]) -> Result<Vec<bool>, ModelError> {
        let logits = self.logits.logits(image, patches)?;
        self.count += patches.len();
        self.last = patches.iter().copied().zip(logits.iter().copied()).collect();
        let split = |level: usize| self.thresholds.get(level).or(self.thresholds.last()).copied().unwrap_or(self.decision);
        let threshold = |level: usize| if level < self.levels { split(level) } else { self.decision };
        Ok(patches.iter().zip(&logits).map(|(patch, &logit)| logit >= threshold(patch.level)).collect())
    }
}

/// Leaves, and what the last level classified; the number of all patches.
type Found = (Vec<Patch>, Vec<(Patch, f32)>, usize);

fn search<L: Logits>(image: &Raster<[u8; 3]>, logits: L, thresholds: &[f32], decision: f32, levels: usize) -> Result<Found, ModelError> {
    let mut classifier = Thresholded { logits, thresholds, decision, levels, count: 0, last: Vec::new() };
    let leaves = leaves(image, &mut classifier, levels)?;
    // Where a coarser level found nothing, no cell was looked at.
    classifier.last.retain(|(patch, _)| patch.level == levels);
    Ok((leaves, classifier.last, classifier.count))
}

#[cfg(test)]
mod tests;
