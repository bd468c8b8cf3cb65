//! What goes on the page for people.

use super::images::{ImageEntry, ImageList};
use super::{densify, features, mask, model};
use crate::report::{CameraGlyph, Figure, PointSet, Report, Scene3d, Section, Thumbnail};
use crate::stage::Work;
use anyhow::Result;
use rayon::prelude::*;
use scene::format::read_ply_cloud;
use scene::{Mask, Raster, Reconstruction};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Most warnings on the page.
const MAX_WARNINGS: usize = 100;
/// Quality of the thumbnails.
const JPEG_QUALITY: u8 = 80;
/// Keypoints that are part of a scene point, and others.
const USED: [u8; 3] = [60, 220, 90];
const UNUSED: [u8; 3] = [255, 150, 30];

/// The page of a run, from the figures of all stages and what they made.
///
/// # Errors
/// When a file of an earlier stage is missing or damaged.
pub(super) fn page(work: &Work<'_>, figures: &Value) -> Result<Report> {
    let list = ImageList::load(work)?;
    let model = model::load(work)?;
    let all = figures["warnings"].as_array().map(Vec::as_slice).unwrap_or_default();
    let mut warnings: Vec<String> =
        all.iter().take(MAX_WARNINGS).map(|w| format!("{}: {}", text(&w["about"]), text(&w["message"]))).collect();
    if all.len() > MAX_WARNINGS {
        warnings.push(format!("and {} more; all are in report.json", all.len() - MAX_WARNINGS));
    }
    Ok(Report {
        title: work.config.name.clone(),
        verdict: verdict(figures),
        figures: first_screen(figures),
        warnings,
        scene: scene(work, &model)?,
        sections: sections(figures),
        galleries: Vec::new(),
        thumbnails: thumbnails(work, &list, &model)?,
    })
}

fn verdict(figures: &Value) -> String {
    let scale = if figures["scale"] == "metric" { "in metres" } else { "in an unknown unit: no known length could be used" };
    format!(
        "{} of {} images oriented, {scale}, at a reprojection error of {} px.",
        text(&figures["images"]["oriented"]),
        text(&figures["images"]["total"]),
        number(&figures["reprojection_rms_px"], 2)
    )
}

fn first_screen(figures: &Value) -> Vec<Figure> {
    let evaluation = &figures["evaluation"];
    let all = [
        ("images oriented", text(&figures["images"]["oriented"]), format!("of {}", text(&figures["images"]["total"]))),
        ("reprojection error, px", number(&figures["reprojection_rms_px"], 3), "root mean square".to_owned()),
        ("sparse points", text(&figures["points"]), format!("{} observations", text(&figures["observations"]))),
        ("dense points", text(&figures["dense"]["points"]), format!("{} depth maps", text(&figures["dense"]["maps"]))),
        ("masked, %", percent(&figures["masks"]["masked_ratio"]), format!("strategy {}", text(&figures["masks"]["strategy"]))),
        ("distance to reference, m", number(&evaluation["c2m_mean_m"], 4), "mean over the dense cloud".to_owned()),
        ("signal, %", percent(&evaluation["snr"]), format!("within {} m", number(&evaluation["threshold_m"], 3))),
        ("integrity, %", percent(&evaluation["integrity_coverage"]), "of the reference's cells".to_owned()),
    ];
    // What is not known is left out, not shown as nothing.
    all.into_iter()
        .filter(|(_, value, _)| !value.is_empty())
        .map(|(label, value, note)| Figure { label: label.to_owned(), value, note })
        .collect()
}

fn sections(figures: &Value) -> Vec<Section> {
    let section = |title: &str, note: &str, head: &[&str], rows: Vec<Vec<String>>| Section {
        title: title.to_owned(),
        note: note.to_owned(),
        head: head.iter().map(|h| (*h).to_owned()).collect(),
        rows,
    };
    let rows =
        |value: &Value, row: fn(&Value) -> Vec<String>| -> Vec<Vec<String>> { value.as_array().into_iter().flatten().map(row).collect() };
    let cameras = rows(&figures["cameras"], |c| {
        let params = c["params"].as_object().into_iter().flatten().map(|(name, value)| format!("{name} {}", number(value, 5)));
        vec![text(&c["name"]), text(&c["images"]), text(&c["model"]), params.collect::<Vec<_>>().join(", "), text(&c["start"])]
    });
    let baselines = rows(&figures["baselines"], |b| {
        let between = format!("{} to {}", text(&b["between"][0]), text(&b["between"][1]));
        vec![between, number(&b["given_m"], 4), number(&b["found_m"], 4), number(&b["sigma_m"], 4), number(&b["test_value"], 1), role(b)]
    });
    let rig = rows(&figures["rig_poses"], |r| {
        vec![text(&r["camera"]), number(&r["turned_deg"], 4), number(&r["moved_m"], 5), number(&r["normalised_residual"], 1)]
    });
    let bars = rows(&figures["scale_bars"], |b| {
        let (given, found) = (number(&b["given_m"], 4), number(&b["found_m"], 4));
        vec![text(&b["name"]), given, found, number(&b["error_m"], 5), number(&b["normalised_residual"], 1), role(b)]
    });
    let points = rows(&figures["control_points"], |p| {
        let [east, north, up] = [0, 1, 2].map(|k| number(&p["error_m"][k], 4));
        vec![text(&p["name"]), east, north, up, number(&p["normalised_residual"], 1), role(p)]
    });
    let instruments =
        [("horizontal", "positions, m"), ("height", "heights and depths, m"), ("tilt", "tilts, degrees"), ("heading", "headings, degrees")];
    let instruments = instruments.into_iter().map(|(key, of)| (of, &figures["world"][key])).filter(|(_, i)| !i.is_null()).map(|(of, i)| {
        let rms = if i["rms_m"].is_null() { number(&i["rms_deg"], 2) } else { number(&i["rms_m"], 3) };
        vec![of.to_owned(), text(&i["readings"]), text(&i["outliers"]), rms, number(&i["sigma0"], 2)]
    });
    let instruments: Vec<_> = instruments.collect();
    let models = rows(&figures["models"], |m| vec![text(&m["images"]), text(&m["points"])]);
    let matching = &figures["matching"];
    let pairs = vec![vec![
        text(&matching["pairs_tried"]),
        text(&matching["pairs_verified"]),
        text(&matching["calibrated"]),
        text(&matching["uncalibrated"]),
        text(&matching["planar_or_panoramic"]),
    ]];
    let normalised = "A normalised residual is above 3.3 once in 1,000 times by chance.";
    let unit = if figures["scale"] == "metric" { "m" } else { "units of the model" };
    let p = &figures["precision"];
    let in_world = &p["datum_in_world"]["centre_m"];
    let placed = [0, 1, 2].map(|k| number(&in_world[k], 3));
    let placed =
        if in_world.is_null() { String::new() } else { format!(", which is placed to {} m east, north and up", placed.join(", ")) };
    let sigma0 = number(&p["sigma0_image"], 2);
    let datum = text(&p["datum"]);
    let datum = format!(
        "Standard deviations relative to {datum}{placed}. Image observations are {sigma0} times as uncertain as assumed, and weighed so."
    );
    let precision = [
        (format!("projection centres, {unit}"), "centre_median", "centre_max", 5),
        ("rotations, degrees".to_owned(), "rotation_median_deg", "rotation_max_deg", 4),
        (format!("points, {unit}"), "point_median", "", 5),
    ];
    let precision = precision.into_iter().map(|(of, median, max, d)| vec![of, number(&p[median], d), number(&p[max], d)]);
    let precision: Vec<_> = precision.filter(|row| !row[1].is_empty()).collect();
    let sections = [
        section("Cameras", "Lengths in pixels.", &["camera", "images", "model", "interior orientation", "start"], cameras),
        section("Baselines", normalised, &["between", "given, m", "found, m", "sigma, m", "normalised residual", "role"], baselines),
        section("Rig", normalised, &["camera", "turned, degrees", "moved, m", "normalised residual"], rig),
        section("Known lengths", normalised, &["length", "given, m", "found, m", "error, m", "normalised residual", "role"], bars),
        section("Control points", normalised, &["point", "east, m", "north, m", "up, m", "normalised residual", "role"], points),
        section(
            "Sensors",
            "Root mean square residuals; sigma0 is the same over the given standard deviation. Outliers hardly weigh.",
            &["readings of", "number", "outliers", "residual", "sigma0"],
            instruments,
        ),
        section("Precision", &datum, &["of", "median", "largest"], precision),
        section("Pairs of images", "", &["tried", "verified", "calibrated", "uncalibrated", "planar or panoramic"], pairs),
    ];
    let fell_apart = (models.len() > 1).then(|| section("Models", "The images fell apart.", &["images", "points"], models));
    sections.into_iter().chain(fell_apart).filter(|s| !s.rows.is_empty()).collect()
}

/// What a known length is there for.
fn role(length: &Value) -> String {
    match () {
        () if length["rejected"] == true => "taken out",
        () if length["check"] == true => "held out",
        () => "used",
    }
    .to_owned()
}

fn text(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn number(value: &Value, decimals: usize) -> String {
    value.as_f64().map_or(String::new(), |v| format!("{v:.decimals$}"))
}

fn percent(value: &Value) -> String {
    value.as_f64().map_or(String::new(), |v| format!("{:.1}", 100.0 * v))
}

fn scene(work: &Work<'_>, model: &Reconstruction) -> Result<Scene3d> {
    let (cloud, _) = read_ply_cloud(work.read("densify", densify::CLOUD)?.as_slice())?;
    let dense = PointSet { name: "dense cloud".to_owned(), positions: cloud.positions, colours: cloud.colours };
    let sparse = PointSet {
        name: "sparse points".to_owned(),
        positions: model.points.iter().map(|p| p.xyz.into()).collect(),
        colours: model.points.iter().map(|p| p.colour).collect(),
    };
    let cameras = model.oriented_images().filter_map(|image| {
        let entry = &model.images[image.index()];
        let camera = &model.cameras[entry.camera.index()];
        let focal = camera.mean_focal();
        let half_extent = [f64::from(camera.width()) / 2.0 / focal, f64::from(camera.height()) / 2.0 / focal];
        Some(CameraGlyph { name: entry.name.clone(), cam_from_world: model.cam_from_world(image)?, half_extent })
    });
    let unit = if model.scale == scene::Scale::Metric { "m" } else { "units" };
    let sets = [dense, sparse].into_iter().filter(|set| !set.positions.is_empty()).collect();
    Ok(Scene3d { sets, cameras: cameras.collect(), unit: unit.to_owned() })
}

/// Images spread evenly over the list.
fn thumbnails(work: &Work<'_>, list: &ImageList, model: &Reconstruction) -> Result<Vec<Thumbnail>> {
    let (count, wanted) = (list.images.len(), work.config.report.thumbnails as usize);
    let chosen: Vec<&ImageEntry> =
        if count <= wanted { list.images.iter().collect() } else { (0..wanted).map(|i| &list.images[i * count / wanted]).collect() };
    let mut used: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
    for observation in model.points.iter().flat_map(|p| &p.track) {
        used.entry(&model.images[observation.image.index()].name).or_default().insert(observation.keypoint.index());
    }
    work.progress.begin("thumbnails", chosen.len());
    let none = BTreeSet::new();
    let made: Vec<Result<Option<Thumbnail>>> = chosen
        .par_iter()
        .map(|image| {
            let made = thumbnail(work, list, image, used.get(image.name.as_str()).unwrap_or(&none));
            work.progress.advance(1);
            made
        })
        .collect();
    Ok(made.into_iter().collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
}

/// A picture with its keypoints and its background shaded; `None` for an image that cannot be decoded, which has been told.
fn thumbnail(work: &Work<'_>, list: &ImageList, image: &ImageEntry, used: &BTreeSet<usize>) -> Result<Option<Thumbnail>> {
    let Ok(full) = imaging::decode_rgb(&list.bytes(work, image)?) else { return Ok(None) };
    let (width, height) = dense::fit(image.width, image.height, work.config.report.thumbnail_px);
    let (w, h) = (width as usize, height as usize);
    let mut small = imaging::resize_area_rgb(&full, w, h);
    if let Some(mask) = mask::load(work, list, image)? {
        shade(&mut small, &imaging::resize_nearest(&mask, w, h));
    }
    let stored = features::load(work, list, image)?;
    let scale = [f64::from(width) / f64::from(image.width), f64::from(height) / f64::from(image.height)];
    // Those in scene points last, so that they lie on top.
    for wanted in [false, true] {
        for (i, k) in stored.features.keypoints.iter().enumerate().filter(|(i, _)| used.contains(i) == wanted) {
            let (x, y) = ((f64::from(k.x) * scale[0]) as usize, (f64::from(k.y) * scale[1]) as usize);
            let colour = if used.contains(&i) { USED } else { UNUSED };
            if x < w && y < h {
                small[(x, y)] = colour;
            }
        }
    }
    let caption = format!("{} keypoints, {} in scene points", stored.features.len(), used.len());
    Ok(Some(Thumbnail { name: image.name.clone(), caption, jpeg: imaging::encode_jpeg_rgb(&small, JPEG_QUALITY)? }))
}

/// Mixes background with blue.
fn shade(rgb: &mut Raster<[u8; 3]>, mask: &Mask) {
    for (pixel, &m) in rgb.data_mut().iter_mut().zip(mask.data()) {
        if m < 128 {
            *pixel = [pixel[0] / 2, pixel[1] / 2, pixel[2] / 2 + 127];
        }
    }
}
