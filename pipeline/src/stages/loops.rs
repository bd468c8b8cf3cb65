//! Pairs of images far apart along the path that resemble each other.

use super::features;
use super::images::ImageList;
use crate::stage::Work;
use ::features::pairs::{LoopOptions, loop_candidates};
use ::features::{Codebook, GlobalDescriptor, RetrievalOptions};
use anyhow::Result;
use rayon::prelude::*;
use scene::{Descriptor, ImageId};

/// Seed of the vocabulary: a draw of it is as good as another.
const SEED: u64 = 0;

/// Candidates for loops farther than `window` exposures along the path, from a vocabulary that the dive itself gives.
///
/// # Errors
/// When the features of an image cannot be read.
pub fn candidates(work: &Work<'_>, list: &ImageList, exposures: &[u32], window: u32) -> Result<Vec<(ImageId, ImageId)>> {
    let (options, count) = (RetrievalOptions::default(), list.images.len());
    work.progress.begin("looking for loops", 2 * count);
    // The descriptors of all images would not fit into memory: each is read twice.
    let shares: Vec<Vec<Descriptor>> = each(work, list, |descriptors| Codebook::share(descriptors, count, &options).copied().collect())?;
    let codebook = Codebook::learn(&shares.concat(), &options, SEED)?;
    drop(shares);
    let described: Vec<Option<GlobalDescriptor>> = each(work, list, |descriptors| Some(codebook.describe(descriptors)))?;
    Ok(loop_candidates(&described, exposures, &LoopOptions { window, ..LoopOptions::default() }))
}

fn each<T: Send>(work: &Work<'_>, list: &ImageList, of: impl Fn(&[Descriptor]) -> T + Sync) -> Result<Vec<T>> {
    list.images
        .par_iter()
        .map(|image| {
            let stored = features::load(work, list, image)?;
            let made = of(&stored.features.descriptors);
            work.progress.advance(1);
            Ok(made)
        })
        .collect()
}
