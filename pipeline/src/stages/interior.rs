//! What the interior orientation of each camera starts from.

use super::images::{CameraEntry, ImageList};
use crate::config::{Config, InteriorConfig};
use crate::error::Misfit;
use crate::store::Warning;
use ::features::{InteriorEstimate, PairForInterior, interior_from_pairs};
use anyhow::Result;
use scene::camera::ParamKind;
use scene::{Camera, ImageId, Keypoint, VerifiedPair};
use serde::Serialize;
use serde_json::{Value, json};

/// The guess of a focal length of which nothing is known, over the longer side of the image: COLMAP's, a view of 45 degrees.
const GUESS: f64 = 1.2;
/// Other guesses: action cameras in air, and lenses longer than the first guess.
const FURTHER_GUESSES: [f64; 3] = [0.7, 0.95, 1.9];
/// Largest difference of the aspects of a calibration and the images that it is used for.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Where a start comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// dive.toml.
    Given,
    /// EXIF.
    Exif,
    /// Nothing.
    Guess,
    /// A model of another program.
    Model,
}

/// A start and where it comes from.
#[derive(Clone, Debug)]
pub struct Start {
    /// Start values.
    pub camera: Camera,
    /// They are not refined.
    pub fixed: bool,
    /// Whether each keeps its value where the others are refined; empty where none does.
    pub held: Vec<bool>,
    /// Standard deviation of each; empty where none is given.
    pub sigmas: Vec<Option<f64>>,
    /// Where they come from.
    pub origin: Origin,
    /// What else a guess could be.
    pub alternatives: Vec<Camera>,
}

impl Start {
    /// Whether the values come from a calibration or from EXIF, not from a guess.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.origin != Origin::Guess
    }
}

/// The part of the configuration that decides the starts.
#[must_use]
pub fn options(config: &Config) -> Value {
    json!(config.cameras.iter().map(|c| &c.interior).collect::<Vec<_>>())
}

/// The start of every camera. A camera without images gets one pixel and takes part in nothing.
///
/// # Errors
/// When a given calibration cannot belong to the images.
pub fn starts(config: &Config, list: &ImageList) -> Result<(Vec<Start>, Vec<Warning>)> {
    let mut warnings = Vec::new();
    let mut starts = Vec::with_capacity(list.cameras.len());
    for (camera, entry) in config.cameras.iter().zip(&list.cameras) {
        starts.push(start(&camera.interior, entry, &mut warnings)?);
    }
    Ok((starts, warnings))
}

fn start(interior: &InteriorConfig, entry: &CameraEntry, warnings: &mut Vec<Warning>) -> Result<Start> {
    let (width, height) = entry.size.unwrap_or((1, 1));
    if !interior.params.is_empty() {
        let camera = given(interior, entry, (width, height), warnings)?;
        // Pixels count for more in a larger image.
        let factor = interior.size.map_or(1.0, |size| f64::from(width) / f64::from(size.0));
        let scaled = |(sigma, kind): (&Option<f64>, &ParamKind)| sigma.map(|s| if *kind == ParamKind::Distortion { s } else { s * factor });
        let sigmas = interior.sigmas.iter().zip(interior.model.param_kinds()).map(scaled).collect();
        let (fixed, held) = (interior.fixed, interior.held.clone());
        return Ok(Start { camera, fixed, held, sigmas, origin: Origin::Given, alternatives: Vec::new() });
    }
    let (focal, origin) = match entry.exif_focal_px {
        Some(focal) => (focal, Origin::Exif),
        None => (GUESS * f64::from(width.max(height)), Origin::Guess),
    };
    let camera = Camera::from_focal(interior.model, width, height, focal)?;
    Ok(Start { camera, fixed: false, held: interior.held.clone(), sigmas: Vec::new(), origin, alternatives: Vec::new() })
}

/// Adds to each guess what else it could be: what the verified pairs of the camera tell, where they tell anything, and other focal lengths.
///
/// # Errors
/// When a camera cannot have such a focal length, which cannot be.
pub fn add_alternatives(
    starts: &mut [Start],
    list: &ImageList,
    keypoints: &[Vec<Keypoint>],
    pairs: &[VerifiedPair],
    config: &Config,
) -> Result<()> {
    let camera_of = |image: ImageId| list.images[image.index()].camera;
    let found: Vec<Option<InteriorEstimate>> = starts
        .iter()
        .enumerate()
        .map(|(c, start)| {
            let own: Vec<PairForInterior<'_>> = pairs
                .iter()
                .filter(|pair| start.origin == Origin::Guess && camera_of(pair.images.0) == c && camera_of(pair.images.1) == c)
                .map(|pair| PairForInterior { pair, keypoints: (&keypoints[pair.images.0.index()], &keypoints[pair.images.1.index()]) })
                .collect();
            let size = (start.camera.width(), start.camera.height());
            interior_from_pairs(&own, size, config.matching.max_error_px, u64::from(config.orient.seed))
        })
        .collect();
    let over_longer = |found: &InteriorEstimate| Some(found.focal_px? / f64::from(found.size.0.max(found.size.1)));
    // Cameras of a rig are mostly alike, and alternatives of one position are tried together.
    let any_estimate = found.iter().flatten().find_map(over_longer);
    for (start, found) in starts.iter_mut().zip(&found).filter(|(s, _)| s.origin == Origin::Guess) {
        let (model, size) = (start.camera.model(), (start.camera.width(), start.camera.height()));
        let longer = f64::from(size.0.max(size.1));
        let estimate = found.as_ref().and_then(over_longer).or(any_estimate);
        for guess in estimate.into_iter().chain(FURTHER_GUESSES) {
            start.alternatives.push(match found {
                Some(found) => found.with_focal(model, guess * longer)?,
                None => Camera::from_focal(model, size.0, size.1, guess * longer)?,
            });
        }
    }
    Ok(())
}

fn given(interior: &InteriorConfig, entry: &CameraEntry, (width, height): (u32, u32), warnings: &mut Vec<Warning>) -> Result<Camera> {
    let size = interior.size.unwrap_or((width, height));
    let mut centre = [f64::from(size.0) / 2.0, f64::from(size.1) / 2.0].into_iter();
    let mut params = Vec::with_capacity(interior.params.len());
    for (value, kind) in interior.params.iter().zip(interior.model.param_kinds()) {
        let default = if *kind == ParamKind::PrincipalPoint { centre.next().unwrap_or(0.0) } else { 0.0 };
        params.push(value.unwrap_or(default));
    }
    let camera = Camera::new(interior.model, size.0, size.1, &params)?.behind(interior.port)?;
    if size == (width, height) || entry.size.is_none() {
        return Ok(camera);
    }
    let aspect = |(w, h): (u32, u32)| f64::from(w) / f64::from(h);
    if (aspect(size) / aspect((width, height)) - 1.0).abs() > ASPECT_TOLERANCE {
        let message = format!(
            "the calibration of camera {} is for {} x {} pixels, its images have {width} x {height}: another aspect, so they are cut or turned\n  \
             hint: calibrate with images of the size that is used",
            entry.name, size.0, size.1
        );
        return Err(Misfit(message).into());
    }
    let message = format!("its calibration is for {} x {} pixels; it was scaled to the images' {width} x {height}", size.0, size.1);
    warnings.push(Warning { about: entry.name.clone(), message });
    Ok(camera.resized(width, height)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::CameraModel;

    fn entry(size: (u32, u32), exif_focal_px: Option<f64>) -> CameraEntry {
        CameraEntry { name: "C1".to_owned(), size: Some(size), exif_focal_px }
    }

    fn given(params: Vec<Option<f64>>, size: Option<(u32, u32)>) -> InteriorConfig {
        InteriorConfig { model: CameraModel::Pinhole, size, params, fixed: true, ..InteriorConfig::default() }
    }

    #[test]
    fn given_goes_before_exif_before_a_guess() {
        let mut warnings = Vec::new();
        let unknown = InteriorConfig::default();
        let guess = start(&unknown, &entry((1000, 500), None), &mut warnings).unwrap();
        assert_eq!((guess.origin, guess.is_known(), guess.camera.mean_focal()), (Origin::Guess, false, 1200.0));
        let exif = start(&unknown, &entry((1000, 500), Some(900.0)), &mut warnings).unwrap();
        assert_eq!((exif.origin, exif.is_known(), exif.camera.mean_focal()), (Origin::Exif, true, 900.0));
        let known = given(vec![Some(800.0), Some(810.0), None, Some(240.0)], None);
        let known = start(&known, &entry((1000, 500), Some(900.0)), &mut warnings).unwrap();
        assert_eq!(known.camera.params(), [800.0, 810.0, 500.0, 240.0]);
        assert!(known.fixed && warnings.is_empty());
    }

    #[test]
    fn a_calibration_of_another_size_is_scaled_or_refused() {
        let mut warnings = Vec::new();
        let calibration = given(vec![Some(800.0), Some(800.0), None, None], Some((2000, 1000)));
        let half = start(&calibration, &entry((1000, 500), None), &mut warnings).unwrap();
        assert_eq!(half.camera.params(), [400.0, 400.0, 500.0, 250.0]);
        assert_eq!(warnings.len(), 1);
        assert!(start(&calibration, &entry((1000, 600), None), &mut warnings).is_err());
    }
}
