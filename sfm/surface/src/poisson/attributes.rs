//! Colours of the vertices from the points nearby.

use super::density::Splat;
use super::samples::{Sample, Samples};
use rayon::prelude::*;
use scene::Cloud;

/// Least summed weight of the points that give a colour.
const MIN_WEIGHT: f32 = 1e-3;
/// Coarsest level that colours are taken from.
const COARSEST: u32 = 2;

/// The mean colour of the points around each vertex, by a quadratic B-spline three of the finest cells wide, or of coarser cells where there
/// are none so near. Empty where the cloud has no colours.
pub(super) fn colours(cloud: &Cloud, samples: &Samples, vertices: &[[f64; 3]]) -> Vec<[u8; 3]> {
    if cloud.colours.len() != cloud.len() {
        return Vec::new();
    }
    let value = |s: &Sample| {
        let [r, g, b] = cloud.colours[s.index as usize].map(f32::from);
        [r, g, b, 1.0].map(|v| v * s.confidence)
    };
    let mut found: Vec<Option<[u8; 3]>> = vec![None; vertices.len()];
    let mut level = samples.depth;
    loop {
        let splat = Splat::<4>::new(samples, level, value);
        let open: usize = found
            .par_chunks_mut(4096)
            .zip(vertices.par_chunks(4096))
            .map(|(found, vertices)| {
                let mut last = None;
                for (found, vertex) in found.iter_mut().zip(vertices).filter(|(f, _)| f.is_none()) {
                    let [r, g, b, w] = splat.at(vertex, &mut last);
                    if w > MIN_WEIGHT {
                        *found = Some([r, g, b].map(|v| (v / w).round() as u8));
                    }
                }
                found.iter().filter(|f| f.is_none()).count()
            })
            .sum();
        if open == 0 || level <= COARSEST {
            break;
        }
        level -= 1;
    }
    found.into_iter().map(Option::unwrap_or_default).collect()
}
