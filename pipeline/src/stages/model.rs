//! The model that `orient` makes: in COLMAP's binary form, with the cameras once more to the last digit.

use super::images::ImageList;
use crate::formats::{read_calibration, write_calibration};
use crate::stage::Work;
use crate::store::Fingerprint;
use anyhow::{Context, Result};
use scene::format::colmap::{ColmapFiles, read_colmap};
use scene::format::{ColmapModel, write_ply_cloud};
use scene::{Camera, CameraId, CameraModel, Cloud, ImageId, Reconstruction, Scale};
use std::collections::BTreeSet;
use std::io::Write;

/// Position of the shear C2 among the parameters of Brown's model.
const BROWN_SHEAR: usize = 9;

/// The files of a model, in the order in which they are written.
const FILES: [&str; 5] = ["cameras.bin", "rigs.bin", "frames.bin", "images.bin", "points3D.bin"];

/// The largest model, with its scale. Image names are those of the list; ids are its own.
///
/// # Errors
/// When a file is missing or damaged.
pub fn load(work: &Work<'_>) -> Result<Reconstruction> {
    let [cameras, rigs, frames, images, points] = FILES.map(|name| work.read("orient", &format!("sparse/{name}")));
    let (rigs, frames) = (rigs?, frames?);
    let files = ColmapFiles { cameras: &cameras?, rigs_and_frames: Some((&rigs, &frames)), images: &images?, points: &points? };
    let mut model = read_colmap(&files)?;
    let names = ImageList::load(work)?.cameras;
    for (camera, entry) in model.cameras.iter_mut().zip(&names) {
        let file = calibration_file(&entry.name);
        if !work.has("orient", &file) {
            continue;
        }
        *camera = read_calibration(&work.store.path(&file), &work.read("orient", &file)?).with_context(|| file.clone())?;
    }
    let metric = work.done.get("orient").is_some_and(|stamp| stamp.figures["scale"] == "metric");
    model.scale = if metric { Scale::Metric } else { Scale::Arbitrary };
    Ok(model)
}

pub(super) fn calibration_file(camera: &str) -> String {
    format!("calib/{camera}.toml")
}

/// Writes the interior orientation of every camera that has oriented images: of another there is nothing but its start.
///
/// # Errors
/// When a file cannot be written.
pub fn save_calibrations(work: &Work<'_>, model: &Reconstruction, list: &ImageList) -> Result<()> {
    let used: BTreeSet<CameraId> = model.oriented_images().map(|i| model.images[i.index()].camera).collect();
    for (c, (camera, entry)) in model.cameras.iter().zip(&list.cameras).enumerate() {
        if !used.contains(&CameraId::new(c)) {
            continue;
        }
        let text = write_calibration(camera, &entry.name);
        work.files.save(&calibration_file(&entry.name), Fingerprint::of_bytes(text.as_bytes()), text.as_bytes())?;
    }
    Ok(())
}

/// Median distance of each camera from the points that it observes; `None` where it observes none.
fn object_distances(model: &Reconstruction) -> Vec<Option<f64>> {
    let mut distances = vec![Vec::new(); model.cameras.len()];
    let centres: Vec<_> = (0..model.images.len()).map(|i| model.cam_from_world(ImageId::new(i)).map(|pose| pose.centre())).collect();
    for point in &model.points {
        for o in &point.track {
            let camera = model.images[o.image.index()].camera.index();
            distances[camera].extend(centres[o.image.index()].map(|centre| (point.xyz - centre).norm()));
        }
    }
    let median = |mut values: Vec<f64>| {
        let middle = values.len() / 2;
        (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    distances.into_iter().map(median).collect()
}

/// The model as COLMAP can hold it: without shear, and with cameras of one projection centre in place of those behind a port, which fit at the median
/// distance of what these see. `None` when it can hold it as it is.
fn for_colmap(model: &Reconstruction) -> Option<Reconstruction> {
    let has_shear = |camera: &Camera| camera.model() == CameraModel::Brown && camera.params()[BROWN_SHEAR] != 0.0;
    if !model.cameras.iter().any(|camera| has_shear(camera) || camera.port().is_some()) {
        return None;
    }
    let distances = object_distances(model);
    let mut model = model.clone();
    for (camera, distance) in model.cameras.iter_mut().zip(distances) {
        let at_its_objects = distance.map_or(*camera, |distance| camera.with_object_distance(distance));
        *camera = at_its_objects.central();
        if has_shear(camera) {
            camera.params_mut()[BROWN_SHEAR] = 0.0;
        }
    }
    Some(model)
}

type Writer = fn(&ColmapModel<'_>, &mut dyn Write) -> std::io::Result<()>;

/// Writes the files of a model below a folder.
///
/// # Errors
/// As [`files`], and when a file cannot be written.
pub fn save(work: &Work<'_>, model: &Reconstruction, sigmas: &[Option<f64>], folder: &str) -> Result<()> {
    for (name, bytes) in files(model, sigmas)? {
        work.files.save(&format!("{folder}/{name}"), Fingerprint::of_bytes(&bytes), &bytes)?;
    }
    Ok(())
}

/// A model as COLMAP's files and its points as a cloud, by name; `sigmas` of the points, or none. The shear of a camera of Brown's model is
/// left out, and a camera behind a port becomes one without that fits where most of what it sees is: COLMAP's models have neither. `calib/` has them as they are.
///
/// # Errors
/// When COLMAP cannot hold the model.
pub fn files(model: &Reconstruction, sigmas: &[Option<f64>]) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let changed = for_colmap(model);
    let colmap = ColmapModel::new(changed.as_ref().unwrap_or(model))?;
    let writers: [Writer; 5] = [
        |m, out| m.write_cameras_binary(out),
        |m, out| m.write_rigs_binary(out),
        |m, out| m.write_frames_binary(out),
        |m, out| m.write_images_binary(out),
        |m, out| m.write_points_binary(out),
    ];
    let mut files = Vec::with_capacity(FILES.len() + 1);
    for (&name, write) in FILES.iter().zip(writers) {
        let mut bytes = Vec::new();
        write(&colmap, &mut bytes)?;
        files.push((name, bytes));
    }
    let cloud = Cloud {
        positions: model.points.iter().map(|p| p.xyz.into()).collect(),
        colours: model.points.iter().map(|p| p.colour).collect(),
        sigmas: sigmas.iter().map(|s| s.map_or(f32::NAN, |s| s as f32)).collect(),
        views: model.points.iter().map(|p| p.track.len().min(usize::from(u16::MAX)) as u16).collect(),
        ..Cloud::default()
    };
    let mut bytes = Vec::new();
    write_ply_cloud(&cloud, &mut bytes)?;
    files.push(("points.ply", bytes));
    Ok(files)
}
