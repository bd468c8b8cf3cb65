//! The mask of each image by itself, before its neighbours vote.

use super::images::{ImageEntry, ImageList};
use super::mask::{STAGE, single_options};
use crate::config::{MaskStrategy, OtsuOf};
use crate::masker::{Masker, ip_options};
use crate::moving::Moving;
use crate::stage::Work;
use crate::store::Fingerprint;
use anyhow::{Context, Result};
use masking::Glimpse;
use rayon::prelude::*;
use scene::{Mask, Raster};

/// Makes masks of single images.
pub(super) struct Singles<'w> {
    pub work: &'w Work<'w>,
    pub list: &'w ImageList,
    pub masker: Masker<'w>,
    /// Of each camera, where they are of the whole dive.
    pub thresholds: Vec<Option<u8>>,
    pub moving: Moving,
}

impl Singles<'_> {
    /// Makes or takes over the mask of an image at a path, and a glimpse at another, if it is given; gives the key of the mask, or why the image has none.
    pub fn make(&self, image: &ImageEntry, path: &str, glimpse: Option<&str>, cut: bool) -> Result<Result<Fingerprint, String>> {
        let mut decoded = None;
        if let Some(glimpse) = glimpse {
            let key = glimpse_key(image);
            if !self.work.files.reuse(glimpse, key) {
                let rgb = match imaging::decode_rgb(&self.list.bytes(self.work, image)?) {
                    Ok(rgb) => rgb,
                    Err(error) => return Ok(Err(format!("it cannot be masked: {error}"))),
                };
                self.work.files.save(glimpse, key, &imaging::encode_png_grey(Glimpse::new(&rgb).luma())?)?;
                decoded = Some(rgb);
            }
        }
        match self.work.config.mask.strategy {
            MaskStrategy::Files => self.read_from(image, path, cut),
            MaskStrategy::None => self.whole(image, path),
            MaskStrategy::Ip | MaskStrategy::Ml | MaskStrategy::IpMl => self.made_from(image, path, decoded, cut),
        }
    }

    /// All of the image but what moves.
    fn whole(&self, image: &ImageEntry, path: &str) -> Result<Result<Fingerprint, String>> {
        let key = self.key(image, &[], true);
        let make = || {
            let mut mask: Mask = Raster::filled(image.width as usize, image.height as usize, 255);
            self.moving.cut(image, &mut mask);
            Ok(imaging::encode_png_grey(&mask)?)
        };
        self.work.files.item::<anyhow::Error>(path, key, make)?;
        Ok(Ok(key))
    }

    fn read_from(&self, image: &ImageEntry, path: &str, cut: bool) -> Result<Result<Fingerprint, String>> {
        let Some(pattern) = &self.work.config.cameras[image.camera].mask else { return Ok(Err("its camera has no masks".to_owned())) };
        let bytes = match std::fs::read(pattern.file(&image.stem)) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Err("it has no mask file".to_owned())),
            Err(e) => return Ok(Err(format!("its mask cannot be read: {}", e.kind()))),
        };
        let size = (image.width as usize, image.height as usize);
        let mask = imaging::decode_grey_u8(&bytes)
            .map_err(|e| e.to_string())
            .and_then(|grey| masking::mask_from_file(&grey, size).map_err(|e| e.to_string()));
        match mask {
            Ok(mut mask) => {
                let key = self.key(image, &[("file", Fingerprint::of_bytes(&bytes).as_bytes())], cut);
                if cut {
                    self.moving.cut(image, &mut mask);
                }
                self.work.files.item::<anyhow::Error>(path, key, || Ok(imaging::encode_png_grey(&mask)?))?;
                Ok(Ok(key))
            }
            Err(message) => Ok(Err(format!("its mask cannot be used: {message}"))),
        }
    }

    fn made_from(
        &self,
        image: &ImageEntry,
        path: &str,
        decoded: Option<Raster<[u8; 3]>>,
        cut: bool,
    ) -> Result<Result<Fingerprint, String>> {
        let (masker, threshold) = (&self.masker, self.thresholds[image.camera]);
        let card = masker.card_hash().unwrap_or_default();
        let parts = [
            ("image", image.content.as_bytes().as_slice()),
            ("threshold", threshold.as_slice()),
            ("model", card.as_bytes()),
            ("runtime", masker.library().unwrap_or_default().as_bytes()),
        ];
        let key = self.key(image, &parts, cut);
        if self.work.files.reuse(path, key) {
            return Ok(Ok(key));
        }
        let rgb = match decoded {
            Some(rgb) => Ok(rgb),
            None => imaging::decode_rgb(&self.list.bytes(self.work, image)?),
        };
        match rgb {
            Ok(rgb) => {
                let mut mask = masker.mask(&masker.prepared(rgb), threshold).with_context(|| image.name.clone())?.mask;
                if cut {
                    self.moving.cut(image, &mut mask);
                }
                self.work.files.save(path, key, &imaging::encode_png_grey(&mask)?)?;
                Ok(Ok(key))
            }
            Err(error) => Ok(Err(format!("it cannot be masked: {error}"))),
        }
    }

    /// Of a mask that is made from `parts`.
    fn key(&self, image: &ImageEntry, parts: &[(&str, &[u8])], cut: bool) -> Fingerprint {
        let (options, version) = (single_options(self.work.config).to_string(), STAGE.version.to_le_bytes());
        let moving = if cut { self.moving.fingerprint(image) } else { None };
        let size = [image.width.to_le_bytes(), image.height.to_le_bytes()].concat();
        let mut all = vec![("version", version.as_slice()), ("options", options.as_bytes()), ("size", size.as_slice())];
        all.extend(parts);
        if let Some(moving) = &moving {
            all.push(("moving", moving.as_bytes().as_slice()));
        }
        Fingerprint::of_parts(all)
    }
}

fn glimpse_key(image: &ImageEntry) -> Fingerprint {
    let version = STAGE.version.to_le_bytes();
    Fingerprint::of_parts([("version", version.as_slice()), ("image", image.content.as_bytes().as_slice())])
}

/// Otsu's threshold of each camera, where it is of the whole dive.
pub(super) fn thresholds(work: &Work<'_>, list: &ImageList, masker: &Masker<'_>) -> Result<Vec<Option<u8>>> {
    let config = &work.config.mask;
    if !config.strategy.has_ip() || config.ip.otsu == OtsuOf::Image {
        return Ok(vec![None; list.cameras.len()]);
    }
    work.progress.begin("grey values", list.images.len());
    let histograms: Vec<Result<Option<[u64; 256]>>> = list
        .images
        .par_iter()
        .map(|image| {
            let rgb = imaging::decode_rgb(&list.bytes(work, image)?);
            work.progress.advance(1);
            // A damaged image is told when its mask is made.
            let Ok(rgb) = rgb else { return Ok(None) };
            let options = ip_options(&config.ip, &config.areas, rgb.width(), rgb.height());
            Ok(Some(masking::histogram(&masker.prepared(rgb), &options)))
        })
        .collect();
    let mut sums = vec![[0u64; 256]; list.cameras.len()];
    for (image, histogram) in list.images.iter().zip(histograms) {
        if let Some(histogram) = histogram? {
            sums[image.camera].iter_mut().zip(histogram).for_each(|(sum, n)| *sum += n);
        }
    }
    Ok(sums.iter().map(|histogram| masking::otsu(histogram).map(|split| split.threshold)).collect())
}
