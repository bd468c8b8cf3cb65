//! What `sfm init` finds in a folder, and the dive.toml that it writes.

use crate::config::{FramesFrom, is_image, is_safe_name, natural_key};
use crate::error::NoResult;
use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Extensions, in lower case, of the videos that a folder is searched for.
const VIDEO_EXTENSIONS: &[&str] = &["mp4", "mov", "avi", "mkv", "m4v", "mpg", "mpeg", "mts", "webm"];

/// What a folder holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The cameras.
    pub cameras: Vec<FoundCamera>,
    /// How their exposures seem to pair up, and why.
    pub frames_from: (FramesFrom, String),
}

/// A camera that a folder seems to hold.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundCamera {
    /// Name for it.
    pub name: String,
    /// Its folder of images, or its video.
    pub path: PathBuf,
    /// A video.
    pub is_video: bool,
    /// What was seen of its images, in words.
    pub remarks: Vec<String>,
    stems: Vec<String>,
    times: usize,
}

/// Looks at a folder: images in it are one camera, images in its sub-folders one camera each, videos one camera each.
///
/// # Errors
/// When the folder cannot be read, or holds neither images nor videos.
pub fn look(folder: &Path) -> Result<Found> {
    let (images, videos, folders) = list(folder)?;
    let mut cameras = Vec::new();
    if !images.is_empty() {
        cameras.push(camera_of_images(folder, &images));
    }
    for sub in folders {
        let (images, sub_videos, _) = list(&sub)?;
        if !images.is_empty() {
            cameras.push(camera_of_images(&sub, &images));
        }
        cameras.extend(sub_videos.iter().map(|v| camera_of_video(v)));
    }
    cameras.extend(videos.iter().map(|v| camera_of_video(v)));
    if cameras.is_empty() {
        return Err(NoResult(format!("{} and the folders in it hold neither images nor videos", folder.display())).into());
    }
    name_uniquely(&mut cameras);
    let frames_from = pairing(&cameras);
    Ok(Found { cameras, frames_from })
}

type Listing = (Vec<PathBuf>, Vec<PathBuf>, Vec<PathBuf>);

/// Images, videos and folders in a folder, in natural order.
fn list(folder: &Path) -> Result<Listing> {
    let read = || format!("cannot read {}", folder.display());
    let (mut images, mut videos, mut folders): Listing = Default::default();
    for entry in std::fs::read_dir(folder).with_context(read)? {
        let path = entry.with_context(read)?.path();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        if path.is_dir() {
            folders.push(path);
        } else if is_image(&path) {
            images.push(path);
        } else if VIDEO_EXTENSIONS.contains(&extension.as_str()) {
            videos.push(path);
        }
    }
    for list in [&mut images, &mut videos, &mut folders] {
        list.sort_by_key(|p| (natural_key(&name_of(p)), p.clone()));
    }
    Ok((images, videos, folders))
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

fn camera_of_images(folder: &Path, images: &[PathBuf]) -> FoundCamera {
    let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let (mut focals, mut times, mut unreadable, mut makers) = (Vec::new(), 0, 0, BTreeSet::new());
    for image in images {
        // The header is enough, but it may lie anywhere in the file.
        let Some(info) = std::fs::read(image).ok().and_then(|bytes| imaging::probe(&bytes).ok()) else {
            unreadable += 1;
            continue;
        };
        *sizes.entry((info.width, info.height)).or_default() += 1;
        focals.extend(info.exif.focal_px(info.width, info.height));
        times += usize::from(info.exif.time_secs.is_some());
        makers.extend(info.exif.model);
    }
    let mut remarks = vec![format!("{} images", images.len())];
    for ((width, height), count) in &sizes {
        remarks.push(if sizes.len() == 1 { format!("{width} x {height} pixels") } else { format!("{count} of {width} x {height} pixels") });
    }
    if sizes.len() > 1 {
        remarks.push("only those of the most frequent size will be used".to_owned());
    }
    if unreadable > 0 {
        remarks.push(format!("{unreadable} cannot be read"));
    }
    remarks.extend(makers.into_iter().map(|m| format!("EXIF names a {}", m.escape_default())));
    focals.sort_by(f64::total_cmp);
    remarks.push(match focals.get(focals.len() / 2) {
        Some(focal) => format!("EXIF gives a focal length of {focal:.0} px, taken as the start"),
        None => "no focal length in EXIF: the best of several guesses is the start".to_owned(),
    });
    let stems = images.iter().map(|i| i.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()).collect();
    FoundCamera { name: name_of(folder), path: folder.to_path_buf(), is_video: false, remarks, stems, times }
}

fn camera_of_video(video: &Path) -> FoundCamera {
    let remarks = match imaging::video::Video::open(video) {
        Ok(opened) => {
            let info = opened.info();
            let duration = info.duration_secs.map_or(String::new(), |d| format!(", {d:.1} s"));
            vec![format!("{} x {} pixels, {:.2} frames a second{duration}", info.width, info.height, info.fps)]
        }
        Err(error) => vec![format!("cannot be read: {}", error.to_string().escape_default())],
    };
    let name = video.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    FoundCamera { name, path: video.to_path_buf(), is_video: true, remarks, stems: Vec::new(), times: 0 }
}

/// Names that cannot name a folder everywhere, or are not unique, become C1, C2, ...
fn name_uniquely(cameras: &mut [FoundCamera]) {
    let mut taken = BTreeSet::new();
    for i in 0..cameras.len() {
        if !is_safe_name(&cameras[i].name) || !taken.insert(cameras[i].name.clone()) {
            let name = (i + 1..).map(|n| format!("C{n}")).find(|n| !taken.contains(n)).unwrap_or_default();
            taken.insert(name.clone());
            cameras[i].name = name;
        }
    }
}

fn pairing(cameras: &[FoundCamera]) -> (FramesFrom, String) {
    let (first, others) = cameras.split_first().map_or((None, &[] as &[FoundCamera]), |(f, o)| (Some(f), o));
    let Some(first) = first.filter(|_| !others.is_empty()) else { return (FramesFrom::Order, "there is one camera".to_owned()) };
    if cameras.iter().any(|c| c.is_video) {
        return (FramesFrom::Order, "frames of videos pair by number; align the videos with offset_secs".to_owned());
    }
    let stems: BTreeSet<&String> = first.stems.iter().collect();
    if others.iter().all(|c| c.stems.iter().any(|s| stems.contains(s))) {
        return (FramesFrom::Stem, "the cameras' files have the same names".to_owned());
    }
    if others.iter().all(|c| c.stems.len() == first.stems.len()) {
        return (FramesFrom::Order, "the cameras have equally many files".to_owned());
    }
    if cameras.iter().all(|c| c.times == c.stems.len()) {
        return (FramesFrom::Timestamp, "the cameras have unequally many files, all with a time in EXIF".to_owned());
    }
    (FramesFrom::Order, "nothing else is known; the cameras have unequally many files: check this".to_owned())
}

/// The dive.toml for what was found.
#[must_use]
pub fn dive_toml(found: &Found) -> String {
    let mut text =
        String::from("# Written by `sfm init`. docs/dive-toml.md explains every key; all but the cameras can be left out.\n\n[dive]\n");
    let (rule, why) = &found.frames_from;
    let rule = match rule {
        FramesFrom::Order => "order",
        FramesFrom::Stem => "stem",
        FramesFrom::Timestamp => "timestamp",
    };
    let _ = writeln!(text, "name = \"dive\"\noutput = \"out\"\nframes_from = \"{rule}\"  # {why}");
    for camera in &found.cameras {
        let path = toml::Value::from(camera.path.to_string_lossy().replace('\\', "/"));
        let _ = writeln!(text, "\n# {}", camera.remarks.join("; "));
        let _ = writeln!(text, "[[camera]]\nname = \"{}\"", camera.name);
        if camera.is_video {
            let _ = writeln!(text, "video = {path}\nrate_hz = 2.0  # frames a second that are taken\noffset_secs = 0.0");
        } else {
            let _ = writeln!(text, "images = {path}");
        }
        text.push_str("# mask = \"masks/{stem}.png\"  # white where there is structure\n");
        text.push_str("# [camera.interior]           # a calibration, if there is one\n# model = \"opencv\"\n");
        text.push_str("# fx = 1000.0\n# fy = 1000.0\n# fixed = true\n");
    }
    if let [first, second, ..] = found.cameras.as_slice() {
        let _ = writeln!(text, "\n# The distance between two cameras makes the model metric.\n# [[rig.baseline]]");
        let _ = writeln!(text, "# between = [\"{}\", \"{}\"]\n# length_m = 0.3\n# sigma_m = 0.001", first.name, second.name);
    }
    text.push_str(
        "\n[mask]\nstrategy = \"none\"  # \"files\" reads masks, \"ip\" makes them by image processing, \"ml\" by a classifier\n",
    );
    text
}
