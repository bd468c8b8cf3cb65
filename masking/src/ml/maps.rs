//! The route that shares its computation: the network runs over the whole image.

use super::Logits;
use super::cells::Grid;
use crate::quadtree::Patch;
use imaging::{resize_area_grey, resize_area_rgb};
use models::{InputCard, MapsCard, Model, ModelError, Tensor};
use scene::Raster;

/// A size that an image is brought to before the network sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkingSize {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Strides of networks divide this: sides that are its multiples have maps without a rest.
const STRIDE: usize = 32;

/// The sizes that an image is brought to for long sides: in its proportions up to the rounding of its sides to multiples of 32.
#[must_use]
pub fn working_sizes(width: usize, height: usize, long_sides_px: &[usize]) -> Vec<WorkingSize> {
    let size = |&long: &usize| {
        let scale = long as f64 / width.max(height).max(1) as f64;
        let side = |length: usize| ((length as f64 * scale / STRIDE as f64).round() as usize).max(1) * STRIDE;
        WorkingSize { width: side(width), height: side(height) }
    };
    long_sides_px.iter().map(size).collect()
}

/// Pixels as a network takes them: plane after plane, appended to `values`.
pub(crate) fn normalised(rgb: &Raster<[u8; 3]>, input: &InputCard, values: &mut Vec<f32>) {
    for channel in 0..3 {
        let (mean, scale) = (input.mean[channel], 1.0 / input.std[channel]);
        values.extend(rgb.data().iter().map(|pixel| (f32::from(pixel[channel]) - mean) * scale));
    }
}

/// The maps of the image at each working size, in the order of `maps.outputs`.
pub(crate) fn run(rgb: &Raster<[u8; 3]>, model: &Model, long_sides_px: &[usize], outputs: &[&str]) -> Result<Vec<Vec<Tensor>>, ModelError> {
    let mut values = Vec::new();
    let one = |size: &WorkingSize| {
        let small = resize_area_rgb(rgb, size.width, size.height);
        values.clear();
        normalised(&small, &model.card().input, &mut values);
        model.run([1, 3, size.height, size.width], &values, outputs)
    };
    working_sizes(rgb.width(), rgb.height(), long_sides_px).iter().map(one).collect()
}

/// The logits of the cells of all levels.
pub(super) fn logits(rgb: &Raster<[u8; 3]>, model: &Model, maps: &MapsCard, levels: usize) -> Result<Vec<Grid>, ModelError> {
    let outputs: Vec<&str> = maps.outputs.iter().map(String::as_str).collect();
    let side = 1usize << levels;
    let mut sums = vec![0.0f32; side * side];
    let sizes = run(rgb, model, &maps.long_sides_px, &outputs)?;
    for tensor in sizes.iter().flatten() {
        let map = map_of(tensor).ok_or_else(|| ModelError::Shape {
            model: maps.outputs.join(", ").into(),
            reason: format!("a map of shape {:?}, where [1, 1, h, w] is needed", tensor.shape),
        })?;
        let cells = resize_area_grey(&map, side, side);
        sums.iter_mut().zip(cells.data()).for_each(|(sum, &v)| *sum += v);
    }
    let scale = 1.0 / sizes.len() as f32;
    sums.iter_mut().for_each(|sum| *sum = *sum * scale + maps.bias);
    Ok(Grid { level: levels, values: sums }.pyramid())
}

fn map_of(tensor: &Tensor) -> Option<Raster<f32>> {
    match tensor.shape.as_slice() {
        &[1, 1, height, width] => Raster::from_vec(width, height, tensor.data.clone()),
        _ => None,
    }
}

/// Looks logits up.
pub(super) struct Lookup {
    pub pyramid: Vec<Grid>,
}

impl Logits for Lookup {
    fn logits(&mut self, _: &Raster<[u8; 3]>, patches: &[Patch]) -> Result<Vec<f32>, ModelError> {
        Ok(patches.iter().map(|&patch| self.pyramid[patch.level].at(patch)).collect())
    }
}
