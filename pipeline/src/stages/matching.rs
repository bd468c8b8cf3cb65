//! The same points in two images, checked by geometry.

use super::features;
use super::images::ImageList;
use super::interior::{self, Start};
use super::loops;
use crate::config::{Config, FeatureMethod, PairRule};
use crate::error::NoResult;
use crate::formats::{read_matches, write_matches};
use crate::stage::{Outcome, Stage, Work, no_inputs};
use crate::store::Fingerprint;
use ::features::{GuidedOptions, MatchImage, MatchOptions, NccOptions, PairVerdict, VerifyOptions};
use anyhow::{Context, Result};
use rayon::prelude::*;
use scene::{ImageId, PairConfiguration, VerifiedPair};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::AddAssign;

/// The stage.
pub const STAGE: Stage = Stage { name: "matching", version: 3, upstream: &["ingest", "features"], options, inputs: no_inputs, work };

/// Images whose pairs with later ones are made together; a run that is stopped loses their work.
const ROWS_AT_ONCE: usize = 2;
/// Images that they are matched with at a time; bounds the memory.
const PARTNERS_AT_ONCE: usize = 256;

fn options(config: &Config) -> Value {
    json!({"matching": config.matching, "method": config.features.method, "interior": interior::options(config)})
}

/// Where the pairs of an image with later ones lie.
fn file(list: &ImageList, row: usize) -> String {
    list.path_for("matches", &list.images[row], "bin")
}

/// All verified pairs, in order.
///
/// # Errors
/// When a file is missing or damaged.
pub fn load(work: &Work<'_>, list: &ImageList) -> Result<Vec<VerifiedPair>> {
    let rows: Vec<Result<Vec<VerifiedPair>>> = (0..list.images.len())
        .into_par_iter()
        .filter(|&row| work.has("matching", &file(list, row)))
        .map(|row| read_matches(&work.read("matching", &file(list, row))?).with_context(|| file(list, row)))
        .collect();
    Ok(rows.into_iter().collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

fn work(work: &Work<'_>) -> Result<Outcome> {
    let list = ImageList::load(work)?;
    if list.images.len() < 2 {
        return Err(NoResult("there is one image only; two that overlap are the least".to_owned()).into());
    }
    let (starts, warnings) = interior::starts(work.config, &list)?;
    let rows = rows(work, &list)?;
    let tried: usize = rows.values().map(Vec::len).sum();
    work.progress.begin("matching", tried);
    let matcher = Matcher { work, list: &list, starts: &starts };
    let (todo, mut counts) = matcher.reuse(&rows)?;
    let mut held: BTreeMap<usize, MatchImage> = BTreeMap::new();
    for some in todo.chunks(ROWS_AT_ONCE) {
        counts += matcher.make(some, &rows, &mut held)?;
    }
    if counts.verified == 0 {
        let message =
            format!("none of {tried} pairs of images shows the same place: the images do not overlap, or show too little texture");
        return Err(NoResult(message).into());
    }
    let note = format!("{} of {tried} pairs verified", counts.verified);
    let figures = json!({
        "pairs_tried": tried, "pairs_verified": counts.verified, "matches": counts.matches, "calibrated": counts.calibrated,
        "uncalibrated": counts.uncalibrated, "planar_or_panoramic": counts.planar_or_panoramic, "note": note,
    });
    Ok(Outcome { figures, warnings })
}

/// What the figures say of verified pairs.
#[derive(Clone, Copy, Default)]
struct Counts {
    verified: usize,
    matches: usize,
    calibrated: usize,
    uncalibrated: usize,
    planar_or_panoramic: usize,
}

impl Counts {
    fn of(pairs: &[VerifiedPair]) -> Self {
        let count = |test: fn(&PairConfiguration) -> bool| pairs.iter().filter(|p| test(&p.configuration)).count();
        Self {
            verified: pairs.len(),
            matches: pairs.iter().map(|p| p.matches.len()).sum(),
            calibrated: count(|c| matches!(c, PairConfiguration::Calibrated { .. })),
            uncalibrated: count(|c| matches!(c, PairConfiguration::Uncalibrated { .. })),
            planar_or_panoramic: count(|c| matches!(c, PairConfiguration::PlanarOrPanoramic { .. })),
        }
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.verified += other.verified;
        self.matches += other.matches;
        self.calibrated += other.calibrated;
        self.uncalibrated += other.uncalibrated;
        self.planar_or_panoramic += other.planar_or_panoramic;
    }
}

/// For each image the later ones that it is matched with.
fn rows(work: &Work<'_>, list: &ImageList) -> Result<BTreeMap<usize, Vec<usize>>> {
    let config = &work.config.matching;
    let n = list.images.len();
    let exhaustive = match config.pairs {
        PairRule::Exhaustive => true,
        PairRule::Sequential => false,
        PairRule::Auto => n <= config.exhaustive_up_to as usize,
    };
    let pairs = if exhaustive {
        ::features::pairs::exhaustive(n)
    } else {
        let exposures: Vec<u32> = list.images.iter().map(|image| image.exposure).collect();
        let near = ::features::pairs::sequential(&exposures, config.overlap);
        ::features::pairs::union(near, &loops::candidates(work, list, &exposures, config.overlap)?)
    };
    let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (first, second) in pairs {
        rows.entry(first.index()).or_default().push(second.index());
    }
    Ok(rows)
}

struct Matcher<'a> {
    work: &'a Work<'a>,
    list: &'a ImageList,
    starts: &'a [Start],
}

impl Matcher<'_> {
    /// Rows that have to be made, and what the others hold, which count as done.
    fn reuse(&self, rows: &BTreeMap<usize, Vec<usize>>) -> Result<(Vec<usize>, Counts)> {
        let (mut todo, mut counts) = (Vec::new(), Counts::default());
        for (&row, partners) in rows {
            let path = file(self.list, row);
            if self.work.files.reuse(&path, self.key(row, partners)?) {
                counts += Counts::of(&read_matches(&std::fs::read(self.work.store.path(&path))?)?);
                self.work.progress.advance(partners.len());
            } else {
                todo.push(row);
            }
        }
        Ok((todo, counts))
    }

    /// What the pairs of a row are made from.
    fn key(&self, row: usize, partners: &[usize]) -> Result<Fingerprint> {
        let config = self.work.config;
        let options = json!([config.matching, config.features.method]).to_string();
        let mut parts: Vec<(&str, Vec<u8>)> = vec![("version", STAGE.version.to_le_bytes().to_vec()), ("options", options.into_bytes())];
        for &image in std::iter::once(&row).chain(partners) {
            let entry = &self.list.images[image];
            let start = &self.starts[entry.camera];
            parts.push(("id", (image as u64).to_le_bytes().to_vec()));
            parts.push(("features", features::content(self.work, self.list, entry)?.as_bytes().to_vec()));
            let port = start.camera.port().map(scene::FlatPort::values);
            let params = start.camera.params().iter().chain(port.iter().flatten()).flat_map(|p| p.to_le_bytes());
            parts.push(("camera", start.camera.model().name().bytes().chain([u8::from(start.is_known())]).chain(params).collect()));
        }
        Ok(Fingerprint::of_parts(parts.iter().map(|(name, bytes)| (*name, bytes.as_slice()))))
    }

    fn make(&self, some: &[usize], rows: &BTreeMap<usize, Vec<usize>>, held: &mut BTreeMap<usize, MatchImage>) -> Result<Counts> {
        let mut partners: Vec<usize> = some.iter().flat_map(|row| rows[row].iter().copied()).collect();
        partners.sort_unstable();
        partners.dedup();
        let mut found: BTreeMap<usize, Vec<VerifiedPair>> = some.iter().map(|&row| (row, Vec::new())).collect();
        for block in partners.chunks(PARTNERS_AT_ONCE) {
            self.hold(some, block, held)?;
            let pairs: Vec<(usize, usize)> =
                some.iter().flat_map(|&row| rows[&row].iter().filter(|p| block.binary_search(p).is_ok()).map(move |&p| (row, p))).collect();
            let verified: Vec<Option<VerifiedPair>> = pairs
                .par_iter()
                .map(|&(first, second)| {
                    let pair = self.pair(&held[&first], &held[&second]);
                    self.work.progress.advance(1);
                    pair
                })
                .collect();
            for pair in verified.into_iter().flatten() {
                if let Some(row) = found.get_mut(&pair.images.0.index()) {
                    row.push(pair);
                }
            }
        }
        let mut counts = Counts::default();
        for (row, pairs) in found {
            counts += Counts::of(&pairs);
            self.work.files.save(&file(self.list, row), self.key(row, &rows[&row])?, &write_matches(&pairs))?;
        }
        Ok(counts)
    }

    /// Loads the features that are needed now, and drops the others.
    fn hold(&self, rows: &[usize], block: &[usize], held: &mut BTreeMap<usize, MatchImage>) -> Result<()> {
        held.retain(|image, _| rows.contains(image) || block.binary_search(image).is_ok());
        let mut missing: Vec<usize> = rows.iter().chain(block).copied().filter(|image| !held.contains_key(image)).collect();
        missing.sort_unstable();
        missing.dedup();
        let load = |&image: &usize| {
            let entry = &self.list.images[image];
            let (start, stored) = (&self.starts[entry.camera], features::load(self.work, self.list, entry)?);
            Ok(MatchImage::new(ImageId::new(image), start.camera, start.is_known(), stored.features))
        };
        let loaded: Vec<Result<MatchImage>> = missing.par_iter().map(load).collect();
        for (image, made) in missing.into_iter().zip(loaded) {
            held.insert(image, made?);
        }
        Ok(())
    }

    fn pair(&self, first: &MatchImage, second: &MatchImage) -> Option<VerifiedPair> {
        let config = &self.work.config.matching;
        let verify =
            VerifyOptions { max_error_px: config.max_error_px, min_inliers: config.min_inliers as usize, ..VerifyOptions::default() };
        let verdict = match self.work.config.features.method {
            FeatureMethod::Sift => {
                let options = MatchOptions { max_ratio: config.ratio as f32, ..MatchOptions::default() };
                ::features::match_pair(first, second, &GuidedOptions::default(), &options, &verify)
            }
            FeatureMethod::HarrisNcc => {
                let options = NccOptions { min_correlation: config.min_correlation, ..NccOptions::default() };
                let tentative = ::features::match_guided(first.features(), second.features(), &options);
                ::features::verify_pair(&first.for_pair(), &second.for_pair(), &tentative, &verify)
            }
        };
        match verdict {
            PairVerdict::Verified(pair) => Some(pair),
            PairVerdict::Rejected { .. } => None,
        }
    }
}
