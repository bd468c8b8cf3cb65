//! Photographs of the target: read, searched, and sorted into exposures.

use crate::config::{BoardConfig, FramesFrom, ImageSource};
use crate::progress::Progress;
use crate::stages::pairing::{self, Exposure};
use crate::store::Warning;
use anyhow::Result;
use calibrate::{BoardFinding, detect_board};
use imaging::video::Video;
use rayon::prelude::*;
use scene::Raster;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Width of the small pictures on the page, pixels.
const SMALL_PX: usize = 400;
/// Frames of a video that are searched at a time; bounds the memory.
const FRAMES_AT_ONCE: usize = 8;

/// A photograph that can be used.
pub(super) struct Photograph {
    /// `camera/file`.
    pub name: String,
    /// Index of the camera.
    pub camera: usize,
    /// Number of the exposure, from 0.
    pub exposure: usize,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// What the search for the target gave.
    pub finding: BoardFinding,
    /// A small copy.
    pub small: Raster<[u8; 3]>,
}

/// All photographs, by camera and then in the order of their names.
pub(super) struct Photographs {
    pub list: Vec<Photograph>,
    /// Files and frames that were looked at.
    pub looked_at: usize,
    pub warnings: Vec<Warning>,
}

/// Name of a camera, and where its photographs come from.
pub(super) type Named<'a> = (&'a str, &'a ImageSource);

/// Reads and searches the photographs of all cameras. What cannot be read, and what is of another size than most of its camera, is left out
/// with a warning.
pub(super) fn read(cameras: &[Named<'_>], board: &BoardConfig, rule: FramesFrom, progress: &dyn Progress) -> Result<Photographs> {
    let mut all = Photographs { list: Vec::new(), looked_at: 0, warnings: Vec::new() };
    let mut exposures = Vec::new();
    for (index, (name, source)) in cameras.iter().enumerate() {
        let found = match source {
            ImageSource::Files(files) => from_files(name, index, files, board, progress),
            ImageSource::Video { file, rate_hz, offset_secs } => from_video(name, index, file, (*rate_hz, *offset_secs), board, progress)?,
        };
        all.looked_at += found.len();
        let mut usable = Vec::with_capacity(found.len());
        for result in found {
            match result {
                Ok(photograph) => usable.push(photograph),
                Err(warning) => all.warnings.push(warning),
            }
        }
        let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        usable.iter().for_each(|(p, _)| *sizes.entry(p.size).or_default() += 1);
        let size = sizes.iter().max_by_key(|(size, count)| (**count, **size)).map(|(size, _)| *size);
        for (photograph, exposure) in usable {
            let (w, h) = photograph.size;
            match size.filter(|s| *s != photograph.size) {
                Some((width, height)) => all.warnings.push(Warning {
                    message: format!("left out: it has {w} x {h} pixels, most images of {name} have {width} x {height}"),
                    about: photograph.name,
                }),
                None => {
                    all.list.push(photograph);
                    exposures.push(exposure);
                }
            }
        }
    }
    let names: Vec<&str> = cameras.iter().map(|(name, _)| *name).collect();
    let (numbers, warnings) = pairing::pair_up(&names, &exposures, rule);
    all.warnings.extend(warnings);
    all.list.iter_mut().zip(numbers).for_each(|(photograph, number)| photograph.exposure = number as usize);
    Ok(all)
}

type Read = Result<(Photograph, Exposure), Warning>;

fn from_files(name: &str, camera: usize, files: &[PathBuf], board: &BoardConfig, progress: &dyn Progress) -> Vec<Read> {
    progress.begin(&format!("searching {name}"), files.len());
    let one = |(position, file): (usize, &PathBuf)| -> Read {
        let about = format!("{name}/{}", file.file_name().unwrap_or_default().to_string_lossy());
        let left_out = |reason: String| Warning { about: about.clone(), message: format!("left out: {reason}") };
        let bytes = std::fs::read(file).map_err(|e| left_out(e.kind().to_string()))?;
        let time_secs = imaging::probe(&bytes).map_err(|e| left_out(e.to_string()))?.exif.time_secs;
        let rgb = imaging::decode_rgb(&bytes).map_err(|e| left_out(e.to_string()))?;
        progress.advance(1);
        let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok((searched(about.clone(), camera, &rgb, board), Exposure { camera, position, stem, time_secs }))
    };
    files.par_iter().enumerate().map(one).collect()
}

fn from_video(
    name: &str,
    camera: usize,
    file: &Path,
    (rate_hz, offset_secs): (f64, f64),
    board: &BoardConfig,
    progress: &dyn Progress,
) -> Result<Vec<Read>> {
    let video = Video::open(file)?;
    let announced = video.info().duration_secs.map_or(0, |d| ((d - offset_secs) * rate_hz).ceil().max(0.0) as usize);
    progress.begin(&format!("searching {name}"), announced);
    let mut frames = video.frames(rate_hz, offset_secs)?;
    let mut found: Vec<Read> = Vec::new();
    loop {
        let batch: Vec<_> = frames.by_ref().take(FRAMES_AT_ONCE).collect();
        if batch.is_empty() {
            return Ok(found);
        }
        let first = found.len();
        let searched = batch.into_par_iter().enumerate().map(|(i, frame)| {
            let position = first + i;
            let stem = format!("{position:06}");
            let (time, rgb) = frame.map_err(|_| Warning {
                about: name.to_owned(),
                message: format!("the video ends early or is damaged after {position} frames; they are used"),
            })?;
            progress.advance(1);
            let exposure = Exposure { camera, position, stem: stem.clone(), time_secs: Some(time - offset_secs) };
            Ok((searched(format!("{name}/{stem}"), camera, &rgb, board), exposure))
        });
        found.par_extend(searched);
    }
}

fn searched(name: String, camera: usize, rgb: &Raster<[u8; 3]>, board: &BoardConfig) -> Photograph {
    let finding = detect_board(&imaging::grey_from_rgb(rgb), board.columns, board.rows);
    let width = rgb.width().min(SMALL_PX);
    let height = (rgb.height() * width).div_ceil(rgb.width()).max(1);
    let size = (rgb.width() as u32, rgb.height() as u32);
    Photograph { name, camera, exposure: 0, size, finding, small: imaging::resize_area_rgb(rgb, width, height) }
}

/// What was found, in words.
pub(super) fn in_words(finding: &BoardFinding) -> String {
    match finding {
        BoardFinding::Found(_) => "found".to_owned(),
        BoardFinding::OtherSize { columns, rows } => format!("a board of {columns} x {rows} inner corners"),
        BoardFinding::Part { corners } => format!("a part of a board, {corners} corners"),
        BoardFinding::Nothing => "no board".to_owned(),
    }
}
