//! A depth for nearly every pixel, and one cloud of all of them.

use super::images::{ImageEntry, ImageList};
use super::{mask, model};
use crate::config::{Config, DenseQuality};
use crate::stage::{Outcome, Stage, Work, no_inputs};
use crate::store::{Fingerprint, Warning};
use anyhow::{Context, Result};
use dense::{
    DepthMap, DepthOptions, FusionOptions, FusionSummary, Quality, View, ViewSelectionOptions, depth_range, depth_seeds,
    estimate_depth_from_seeds, fuse, ground_sample_distance, select_views,
};
use rayon::prelude::*;
use scene::format::write_ply_cloud;
use scene::{ImageId, Reconstruction};
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// The stage.
pub const STAGE: Stage = Stage { name: "densify", version: 2, upstream: &["ingest", "mask", "orient"], options, inputs: no_inputs, work };

/// The dense cloud.
pub const CLOUD: &str = "dense/cloud.ply";
/// Images at working resolution that are held at a time.
const HELD_VIEWS: usize = 48;

fn options(config: &Config) -> Value {
    json!(config.densify)
}

fn quality(config: &Config) -> Quality {
    match config.densify.quality {
        DenseQuality::Low => Quality::Low,
        DenseQuality::Medium => Quality::Medium,
        DenseQuality::High => Quality::High,
    }
}

/// The oriented images, by their id in the model.
struct Scene<'a> {
    work: &'a Work<'a>,
    list: &'a ImageList,
    model: &'a Reconstruction,
    /// The entry of each image of the model.
    entries: Vec<&'a ImageEntry>,
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let list = ImageList::load(work)?;
    let model = model::load(work)?;
    let by_name: BTreeMap<&str, &ImageEntry> = list.images.iter().map(|i| (i.name.as_str(), i)).collect();
    let entry = |name: &str| by_name.get(name).copied().with_context(|| format!("the model has an image {name} that is not in the list"));
    let entries = model.images.iter().map(|i| entry(&i.name)).collect::<Result<_>>()?;
    let scene = Scene { work, list: &list, model: &model, entries };
    let mut warnings = Vec::new();
    let maps = depth_maps(&scene, &mut warnings)?;
    let figures = fuse_maps(&scene, maps)?;
    if figures["points"] == 0 {
        warnings.push(Warning { about: "cloud".to_owned(), message: "no point is seen alike in enough images".to_owned() });
    }
    Ok(Outcome { figures, warnings })
}

/// The depth maps in the store.
#[derive(Default)]
struct Maps {
    /// The file of each.
    files: BTreeMap<ImageId, String>,
    /// Ground sample distance of each that has any depth.
    gsds: Vec<(f64, ImageId)>,
}

/// Makes the depth map of every oriented image.
fn depth_maps(scene: &Scene<'_>, warnings: &mut Vec<Warning>) -> Result<Maps> {
    let (work, model) = (scene.work, scene.model);
    let images: Vec<ImageId> = model.oriented_images().collect();
    work.progress.begin("depth maps", images.len());
    let selection = ViewSelectionOptions { max_views: work.config.densify.max_views as usize, ..ViewSelectionOptions::default() };
    let chosen: Vec<Vec<ImageId>> = images.par_iter().map(|&image| select_views(model, image, &selection)).collect();
    let depth_options = DepthOptions { seed: u64::from(work.config.densify.seed), ..DepthOptions::default() };
    let mut views = Views { scene, held: BTreeMap::new(), used: VecDeque::new() };
    let mut maps = Maps::default();
    for (&image, neighbours) in images.iter().zip(&chosen) {
        let entry = scene.entries[image.index()];
        let Some(range) = depth_range(model, image).filter(|_| !neighbours.is_empty()) else {
            warnings.push(Warning {
                about: entry.name.clone(),
                message: "no depth map: it shares too few points with other images".to_owned(),
            });
            work.progress.advance(1);
            continue;
        };
        let path = scene.list.path_for("depth", entry, "bin");
        let key = depth_key(scene, image, neighbours)?;
        let map = if work.files.reuse(&path, key) {
            DepthMap::from_bytes(&std::fs::read(work.store.path(&path))?)?
        } else {
            let wanted: Vec<ImageId> = std::iter::once(image).chain(neighbours.iter().copied()).collect();
            let loaded = views.get(&wanted)?;
            let (reference, others) = loaded.split_first().context("the image itself is the first view")?;
            let others: Vec<&View> = others.iter().map(Arc::as_ref).collect();
            let map = estimate_depth_from_seeds(reference, &others, range, &depth_seeds(model, image), &depth_options)?;
            work.files.save(&path, key, &map.to_bytes())?;
            map
        };
        maps.gsds.extend(ground_sample_distance(&map).map(|gsd| (gsd, image)));
        maps.files.insert(image, path);
        work.progress.advance(1);
    }
    Ok(maps)
}

/// What a depth map is made from: the options, the model, and the images and masks of the views.
fn depth_key(scene: &Scene<'_>, image: ImageId, neighbours: &[ImageId]) -> Result<Fingerprint> {
    let work = scene.work;
    let (options, version) = (options(work.config).to_string(), STAGE.version.to_le_bytes());
    let mut parts: Vec<(&str, Vec<u8>)> = vec![("version", version.to_vec()), ("options", options.into_bytes())];
    let model = work.done.get("orient").map(|s| s.fingerprint).context("`orient` is done before")?;
    parts.push(("model", model.as_bytes().to_vec()));
    for view in std::iter::once(&image).chain(neighbours) {
        let entry = scene.entries[view.index()];
        parts.push(("id", view.0.to_le_bytes().to_vec()));
        parts.push(("image", entry.content.as_bytes().to_vec()));
        parts.push(("mask", mask::content(work, scene.list, entry).as_bytes().to_vec()));
    }
    Ok(Fingerprint::of_parts(parts.iter().map(|(name, bytes)| (*name, bytes.as_slice()))))
}

/// Images at working resolution; the ones used last are held.
struct Views<'a> {
    scene: &'a Scene<'a>,
    held: BTreeMap<ImageId, Arc<View>>,
    /// Oldest use first.
    used: VecDeque<ImageId>,
}

impl Views<'_> {
    fn get(&mut self, wanted: &[ImageId]) -> Result<Vec<Arc<View>>> {
        let missing: Vec<ImageId> = wanted.iter().copied().filter(|image| !self.held.contains_key(image)).collect();
        let loaded: Vec<Result<View>> = missing.par_iter().map(|&image| self.scene.view(image)).collect();
        for (image, view) in missing.into_iter().zip(loaded) {
            self.held.insert(image, Arc::new(view?));
        }
        self.used.retain(|image| !wanted.contains(image));
        self.used.extend(wanted);
        while self.used.len() > HELD_VIEWS.max(wanted.len()) {
            if let Some(oldest) = self.used.pop_front() {
                self.held.remove(&oldest);
            }
        }
        wanted.iter().map(|image| self.held.get(image).cloned().context("a view that was just loaded")).collect()
    }
}

impl Scene<'_> {
    fn view(&self, image: ImageId) -> Result<View> {
        let entry = self.entries[image.index()];
        let camera = &self.model.cameras[self.model.images[image.index()].camera.index()];
        let cam_from_world = self.model.cam_from_world(image).with_context(|| format!("{} is not oriented", entry.name))?;
        let (width, height) = quality(self.work.config).working_size(entry.width, entry.height);
        let (w, h) = (width as usize, height as usize);
        let full = imaging::decode_rgb(&self.list.bytes(self.work, entry)?).with_context(|| entry.name.clone())?;
        let rgb = imaging::resize_area_rgb(&full, w, h);
        let mask = mask::load(self.work, self.list, entry)?.map(|mask| imaging::resize_nearest(&mask, w, h));
        Ok(View { image, camera: camera.resized(width, height)?, cam_from_world, rgb, mask })
    }
}

fn fuse_maps(scene: &Scene<'_>, mut maps: Maps) -> Result<Value> {
    let work = scene.work;
    // Points come from the images that see them finest.
    maps.gsds.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let order: Vec<ImageId> = maps.gsds.iter().map(|(_, image)| *image).collect();
    let options = FusionOptions { min_views: work.config.densify.min_views as usize, ..FusionOptions::default() };
    work.progress.begin("fusing", 0);
    let load = |image: ImageId| -> Result<Option<DepthMap>> {
        let Some(path) = maps.files.get(&image) else { return Ok(None) };
        Ok(Some(DepthMap::from_bytes(&std::fs::read(work.store.path(path))?)?))
    };
    let fusion = fuse(&order, load, &options)?;
    let mut bytes = Vec::new();
    write_ply_cloud(&fusion.cloud, &mut bytes)?;
    work.files.save(CLOUD, Fingerprint::of_bytes(&bytes), &bytes)?;
    Ok(figures(work.config, &fusion.summary))
}

fn figures(config: &Config, summary: &FusionSummary) -> Value {
    let note = format!("{} points from {} depth maps", summary.points, summary.maps);
    json!({
        "quality": quality(config).name(), "maps": summary.maps, "depths": summary.depths, "merged": summary.merged,
        "unsupported": summary.unsupported, "contradicted": summary.contradicted, "isolated": summary.isolated,
        "points": summary.points, "ground_sample_distance": summary.median_gsd, "note": note,
    })
}
