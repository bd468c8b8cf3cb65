//! The model that `orient` makes, in COLMAP's binary form.

use crate::stage::Work;
use crate::store::Fingerprint;
use anyhow::Result;
use scene::format::colmap::{ColmapFiles, read_colmap};
use scene::format::{ColmapModel, write_ply_cloud};
use scene::{Cloud, Reconstruction, Scale};
use std::io::Write;

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
    let metric = work.done.get("orient").is_some_and(|stamp| stamp.figures["scale"] == "metric");
    model.scale = if metric { Scale::Metric } else { Scale::Arbitrary };
    Ok(model)
}

type Writer = fn(&ColmapModel<'_>, &mut dyn Write) -> std::io::Result<()>;

/// Writes a model and its points as a cloud below a folder.
///
/// # Errors
/// When COLMAP cannot hold the model, or a file cannot be written.
pub fn save(work: &Work<'_>, model: &Reconstruction, folder: &str) -> Result<()> {
    let colmap = ColmapModel::new(model)?;
    let writers: [Writer; 5] = [
        |m, out| m.write_cameras_binary(out),
        |m, out| m.write_rigs_binary(out),
        |m, out| m.write_frames_binary(out),
        |m, out| m.write_images_binary(out),
        |m, out| m.write_points_binary(out),
    ];
    for (name, write) in FILES.iter().zip(writers) {
        let mut bytes = Vec::new();
        write(&colmap, &mut bytes)?;
        work.files.save(&format!("{folder}/{name}"), Fingerprint::of_bytes(&bytes), &bytes)?;
    }
    let cloud = Cloud {
        positions: model.points.iter().map(|p| p.xyz.into()).collect(),
        colours: model.points.iter().map(|p| p.colour).collect(),
        views: model.points.iter().map(|p| p.track.len().min(usize::from(u16::MAX)) as u16).collect(),
        ..Cloud::default()
    };
    let mut bytes = Vec::new();
    write_ply_cloud(&cloud, &mut bytes)?;
    work.files.save(&format!("{folder}/points.ply"), Fingerprint::of_bytes(&bytes), &bytes)?;
    Ok(())
}
