//! How colour loss, blur and speckle change the share of right matches of SIFT and of Harris corners with normalised cross-correlation, on
//! consecutive frames: the experiment of Meline et al. 2012, tables II and III.
//!
//!     cargo run --release -p features --example meline -- [FOLDER [STEP [WIDTH]]]
//!
//! FOLDER holds frames in the order of their names (PNG, JPEG); every STEP-th is matched with the next one that is taken, reduced to WIDTH
//! pixels. Without a folder frames of a synthetic dive in air are rendered.

use features::{
    HarrisOptions, ImageForPair, MatchOptions, NccOptions, PairVerdict, SiftOptions, VerifyOptions, extract, extract_harris,
    match_descriptors, match_guided, verify_pair,
};
use scene::{Camera, CameraModel, Features, ImageId, KeypointIndex, Raster};
use std::path::Path;
use synthetic::degrade::{BLUR_VARIANCE, COLOUR_LEFT, SPECKLE_VARIANCE, blur, colour, speckle};
use synthetic::dive::{DiveOptions, WaterKind, render_dive};

/// Frames that are matched at most.
const FRAMES: usize = 12;
/// Points of each image: as many for each method, as in the paper, where their thresholds were set so.
const POINTS: usize = 1000;
const FILTERS: [&str; 6] = ["none", "colour", "blur", "speckle", "speckle + blur", "all"];
const METHODS: [&str; 4] = ["Harris-NCC", "SIFT", "SIFT, ratio 0.8", "SIFT, not doubled"];

type Matches = Vec<(KeypointIndex, KeypointIndex)>;
type Rgb = Raster<[u8; 3]>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: usize| arguments.get(i).map_or(Ok(default), |text| text.parse());
    let frames = match arguments.first() {
        Some(folder) => read(Path::new(folder), number(1, 1)?, number(2, 1000)?)?,
        None => rendered()?,
    };
    println!(
        "{} pairs of {} x {} pixels; inliers as a share of the points detected (of the image that has fewer, the paper's rate)\nand of the matches; in brackets pairs that were rejected",
        frames.len() - 1,
        frames[0].width(),
        frames[0].height()
    );
    println!("{:<16}{}", "", METHODS.map(|m| format!("{m:>26}")).concat());
    for filter in FILTERS {
        let degraded: Vec<Rgb> = frames.iter().enumerate().map(|(i, frame)| apply(filter, frame, i as u64)).collect();
        let cells: Vec<String> = (0..METHODS.len()).map(|method| cell(&degraded, method)).collect();
        println!("{filter:<16}{}", cells.concat());
    }
    Ok(())
}

fn cell(frames: &[Rgb], method: usize) -> String {
    let found: Vec<Features> = frames.iter().map(|frame| find(frame, method)).collect();
    let (mut points, mut inliers, mut matches, mut rejected) = (0, 0, 0, 0);
    for (pair, frame) in found.windows(2).zip(frames) {
        let (good, all) = judge(pair, frame, method);
        points += pair[0].len().min(pair[1].len());
        (inliers, matches, rejected) = (inliers + good, matches + all, rejected + usize::from(good == 0));
    }
    let share = |of: usize| 100.0 * inliers as f64 / of.max(1) as f64;
    format!("{:>26}", format!("{:.1} % {:.1} % {} [{rejected}]", share(points), share(matches), points / (found.len() - 1)))
}

fn find(frame: &Rgb, method: usize) -> Features {
    let grey = imaging::grey_from_rgb(frame);
    let sift = SiftOptions { max_features: POINTS, double_image: method < 3, ..SiftOptions::default() };
    let harris = HarrisOptions { max_features: POINTS, ..HarrisOptions::default() };
    if method == 0 { extract_harris(&grey, None, &harris) } else { extract(&grey, None, &sift) }.unwrap_or_default()
}

/// Matches that the fundamental matrix explains, of all.
fn judge(pair: &[Features], frame: &Rgb, method: usize) -> (usize, usize) {
    let tentative: Matches = match method {
        0 => match_guided(&pair[0], &pair[1], &NccOptions::default()),
        _ => {
            let max_ratio = if method == 2 { 0.8 } else { 1.0 };
            match_descriptors(&pair[0].descriptors, &pair[1].descriptors, &MatchOptions { max_ratio, max_distance: 1.41, mutual: true })
        }
    };
    let (width, height) = (frame.width() as u32, frame.height() as u32);
    let Ok(camera) = Camera::from_focal(CameraModel::Pinhole, width, height, f64::from(width)) else { return (0, tentative.len()) };
    let side = |id: usize| ImageForPair { id: ImageId::new(id), camera: &camera, camera_known: false, features: &pair[id] };
    let options = VerifyOptions { max_error_px: 2.0, max_iterations: 10_000, max_still_px: 0.0, ..VerifyOptions::default() };
    match verify_pair(&side(0), &side(1), &tentative, &options) {
        PairVerdict::Verified(pair) => (pair.matches.len(), tentative.len()),
        PairVerdict::Rejected { .. } => (0, tentative.len()),
    }
}

fn apply(filter: &str, frame: &Rgb, seed: u64) -> Rgb {
    let colour = |f: &Rgb| colour(f, COLOUR_LEFT);
    let blur = |f: &Rgb| blur(f, BLUR_VARIANCE);
    let speckle = |f: &Rgb| speckle(f, SPECKLE_VARIANCE, seed);
    match filter {
        "colour" => colour(frame),
        "blur" => blur(frame),
        "speckle" => speckle(frame),
        "speckle + blur" => blur(&speckle(frame)),
        "all" => blur(&speckle(&colour(frame))),
        _ => frame.clone(),
    }
}

fn read(folder: &Path, step: usize, width: usize) -> Result<Vec<Rgb>, Box<dyn std::error::Error>> {
    let mut files: Vec<_> = std::fs::read_dir(folder)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|f| f.extension().is_some_and(|e| ["png", "jpg", "jpeg"].iter().any(|known| e.eq_ignore_ascii_case(known))));
    files.sort();
    let frames: Result<Vec<Rgb>, Box<dyn std::error::Error>> = files
        .iter()
        .step_by(step.max(1))
        .take(FRAMES)
        .map(|file| {
            let rgb = imaging::decode_rgb(&std::fs::read(file)?)?;
            let height = rgb.height() * width / rgb.width();
            Ok(if rgb.width() > width { imaging::resize_area_rgb(&rgb, width, height) } else { rgb })
        })
        .collect();
    let frames = frames?;
    if frames.len() < 2 { Err(format!("{} holds fewer than two images", folder.display()).into()) } else { Ok(frames) }
}

/// Frames of one camera, a step of 0.3 m apart, in air and without noise.
fn rendered() -> Result<Vec<Rgb>, Box<dyn std::error::Error>> {
    let mut options = DiveOptions::small(FRAMES, 960, 600);
    options.rig.cameras.truncate(1);
    options.motion.arc_deg = 40.0;
    options.world.detail_m = 0.03;
    options.response.noise = 0.0;
    WaterKind::None.apply(&mut options.water);
    Ok(render_dive(&options)?.images.into_iter().map(|image| image.rgb).collect())
}
