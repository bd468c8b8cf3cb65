//! The page of a calibration.

use super::drawings;
use super::figures::Solved;
use super::record::Record;
use crate::report::{CameraGlyph, Figure, PointSet, Report, Scene3d, Section};
use anyhow::Result;
use nalgebra::Point3;

/// Colours of the boards in the 3D view.
const COLOURS: [[u8; 3]; 6] = [[80, 200, 255], [255, 180, 60], [120, 230, 120], [255, 110, 160], [200, 160, 255], [240, 240, 120]];

pub(super) fn page(solved: &Solved<'_>, record: &Record) -> Result<Report> {
    Ok(Report {
        title: record.name.clone(),
        verdict: format!(
            "{} cameras calibrated from {} images of {}; a corner has a standard deviation of {:.3} px.",
            record.cameras.len(),
            record.images.with_target,
            record.images.total,
            record.sigma0_px
        ),
        figures: first_screen(record),
        warnings: record.warnings.iter().map(|w| format!("{}: {}", w.about, w.message)).collect(),
        scene: scene(solved),
        sections: sections(record),
        galleries: vec![drawings::residuals(solved), drawings::overlays(solved)?],
        thumbnails: Vec::new(),
    })
}

fn first_screen(record: &Record) -> Vec<Figure> {
    let figure = |label: &str, value: String, note: String| Figure { label: label.to_owned(), value, note };
    let mut figures = vec![
        figure("images with the target", record.images.with_target.to_string(), format!("of {}", record.images.total)),
        figure("reprojection error, px", format!("{:.3}", record.rms_px), format!("root mean square of {} corners", record.observations)),
        figure("corners left out", record.outliers.to_string(), "as mistakes".to_owned()),
    ];
    for b in &record.baselines {
        let label = format!("baseline {} - {}, m", b.between[0], b.between[1]);
        figures.push(figure(&label, format!("{:.5}", b.length_m), format!("+- {:.5}", b.sigma_m)));
    }
    figures
}

fn section(title: &str, note: &str, head: &[&str], rows: Vec<Vec<String>>) -> Section {
    Section { title: title.to_owned(), note: note.to_owned(), head: head.iter().map(|h| (*h).to_owned()).collect(), rows }
}

/// A value and its standard deviation, to two digits of that.
pub(super) fn with_sigma(value: f64, sigma: f64) -> (String, String) {
    let digits = if sigma > 0.0 { (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) as usize } else { 6 };
    (format!("{value:.digits$}"), if sigma > 0.0 { format!("{sigma:.digits$}") } else { "held".to_owned() })
}

fn sections(record: &Record) -> Vec<Section> {
    let mut all = Vec::new();
    for camera in &record.cameras {
        let rows = camera.parameters.iter().enumerate().map(|(k, p)| {
            let (value, sigma) = with_sigma(p.value, p.sigma);
            // What it is most tied to: a large one says that both are known worse than together.
            let strongest = (0..camera.parameters.len())
                .filter(|&j| j != k)
                .max_by(|&a, &b| camera.correlations[k][a].abs().total_cmp(&camera.correlations[k][b].abs()));
            let tied = strongest.filter(|&j| camera.correlations[k][j] != 0.0);
            let tied = tied.map_or_else(String::new, |j| format!("{} {:+.2}", camera.parameters[j].name, camera.correlations[k][j]));
            let significant = match p.significant {
                Some(true) => "yes",
                Some(false) => "no",
                None => "",
            };
            vec![p.name.clone(), value, sigma, significant.to_owned(), tied]
        });
        let [w, h] = camera.size;
        let note = format!(
            "Model {}, {w} x {h} pixels, {} of {} images, {} corners, RMS {:.3} px. Lengths in pixels.",
            camera.model, camera.with_target, camera.images, camera.observations, camera.rms_px
        );
        let head = ["parameter", "value", "standard deviation", "differs from 0 at 99 %", "strongest correlation"];
        all.push(section(&format!("Interior orientation of {}", camera.name), &note, &head, rows.collect()));
    }
    if record.cameras.len() > 1 {
        let rows = record.cameras.iter().map(|c| {
            let three = |v: [f64; 3], digits: usize| v.map(|x| format!("{x:.digits$}")).join(", ");
            let pose = &c.pose;
            let [w, x, y, z] = pose.quaternion_wxyz;
            let angle = 2.0 * (x * x + y * y + z * z).sqrt().atan2(w.abs());
            vec![
                c.name.clone(),
                three(pose.translation_m, 5),
                three(pose.sigma_translation_m, 5),
                format!("{:.4}", angle.to_degrees()),
                three(pose.sigma_rotation_deg, 4),
            ]
        });
        let head = ["camera", "translation, m", "standard deviations", "turned by, degrees", "standard deviations about x, y, z"];
        all.push(section("Rig", "cam_from_rig: the first camera is the frame of the rig.", &head, rows.collect()));
        let rows = record.baselines.iter().map(|b| {
            let (length, sigma) = with_sigma(b.length_m, b.sigma_m);
            vec![format!("{} - {}", b.between[0], b.between[1]), length, sigma]
        });
        all.push(section("Baselines", "Distances of projection centres.", &["between", "length, m", "standard deviation"], rows.collect()));
        let rows = record.rectifications.iter().map(|r| {
            let px = |v: f64| format!("{v:.3}");
            vec![format!("{} - {}", r.between[0], r.between[1]), r.points.to_string(), px(r.mean_px), px(r.rms_px), px(r.max_px)]
        });
        let note =
            "Corners that both cameras saw at one time: difference of their rows in the rectified images (Fusiello, Trucco & Verri 2000).";
        let head = ["between", "corners", "mean, px", "RMS, px", "largest, px"];
        all.push(section("Rectification", note, &head, rows.collect()));
    }
    let rows = record.photographs.iter().map(|p| {
        let rms = p.rms_px.map_or_else(String::new, |v| format!("{v:.3}"));
        vec![p.name.clone(), p.exposure.to_string(), p.target.clone(), p.corners.to_string(), p.left_out.to_string(), rms]
    });
    let head = ["image", "exposure", "target", "corners", "left out", "RMS, px"];
    all.push(section("Images", "", &head, rows.collect()));
    all
}

fn scene(solved: &Solved<'_>) -> Scene3d {
    let mut boards = PointSet { name: "boards".to_owned(), ..PointSet::default() };
    for (e, pose) in solved.calibration.exposures.iter().enumerate() {
        let Some(rig_from_target) = pose else { continue };
        for x in &solved.setup.target {
            boards.positions.push(Point3::from(rig_from_target.apply(x)));
            boards.colours.push(COLOURS[e % COLOURS.len()]);
        }
    }
    let cameras = solved.calibration.cameras.iter().zip(&solved.config.cameras).map(|(found, camera)| CameraGlyph {
        name: camera.name.clone(),
        cam_from_world: found.cam_from_rig,
        half_extent: [found.camera.width(), found.camera.height()].map(|side| f64::from(side) / 2.0 / found.camera.mean_focal()),
    });
    Scene3d { sets: vec![boards], cameras: cameras.collect(), unit: "m".to_owned() }
}
