//! Thresholds of the quadtree and the core of hysteresis, from images that were held out.

use super::TrainError;
use super::figures::WorstImage;
use crate::ml::{CellLogits, cell_logits};
use crate::quadtree::usable_levels;
use crate::{BitMask, Route, ml_mask};
use models::{Card, Model, Runtime};
use rayon::prelude::*;
use scene::{Mask, Raster};
use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Depth of the quadtree that thresholds are for.
const LEVELS: usize = 7;
/// Patches of the levels before this one are always split: they are few, and may show so little structure that nothing tells.
const ALWAYS_SPLIT: usize = 4;
/// Levels of which every patch is classified by itself; finer ones see hardly less than their quarters, and take the threshold of the last.
const PATCH_LEVELS: usize = 5;
/// Share of the structure that may be lost at each level by not splitting a patch.
const LOST_BY_LEVEL: f64 = 2e-4;
/// Share of the structure that may be lost for want of a core.
const LOST_BY_CORE: f64 = 5e-4;
/// The core asks for no more certainty than this, 99 %: logits of real images spread less than those of the images trained with.
const MAX_CORE: f32 = 5.0;
/// Images that are enough to calibrate with.
const ENOUGH: usize = 40;
/// Images with the smallest intersection over union that are told.
const WORST: usize = 5;

pub(super) struct Calibrated {
    pub model: Model,
    pub mean_iou: f64,
    pub worst: Vec<WorstImage>,
}

/// Logits of patches with the area of structure that they hold.
type Weighted = Vec<(f32, f64)>;

pub(super) fn calibrate<E: std::error::Error + Send + 'static>(
    model: &Model,
    runtime: &Runtime,
    images: &[usize],
    load: &(impl Fn(usize) -> Result<(Raster<[u8; 3]>, Mask), E> + Sync),
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Calibrated, TrainError<E>> {
    let done = AtomicUsize::new(0);
    // Spread over all: neighbours are alike.
    let step = images.len().div_ceil(ENOUGH).max(1);
    let some: Vec<usize> = images.iter().step_by(step).copied().collect();
    let found: Vec<Result<OfImage, TrainError<E>>> = some
        .par_iter()
        .map(|&i| {
            let (rgb, mask) = load(i).map_err(TrainError::Load)?;
            let found = of_image(model, &rgb, &mask)?;
            progress((done.fetch_add(1, Ordering::Relaxed) + 1) * step);
            Ok(found)
        })
        .collect();
    let found = found.into_iter().collect::<Result<Vec<_>, _>>()?;
    let total: f64 = found.iter().map(|f| f.structure).sum();
    let threshold = |of: &dyn Fn(&OfImage) -> &Weighted, lost: f64| largest_losing(found.iter().flat_map(of), lost * total);
    let mut card: Card = model.card().clone();
    card.thresholds = vec![f32::NEG_INFINITY; ALWAYS_SPLIT];
    card.thresholds.extend((ALWAYS_SPLIT..=PATCH_LEVELS).map(|l| threshold(&|f| &f.patches[l], LOST_BY_LEVEL).min(card.decision)));
    card.core = Some(threshold(&|f| &f.parts, LOST_BY_CORE).min(MAX_CORE));
    let model = Model::new(card, format!("{}.onnx", model.card().name).into(), Cow::Owned(model.bytes().to_vec()), runtime)?;
    let (mean_iou, worst) = judge(&model, images, load)?;
    Ok(Calibrated { model, mean_iou, worst })
}

struct OfImage {
    /// Area of structure, in images.
    structure: f64,
    /// By level.
    patches: Vec<Weighted>,
    /// Connected parts of the cells that are called structure: the largest logit, and the area of structure.
    parts: Weighted,
}

fn of_image<E: std::error::Error + 'static>(model: &Model, rgb: &Raster<[u8; 3]>, mask: &Mask) -> Result<OfImage, TrainError<E>> {
    let Some(levels) = usable_levels(rgb.width(), rgb.height(), LEVELS) else {
        return Ok(OfImage { structure: 0.0, patches: vec![Vec::new(); PATCH_LEVELS + 1], parts: Vec::new() });
    };
    let ones = mask.map(|&v| if v > 127 { 1.0 } else { 0.0 });
    let areas: Vec<Raster<f32>> = (0..=levels).map(|l| imaging::resize_area_grey(&ones, 1 << l, 1 << l)).collect();
    let weighted = |logits: &CellLogits, level: usize| -> Weighted {
        let scale = 1.0 / (1u64 << (2 * level)) as f64;
        let areas = areas[level].data().iter().map(|&a| f64::from(a) * scale);
        logits.of_level(level).iter().copied().zip(areas).filter(|(_, area)| *area > 0.0).collect()
    };
    let shared = cell_logits(rgb, model, Route::Shared, levels)?;
    let patches = cell_logits(rgb, model, Route::Patches, PATCH_LEVELS.min(levels))?;
    Ok(OfImage {
        structure: f64::from(areas[0].data()[0]),
        parts: parts(&shared, &areas[levels], levels, model.card().decision),
        patches: (0..=PATCH_LEVELS).map(|l| if l <= levels { weighted(&patches, l) } else { Vec::new() }).collect(),
    })
}

/// The connected parts of the cells with logits from `decision` on: their largest logit, and the area of structure in them.
fn parts(logits: &CellLogits, areas: &Raster<f32>, level: usize, decision: f32) -> Weighted {
    let side = 1usize << level;
    let values = logits.of_level(level);
    let mut left = BitMask::from_test(side, side, values, |v| v >= decision);
    let mut parts = Weighted::new();
    let scale = 1.0 / (side * side) as f64;
    for start in 0..side * side {
        if !left.get(start % side, start / side) {
            continue;
        }
        let (mut largest, mut area) = (f32::MIN, 0.0);
        let mut open = vec![(start % side, start / side)];
        left.clear(start % side, start / side);
        while let Some((x, y)) = open.pop() {
            largest = largest.max(values[y * side + x]);
            area += f64::from(areas.data()[y * side + x]) * scale;
            for (i, j) in neighbours(x, y).filter(|&(i, j)| i < side && j < side) {
                if left.get(i, j) {
                    left.clear(i, j);
                    open.push((i, j));
                }
            }
        }
        parts.push((largest, area));
    }
    parts
}

fn neighbours(x: usize, y: usize) -> impl Iterator<Item = (usize, usize)> {
    let around = move |i: usize| [i.wrapping_sub(1), i, i + 1];
    around(y).into_iter().flat_map(move |j| around(x).into_iter().map(move |i| (i, j)))
}

/// The largest threshold below which lies no more than `lost` of the area; no bound where everything together is no more.
fn largest_losing<'a>(values: impl Iterator<Item = &'a (f32, f64)>, lost: f64) -> f32 {
    let mut values: Vec<(f32, f64)> = values.copied().collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    for (logit, area) in values {
        below += area;
        if below > lost {
            return logit;
        }
    }
    f32::MAX
}

/// Mean intersection over union, and the images with the smallest. An image without structure in mask and label is right: 1.
fn judge<E: std::error::Error + Send + 'static>(
    model: &Model,
    images: &[usize],
    load: &(impl Fn(usize) -> Result<(Raster<[u8; 3]>, Mask), E> + Sync),
) -> Result<(f64, Vec<WorstImage>), TrainError<E>> {
    let judged: Vec<Result<WorstImage, TrainError<E>>> = images
        .par_iter()
        .map(|&image| {
            let (rgb, label) = load(image).map_err(TrainError::Load)?;
            let found = ml_mask(&rgb, model, &crate::MlOptions::default())?;
            let (a, b) = (BitMask::from_mask(&found.mask), BitMask::from_mask(&label));
            let common = a.count_common(&b);
            let either = a.count() + b.count() - common;
            Ok(WorstImage { image, iou: if either == 0 { 1.0 } else { common as f64 / either as f64 } })
        })
        .collect();
    let mut judged = judged.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mean = judged.iter().map(|w| w.iou).sum::<f64>() / judged.len().max(1) as f64;
    judged.sort_by(|a, b| a.iou.total_cmp(&b.iou).then(a.image.cmp(&b.image)));
    judged.truncate(WORST);
    Ok((mean, judged))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_threshold_that_loses_little() {
        let values = [(3.0, 0.5), (-1.0, 0.01), (-5.0, 0.001), (0.5, 0.2)];
        assert_eq!(largest_losing(values.iter(), 0.0), -5.0);
        assert_eq!(largest_losing(values.iter(), 0.002), -1.0);
        assert_eq!(largest_losing(values.iter(), 0.02), 0.5);
        assert_eq!(largest_losing(values.iter(), 1.0), f32::MAX);
    }
}
