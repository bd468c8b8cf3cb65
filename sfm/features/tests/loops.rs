//! Loop candidates on photographs, against exhaustive matching and verification.
//!
//! `SFM_DATA=FOLDER cargo test -p features --test loops -- --nocapture`

use features::pairs::{LoopOptions, exhaustive, loop_candidates};
use features::{
    Codebook, ImageForPair, MatchOptions, PairVerdict, RetrievalOptions, SiftOptions, VerifyOptions, extract, match_descriptors,
    verify_pair,
};
use rayon::prelude::*;
use scene::{Camera, CameraModel, Descriptor, Features, ImageId};
use std::path::Path;

struct Photograph {
    features: Features,
    camera: Camera,
}

/// The photographs of a folder below `SFM_DATA`, in order of their names; none where there is no such folder.
fn photographs(folder: &str, ending: &str) -> Vec<Photograph> {
    let Some(data) = std::env::var_os("SFM_DATA") else {
        println!("SFM_DATA is not set: {folder} is not tried");
        return Vec::new();
    };
    let Ok(entries) = std::fs::read_dir(Path::new(&data).join(folder)) else {
        println!("SFM_DATA has no {folder}");
        return Vec::new();
    };
    let mut paths: Vec<_> = entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == ending)).collect();
    paths.sort();
    let read = |path: &std::path::PathBuf| {
        let grey = imaging::decode_grey(&std::fs::read(path).expect("readable")).expect("an image");
        let (width, height) = (grey.width() as u32, grey.height() as u32);
        let camera = Camera::from_focal(CameraModel::Pinhole, width, height, 1.2 * f64::from(width)).expect("a camera");
        Photograph { features: extract(&grey, None, &SiftOptions::default()).expect("valid options"), camera }
    };
    paths.iter().map(read).collect()
}

/// Pairs of images more than `window` apart that verify.
fn verified(photographs: &[Photograph], window: usize) -> Vec<(ImageId, ImageId)> {
    let verifies = |&(a, b): &(ImageId, ImageId)| {
        let [x, y] = [a, b].map(|id| &photographs[id.index()]);
        let tentative = match_descriptors(&x.features.descriptors, &y.features.descriptors, &MatchOptions::default());
        let first = ImageForPair { id: a, camera: &x.camera, camera_known: false, features: &x.features };
        let second = ImageForPair { id: b, camera: &y.camera, camera_known: false, features: &y.features };
        matches!(verify_pair(&first, &second, &tentative, &VerifyOptions::default()), PairVerdict::Verified(_))
    };
    let far = exhaustive(photographs.len()).into_par_iter().filter(|(a, b)| b.index() - a.index() > window);
    far.filter(verifies).collect()
}

/// Share of the far pairs that verify among the candidates, and share of all far pairs that are candidates: what chance would find.
fn recall(photographs: &[Photograph], window: usize, per_image: usize) -> (f64, f64) {
    let options = RetrievalOptions::default();
    let share =
        |p: &Photograph| -> Vec<Descriptor> { Codebook::share(&p.features.descriptors, photographs.len(), &options).copied().collect() };
    let sample: Vec<Descriptor> = photographs.iter().flat_map(share).collect();
    let codebook = Codebook::learn(&sample, &options, 0).expect("valid options");
    let described: Vec<_> = photographs.iter().map(|p| Some(codebook.describe(&p.features.descriptors))).collect();
    let exposures: Vec<u32> = (0..photographs.len() as u32).collect();
    let loops = LoopOptions { per_image, window: window as u32, spread: 1 };
    let candidates = loop_candidates(&described, &exposures, &loops);
    let truth = verified(photographs, window);
    let found = truth.iter().filter(|p| candidates.binary_search(p).is_ok()).count();
    let far = (photographs.len() - window) * (photographs.len() - window - 1) / 2;
    let (recall, chance) = (found as f64 / truth.len() as f64, candidates.len() as f64 / far as f64);
    println!(
        "{per_image} an image: {} candidates, {found} of {} verified far pairs, {recall:.2}; by chance {chance:.2}",
        candidates.len(),
        truth.len()
    );
    (recall, chance)
}

/// A low-contrast strip over a wreck in four passes.
#[test]
fn passes_over_a_wreck_find_each_other() {
    let photographs = photographs("skerki", "tif");
    if photographs.is_empty() {
        return;
    }
    let (recall_of_5, chance) = recall(&photographs, 2, 5);
    assert!(recall_of_5 > 0.85 && recall_of_5 > 3.0 * chance);
}

/// A ring about a model of a temple: the last views overlap with the first. A view overlaps with up to six far ones on either side.
#[test]
fn a_ring_closes() {
    let photographs = photographs("temple", "png");
    if photographs.is_empty() {
        return;
    }
    let (recall_of_5, chance) = recall(&photographs, 4, 5);
    assert!(recall_of_5 > 0.65 && recall_of_5 > 4.0 * chance);
}
