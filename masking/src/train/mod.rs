//! Training of a classifier: the backbone stays as it is, a linear head is fitted to labelled images.
//!
//! After Rofallski et al. 2020, section 4.2: patches by quadtree, as many of structure as of background, a fifth of the images held out. The head is a logistic
//! regression over pooled feature maps.

mod calibrate;
mod figures;
mod logistic;
mod polygons;
mod samples;

pub use figures::{Bin, Confusion, TrainingFigures, WorstImage};
pub use polygons::{LabelError, Polygon, coco_polygons, labelme_polygons, rasterise};

use models::{Backbone, Card, Head, MapsCard, Model, ModelError, Runtime, Tap, map_name, sha256, with_head};
use rayon::prelude::*;
use samples::Samples;
use scene::{Mask, Raster};
use std::borrow::Cow;
use std::path::PathBuf;

/// Options of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainOptions {
    /// Name of the model.
    pub name: String,
    /// Long sides that whole images are brought to.
    pub long_sides_px: Vec<usize>,
    /// Cells of each class that are taken from an image at each long side.
    pub cells: usize,
    /// Patches of each class that are taken from an image, by quadtree.
    pub patches: usize,
    /// Weight of the squared weights of the standardised features.
    pub regularisation: f64,
    /// Logit from which a cell is structure. Below 0: what a mask loses is lost for good, while water that it keeps is still told by later stages (its matches
    /// and depths disagree). In murky water the logits of faint sea floor lie low: on dives for this choice alone, -1 (27 %) raised recall and intersection over union both.
    pub decision: f32,
    /// Share of the images that are held out.
    pub held_out: f64,
    /// Which images are held out and which patches are taken.
    pub seed: u64,
}

impl Default for TrainOptions {
    fn default() -> Self {
        Self {
            name: "structure".to_owned(),
            long_sides_px: vec![960, 480],
            cells: 40,
            patches: 60,
            regularisation: 1e-3,
            decision: -1.0,
            held_out: 0.2,
            seed: 1,
        }
    }
}

/// A model that was trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The ONNX file.
    pub onnx: Vec<u8>,
    /// Its card; description and licence are those of whoever trains.
    pub card: Card,
    /// How good it is.
    pub figures: TrainingFigures,
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum TrainError<E: std::error::Error + 'static> {
    /// Too few images.
    #[error("{0} labelled images are too few: some are trained with, some held out; label {MIN_IMAGES} at least")]
    TooFew(usize),
    /// Only one class.
    #[error("the labels show {0} alone: label images that show {1} as well")]
    OneClass(&'static str, &'static str),
    /// A network that cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// An image or label that cannot be read.
    #[error(transparent)]
    Load(E),
}

/// Fewest images that a model can be trained and judged with.
pub const MIN_IMAGES: usize = 5;

/// What a training tells while it goes on: what it does, how far it is and of how many.
pub type Progress<'a> = &'a (dyn Fn(&'static str, usize, usize) + Sync);

/// Trains a head for a backbone with `count` labelled images; `load` gives each with its mask, and may be asked twice.
///
/// The result is the same with any number of threads.
///
/// # Errors
/// See [`TrainError`]. One image that cannot be loaded ends the training: the caller knows which can be left out.
pub fn train<E: std::error::Error + Send + 'static>(
    backbone: &Backbone,
    runtime: &Runtime,
    count: usize,
    load: impl Fn(usize) -> Result<(Raster<[u8; 3]>, Mask), E> + Sync,
    options: &TrainOptions,
    progress: Progress<'_>,
) -> Result<Trained, TrainError<E>> {
    if count < MIN_IMAGES {
        return Err(TrainError::TooFew(count));
    }
    let (kept, held_out) = split(count, options);
    let draw = |images: &[usize], what| gather(backbone, images, &load, options, &|done| progress(what, done, images.len()));
    let training = draw(&kept, "features")?;
    let test = draw(&held_out, "features of the images held out")?;
    require_both_classes(&training)?;
    progress("regression", 0, 1);
    let (weights, bias) = logistic::fit(&training.features, &training.structure, options.regularisation);
    progress("regression", 1, 1);
    drop(training);
    let confusion = figures::Confusion::of(&test, &weights, bias);
    let bins = figures::reliability(&test, &weights, bias);
    let model = assemble(backbone, runtime, &weights, bias, options)?;
    let calibrated = calibrate::calibrate(&model, runtime, &held_out, &load, &|done| progress("calibration", done, held_out.len()))?;
    let figures = TrainingFigures {
        images: kept.len(),
        images_held_out: held_out.len(),
        patches_held_out: test.structure.len(),
        confusion,
        reliability: bins,
        worst: calibrated.worst,
        mean_iou: calibrated.mean_iou,
    };
    let card = Card { figures: Some(figures.for_card()), ..calibrated.model.card().clone() };
    Ok(Trained { onnx: calibrated.model.bytes().to_vec(), card, figures })
}

/// The images to train with and those held out, each in order.
fn split(count: usize, options: &TrainOptions) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_key(|&i| samples::hash(options.seed, i as u64));
    let held_out = ((count as f64 * options.held_out).round() as usize).clamp(1, count - 1);
    let (mut held_out, mut kept) = (order[..held_out].to_vec(), order[held_out..].to_vec());
    held_out.sort_unstable();
    kept.sort_unstable();
    (kept, held_out)
}

/// The samples of images, in their order.
fn gather<E: std::error::Error + Send + 'static>(
    backbone: &Backbone,
    images: &[usize],
    load: &(impl Fn(usize) -> Result<(Raster<[u8; 3]>, Mask), E> + Sync),
    options: &TrainOptions,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Samples, TrainError<E>> {
    let done = std::sync::atomic::AtomicUsize::new(0);
    let found: Vec<Result<Samples, TrainError<E>>> = images
        .par_iter()
        .map(|&i| {
            let (rgb, mask) = load(i).map_err(TrainError::Load)?;
            let samples = samples::of_image(backbone, &rgb, &mask, options, samples::hash(options.seed, i as u64))?;
            progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
            Ok(samples)
        })
        .collect();
    let mut all = Samples::new(backbone.taps().iter().map(|(_, channels)| channels).sum());
    for samples in found {
        all.append(samples?);
    }
    Ok(all)
}

fn require_both_classes<E: std::error::Error>(samples: &Samples) -> Result<(), TrainError<E>> {
    match samples.structure.iter().filter(|s| **s).count() {
        0 => Err(TrainError::OneClass("background", "structure")),
        n if n == samples.structure.len() => Err(TrainError::OneClass("structure", "background")),
        _ => Ok(()),
    }
}

/// The head in one file with its backbone, before anything is calibrated.
fn assemble(backbone: &Backbone, runtime: &Runtime, weights: &[f32], bias: f32, options: &TrainOptions) -> Result<Model, ModelError> {
    let mut rest = weights;
    let mut taps = Vec::new();
    for (output, channels) in backbone.taps() {
        let (here, after) = rest.split_at(*channels);
        taps.push(Tap { output: output.clone(), weights: here.to_vec() });
        rest = after;
    }
    let outputs = taps.iter().map(|t| map_name(&t.output)).collect();
    let onnx = with_head(backbone.bytes(), &Head { taps, bias })?;
    let card = Card {
        name: options.name.clone(),
        description: String::new(),
        licence: String::new(),
        sha256: sha256(&onnx),
        output: models::LOGITS.to_owned(),
        classes: ["background".to_owned(), "structure".to_owned()],
        input: backbone.input().clone(),
        thresholds: Vec::new(),
        decision: options.decision,
        core: None,
        maps: Some(MapsCard { outputs, bias, long_sides_px: options.long_sides_px.clone() }),
        figures: None,
    };
    Model::new(card, PathBuf::from(format!("{}.onnx", options.name)), Cow::Owned(onnx), runtime)
}
