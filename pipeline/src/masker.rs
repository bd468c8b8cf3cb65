//! Makes masks as a configuration says.

use crate::config::{AreaConfig, Combine, IpConfig, MaskConfig, Polarity, Preprocessing, Route};
use anyhow::{Context, Result};
use masking::{IpOptions, MlOptions, ip_mask, ml_mask, preprocess};
use models::{Model, Runtime};
use scene::{Mask, Raster};
use std::path::Path;

/// Makes masks; may be shared among threads.
#[derive(Debug)]
pub struct Masker<'c> {
    config: &'c MaskConfig,
    model: Option<Model>,
    library: Option<String>,
}

/// A mask, and how it came about.
#[derive(Clone, Debug)]
pub struct Made {
    /// 255 structure, 0 background.
    pub mask: Mask,
    /// How unsure the classifier is, 0..=0.5; none without one.
    pub doubt: Option<f64>,
}

impl<'c> Masker<'c> {
    /// Loads what the strategy needs.
    ///
    /// # Errors
    /// When the model or its runtime is missing or wrong.
    pub fn new(config: &'c MaskConfig) -> Result<Self> {
        let mut masker = Self { config, model: None, library: None };
        if config.strategy.has_ml() {
            let needs = || format!("masks by `{}` need a classifier", config.strategy.name());
            let runtime = Runtime::load(config.ml.onnxruntime.as_deref()).with_context(needs)?;
            masker.model = Some(model(config.ml.model.as_deref(), &runtime).with_context(needs)?);
            masker.library = Some(runtime.name());
        }
        Ok(masker)
    }

    /// SHA-256 of the card of the model, which states that of its file: what masks depend on. Thresholds stand on the card.
    #[must_use]
    pub fn card_hash(&self) -> Option<String> {
        self.model.as_ref().map(|m| models::sha256(m.card().to_toml().as_bytes()))
    }

    /// Name and SHA-256 of the model.
    #[must_use]
    pub fn model(&self) -> Option<(&str, &str)> {
        self.model.as_ref().map(|m| (m.card().name.as_str(), m.card().sha256.as_str()))
    }

    /// File name of the ONNX Runtime library.
    #[must_use]
    pub fn library(&self) -> Option<&str> {
        self.library.as_deref()
    }

    /// The image as the strategies see it.
    #[must_use]
    pub fn prepared(&self, rgb: Raster<[u8; 3]>) -> Raster<[u8; 3]> {
        preprocess(
            rgb,
            match self.config.preprocessing {
                Preprocessing::None => masking::Preprocessing::None,
                Preprocessing::Equalise => masking::Preprocessing::Equalise,
                Preprocessing::Clahe => masking::Preprocessing::Clahe,
                Preprocessing::Lab => masking::Preprocessing::Lab,
                Preprocessing::Retinex => masking::Preprocessing::Retinex,
            },
        )
    }

    /// Masks an image that [`Masker::prepared`] gave; `threshold` stands for Otsu's of the image.
    ///
    /// # Errors
    /// When the runtime refuses the image.
    pub fn mask(&self, prepared: &Raster<[u8; 3]>, threshold: Option<u8>) -> Result<Made> {
        let (width, height) = (prepared.width(), prepared.height());
        let ip = || {
            let options = IpOptions { threshold, ..ip_options(&self.config.ip, &self.config.areas, width, height) };
            ip_mask(prepared, &options).mask
        };
        let Some(model) = &self.model else { return Ok(Made { mask: ip(), doubt: None }) };
        let (min_structure_area, min_hole_area) = self.config.areas.shares(width, height);
        let options = MlOptions {
            route: match self.config.ml.route {
                Route::Shared => masking::Route::Shared,
                Route::Patches => masking::Route::Patches,
            },
            levels: self.config.ml.levels as usize,
            clean_up: masking::CleanUp { min_structure_area, min_hole_area },
        };
        let found = ml_mask(prepared, model, &options)?;
        let mut mask = found.mask;
        if self.config.strategy.has_ip() {
            for (a, b) in mask.data_mut().iter_mut().zip(ip().data()) {
                *a = match self.config.combine {
                    Combine::And => *a & b,
                    Combine::Or => *a | b,
                };
            }
        }
        Ok(Made { mask, doubt: Some(found.doubt) })
    }
}

/// The model in a file, or that of the program.
///
/// # Errors
/// When it is missing or wrong.
pub fn model(path: Option<&Path>, runtime: &Runtime) -> Result<Model> {
    Ok(match path {
        Some(path) => Model::open(path, runtime)?,
        None => Model::built_in(runtime)?,
    })
}

/// Options of image processing for images of a size.
#[must_use]
pub fn ip_options(config: &IpConfig, areas: &AreaConfig, width: usize, height: usize) -> IpOptions {
    let (min_structure_area, min_hole_area) = areas.shares(width, height);
    IpOptions {
        channel: config.channel as usize,
        working_long_side_px: config.working_long_side_px as usize,
        blur_sigma_px: config.blur_sigma_px,
        canny: masking::CannyThresholds { low: config.canny_low, high: config.canny_high },
        closing_radius: config.closing_radius,
        min_structure_area,
        min_hole_area,
        threshold: None,
        polarity: match config.polarity {
            Polarity::Dark => masking::Polarity::Dark,
            Polarity::Bright => masking::Polarity::Bright,
            Polarity::Auto => masking::Polarity::Auto,
        },
        min_textured_share: config.min_textured_share,
        reach: config.reach,
        min_texture: config.min_texture,
    }
}
