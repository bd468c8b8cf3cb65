//! The vote of neighbouring exposures on masks.

use super::images::{ImageEntry, ImageList};
use super::mask::STAGE;
use super::single_masks::Singles;
use crate::stage::Work;
use crate::store::Fingerprint;
use anyhow::{Context, Result};
use masking::{Glimpse, Neighbour, motion, vote};
use rayon::prelude::*;
use scene::Mask;

/// Where the mask of a single image lies while its neighbours vote on it.
pub(super) fn single_file(list: &ImageList, image: &ImageEntry, strategy: &str) -> String {
    list.path_for(&format!("masks/single/{strategy}"), image, "png")
}

/// Where the small grey image lies that motions are found with.
pub(super) fn glimpse_file(list: &ImageList, image: &ImageEntry) -> String {
    list.path_for("masks/glimpses", image, "png")
}

/// Makes the masks of all images from those of single images, whose `keys` are given in the order of the list; none where an image has no mask.
pub(super) fn vote_on_all(
    singles: &Singles<'_>,
    keys: &[Option<Fingerprint>],
    file: &(dyn Fn(&ImageEntry) -> String + Sync),
) -> Result<()> {
    let (work, list) = (singles.work, singles.list);
    let reach = work.config.mask.vote as usize;
    work.progress.begin("votes", list.images.len());
    let one = |i: usize| -> Result<()> {
        work.progress.advance(1);
        let (image, Some(key)) = (&list.images[i], keys[i]) else { return Ok(()) };
        // Images are in the order of their exposures, camera after camera.
        let votes = |j: &usize| list.images[*j].camera == image.camera && keys[*j].is_some();
        let earlier: Vec<usize> = (i.saturating_sub(reach)..i).filter(votes).collect();
        let later: Vec<usize> = (i + 1..(i + 1 + reach).min(list.images.len())).filter(votes).collect();
        let (version, moving) = (STAGE.version.to_le_bytes(), singles.moving.fingerprint(image));
        let mut parts = vec![("version", version.to_vec()), ("own", key.as_bytes().to_vec()), ("image", image.content.as_bytes().to_vec())];
        for (side, neighbours) in [("earlier", &earlier), ("later", &later)] {
            for &j in neighbours {
                let of = [keys[j].map(|k| k.as_bytes().to_vec()).unwrap_or_default(), list.images[j].content.as_bytes().to_vec()];
                parts.push((side, of.concat()));
            }
        }
        parts.extend(moving.map(|m| ("moving", m.as_bytes().to_vec())));
        let key = Fingerprint::of_parts(parts.iter().map(|(name, bytes)| (*name, bytes.as_slice())));
        work.files.item(&file(image), key, || {
            let mut mask = voted(work, list, image, &earlier, &later)?;
            singles.moving.cut(image, &mut mask);
            Ok(imaging::encode_png_grey(&mask)?)
        })
    };
    (0..list.images.len()).into_par_iter().try_for_each(one)
}

fn voted(work: &Work<'_>, list: &ImageList, image: &ImageEntry, earlier: &[usize], later: &[usize]) -> Result<Mask> {
    let strategy = work.config.mask.strategy.name();
    let read = |path: String| -> Result<Mask> {
        imaging::decode_grey_u8(&std::fs::read(work.store.path(&path)).with_context(|| path.clone())?).with_context(|| path.clone())
    };
    let glimpse = |image: &ImageEntry| Ok::<_, anyhow::Error>(Glimpse::from_luma(read(glimpse_file(list, image))?));
    let own = glimpse(image)?;
    let side = |neighbours: &[usize]| -> Result<Vec<_>> {
        let mut found = Vec::new();
        for &j in neighbours {
            if let Some(motion) = motion(&own, &glimpse(&list.images[j])?) {
                found.push((read(single_file(list, &list.images[j], strategy))?, motion));
            }
        }
        Ok(found)
    };
    let (earlier, later) = (side(earlier)?, side(later)?);
    let [earlier, later] =
        [&earlier, &later].map(|side| side.iter().map(|(mask, motion)| Neighbour { mask, motion: *motion }).collect::<Vec<_>>());
    Ok(vote(&read(single_file(list, image, strategy))?, &earlier, &later))
}
