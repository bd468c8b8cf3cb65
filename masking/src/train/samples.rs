//! Patches with their features and labels.

use super::TrainOptions;
use crate::ml::{append_patch, normalised};
use crate::quadtree::{Patch, usable_levels};
use crate::working_sizes;
use imaging::{resize_area_grey, resize_area_rgb};
use models::{Backbone, ModelError, Tensor};
use scene::{Mask, Raster};

/// Rows of features, and what each shows.
pub(super) struct Samples {
    /// Length of a row.
    pub width: usize,
    /// Row after row.
    pub features: Vec<f32>,
    pub structure: Vec<bool>,
}

impl Samples {
    pub fn new(width: usize) -> Self {
        Self { width, features: Vec::new(), structure: Vec::new() }
    }

    pub fn append(&mut self, other: Self) {
        self.features.extend(other.features);
        self.structure.extend(other.structure);
    }

    pub fn rows(&self) -> impl Iterator<Item = (&[f32], bool)> {
        self.features.chunks_exact(self.width).zip(self.structure.iter().copied())
    }
}

/// Level of the cells of masks.
const CELL_LEVEL: usize = 7;
/// Last level of the quadtree of patches; below, a patch shows no more than its surroundings.
const PATCH_LEVEL: usize = 5;
/// First level: what is larger seldom shows one class alone.
const FIRST_PATCH_LEVEL: usize = 2;
/// A patch above the last level shows background where less than this is structure, and structure where at least half is; between, it is both and is only split.
const MIXED: f32 = 0.05;
/// Patches in one call.
const BATCH: usize = 64;

/// The samples of one image: cells of the whole image as the shared route sees them, and patches by quadtree.
pub(super) fn of_image(
    backbone: &Backbone,
    rgb: &Raster<[u8; 3]>,
    mask: &Mask,
    options: &TrainOptions,
    seed: u64,
) -> Result<Samples, ModelError> {
    let mut samples = Samples::new(backbone.taps().iter().map(|(_, channels)| channels).sum());
    let Some(level) = usable_levels(rgb.width(), rgb.height(), CELL_LEVEL) else { return Ok(samples) };
    let shares: Vec<Raster<f32>> = shares(mask, level);
    let mut values = Vec::new();
    for (i, size) in working_sizes(rgb.width(), rgb.height(), &options.long_sides_px).iter().enumerate() {
        let cells = drawn(Patch::of_level(level), &shares, options.cells, hash(seed, i as u64));
        values.clear();
        normalised(&resize_area_rgb(rgb, size.width, size.height), backbone.input(), &mut values);
        let maps = backbone.run([1, 3, size.height, size.width], &values)?;
        for (cell, structure) in cells {
            let side = (1usize << level) as f32;
            let at = [(cell.column as f32 + 0.5) / side, (cell.row as f32 + 0.5) / side];
            maps.iter().for_each(|map| interpolate(map, at, &mut samples.features));
            samples.structure.push(structure);
        }
    }
    let patches = drawn(quadtree_patches(level), &shares, options.patches, hash(seed, 99));
    for batch in patches.chunks(BATCH) {
        values.clear();
        batch.iter().for_each(|(patch, _)| append_patch(rgb, *patch, backbone.input(), &mut values));
        let maps = backbone.run([batch.len(), 3, backbone.input().height, backbone.input().width], &values)?;
        for (i, (_, structure)) in batch.iter().enumerate() {
            maps.iter().for_each(|map| pool(map, i, &mut samples.features));
            samples.structure.push(*structure);
        }
    }
    Ok(samples)
}

/// Share of structure of the patches of every level, up to `level`.
fn shares(mask: &Mask, level: usize) -> Vec<Raster<f32>> {
    let ones = mask.map(|&v| if v > 127 { 1.0 } else { 0.0 });
    (0..=level).map(|l| resize_area_grey(&ones, 1 << l, 1 << l)).collect()
}

/// Patches of all levels that a quadtree may ask for, and cells.
fn quadtree_patches(level: usize) -> Vec<Patch> {
    let levels = FIRST_PATCH_LEVEL.min(level)..=PATCH_LEVEL.min(level);
    levels.chain((level > PATCH_LEVEL).then_some(level)).flat_map(Patch::of_level).collect()
}

/// At most `count` patches of each class, drawn by the seed, in order; each level has its share.
fn drawn(patches: Vec<Patch>, shares: &[Raster<f32>], count: usize, seed: u64) -> Vec<(Patch, bool)> {
    let labelled = patches.into_iter().enumerate().filter_map(|(i, patch)| {
        let share = shares[patch.level][(patch.column, patch.row)];
        let pure = patch.level >= PATCH_LEVEL || !(MIXED..0.5).contains(&share);
        // Finer levels have four times as many patches each; divided by them, levels take their turn.
        pure.then_some((hash(seed, i as u64) >> (2 * (CELL_LEVEL - patch.level.min(CELL_LEVEL))), i, patch, share >= 0.5))
    });
    let (mut structure, mut background): (Vec<_>, Vec<_>) = labelled.partition(|l| l.3);
    let mut taken: Vec<(usize, Patch, bool)> = Vec::new();
    for class in [&mut structure, &mut background] {
        class.sort_unstable_by_key(|l| (l.0, l.1));
        taken.extend(class.iter().take(count).map(|l| (l.1, l.2, l.3)));
    }
    taken.sort_unstable_by_key(|l| l.0);
    taken.into_iter().map(|(_, patch, structure)| (patch, structure)).collect()
}

/// The value of each channel at a place, in shares of the width and height, linear between the centres of pixels.
fn interpolate(map: &Tensor, at: [f32; 2], row: &mut Vec<f32>) {
    let (height, width) = (map.shape[2], map.shape[3]);
    let place = |at: f32, length: usize| {
        let x = (at * length as f32 - 0.5).clamp(0.0, (length - 1) as f32);
        let first = (x as usize).min(length.saturating_sub(2));
        (first, (first + 1).min(length - 1), x - first as f32)
    };
    let ((left, right, fx), (top, bottom, fy)) = (place(at[0], width), place(at[1], height));
    for plane in map.data.chunks_exact(width * height) {
        let line = |y: usize| plane[y * width + left] * (1.0 - fx) + plane[y * width + right] * fx;
        row.push(line(top) * (1.0 - fy) + line(bottom) * fy);
    }
}

/// The mean of each channel of the `i`-th of a batch.
fn pool(map: &Tensor, i: usize, row: &mut Vec<f32>) {
    let pixels = map.shape[2] * map.shape[3];
    let planes = map.data.chunks_exact(pixels).skip(i * map.shape[1]).take(map.shape[1]);
    row.extend(planes.map(|plane| plane.iter().sum::<f32>() / pixels as f32));
}

/// A number that looks random, from a seed and a place (splitmix64; Steele et al., *Fast splittable pseudorandom number generators*, OOPSLA 2014).
pub(super) fn hash(seed: u64, place: u64) -> u64 {
    let mut z = seed.wrapping_mul(0xD134_2543_DE82_EF95).wrapping_add(place.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_keeps_a_plane_and_pooling_is_the_mean() {
        let data: Vec<f32> = (0..2 * 3 * 4).map(|i| if i < 12 { (i % 4) as f32 + 10.0 * (i / 4) as f32 } else { 7.0 }).collect();
        let map = Tensor { shape: vec![1, 2, 3, 4], data };
        let mut row = Vec::new();
        interpolate(&map, [0.5, 0.5], &mut row);
        assert_eq!(row, [1.5 + 10.0, 7.0]);
        row.clear();
        interpolate(&map, [1.0, 0.0], &mut row);
        assert_eq!(row, [3.0, 7.0], "continued beyond the outer centres");
        row.clear();
        pool(&map, 0, &mut row);
        assert_eq!(row, [11.5, 7.0]);
    }

    #[test]
    fn patches_are_drawn_by_class_and_mixed_ones_only_at_the_last_level() {
        let mut mask = Raster::filled(256, 256, 0u8);
        (0..256).for_each(|y| mask.row_mut(y)[..100].fill(255));
        let shares = shares(&mask, 7);
        let drawn = drawn(quadtree_patches(7), &shares, 50, 3);
        assert_eq!(drawn.iter().filter(|d| d.1).count(), 50);
        assert_eq!(drawn.len(), 100);
        for (patch, structure) in &drawn {
            let share = shares[patch.level][(patch.column, patch.row)];
            assert_eq!(share >= 0.5, *structure);
            assert!(patch.level >= PATCH_LEVEL || !(MIXED..0.5).contains(&share));
        }
        for level in [2, 3, 4, 5, 7] {
            assert!(drawn.iter().any(|d| d.0.level == level), "level {level}");
        }
    }
}
