//! Drawings of a calibration: what was seen where, and what was left over.

use super::figures::Solved;
use super::photographs::in_words;
use super::solve::view_of;
use crate::report::{Gallery, Mark, Picture};
use anyhow::Result;
use calibrate::BoardFinding;
use std::collections::BTreeMap;

/// Photographs on the page; of more a part that is spread evenly.
const MAX_PHOTOGRAPHS: usize = 60;
const JPEG_QUALITY: u8 = 75;
/// Length of a usual residual on the drawing, as a share of the width of the image.
const RESIDUAL_SHARE: f64 = 0.012;
/// Colours of the first corner, of lines of corners and of corners left out.
const FIRST: &str = "#ff2d55";
const ROWS: &str = "#2ee66b";
const LEFT_OUT: &str = "#ff9500";
const RESIDUAL: &str = "#0b3c5d";

/// One drawing a camera: all corners with their residuals.
pub(super) fn residuals(solved: &Solved<'_>) -> Gallery {
    let all = solved.calibration.residuals(solved.setup);
    let picture = |c: usize| {
        let camera = &solved.calibration.cameras[c];
        let [w, h] = [camera.camera.width(), camera.camera.height()].map(f64::from);
        // A round factor that makes the root mean square as long as it should be.
        let factor = round_number(RESIDUAL_SHARE * w / camera.rms_px.max(1e-6));
        let mut marks = Vec::new();
        for (v, view) in solved.setup.views.iter().enumerate().filter(|(_, view)| view.camera == c) {
            for (k, (_, p)) in view.points.iter().enumerate() {
                let left_out = solved.calibration.outliers.contains(&(v, k));
                let colour = if left_out { LEFT_OUT } else { RESIDUAL };
                marks.push(Mark::Dot { at: [p.x, p.y], radius: w / 600.0, colour });
                if let (false, Some(r)) = (left_out, all[v][k]) {
                    let end = p + r * factor;
                    marks.push(Mark::Line { points: vec![[p.x, p.y], [end.x, end.y]], colour: RESIDUAL, width: w / 900.0 });
                }
            }
        }
        Picture {
            name: solved.config.cameras[c].name.clone(),
            caption: format!("{} corners, RMS {:.3} px, residuals {factor} times as long", camera.observations, camera.rms_px),
            size: [w, h],
            jpeg: None,
            marks,
        }
    };
    Gallery {
        title: "What was left over, and where corners were seen".to_owned(),
        note:
            "From each corner the line leads to where it was seen less where it is projected. Lines that lie in one direction over a part \
               of the image are a model that does not suit the lens; parts without corners are parts without knowledge."
                .to_owned(),
        pictures: (0..solved.calibration.cameras.len()).map(picture).collect(),
    }
}

/// The largest of 1, 2 or 5 times a power of ten below a number.
fn round_number(x: f64) -> f64 {
    let power = 10f64.powf(x.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|v| *v <= x).unwrap_or(power)
}

/// Photographs with the corners that were found in them.
pub(super) fn overlays(solved: &Solved<'_>) -> Result<Gallery> {
    let of_view: BTreeMap<usize, usize> =
        view_of(solved.seen).into_iter().enumerate().map(|(view, photograph)| (photograph, view)).collect();
    let count = solved.seen.list.len();
    let shown = count.min(MAX_PHOTOGRAPHS);
    let mut pictures = Vec::with_capacity(shown);
    for n in 0..shown {
        let k = n * count / shown;
        let photograph = &solved.seen.list[k];
        let [w, h] = [photograph.size.0, photograph.size.1].map(f64::from);
        let mut marks = Vec::new();
        if let BoardFinding::Found(board) = &photograph.finding {
            for row in board.corners.chunks(solved.config.target.columns) {
                marks.push(Mark::Line { points: row.iter().map(|p| [p.x, p.y]).collect(), colour: ROWS, width: w / 300.0 });
            }
            let first = board.corners[0];
            marks.push(Mark::Dot { at: [first.x, first.y], radius: w / 90.0, colour: FIRST });
            let outliers = solved.calibration.outliers.iter().filter(|o| Some(&o.0) == of_view.get(&k));
            marks.extend(outliers.map(|&(_, place)| {
                let p = board.corners[place];
                Mark::Dot { at: [p.x, p.y], radius: w / 110.0, colour: LEFT_OUT }
            }));
        }
        pictures.push(Picture {
            name: photograph.name.clone(),
            caption: in_words(&photograph.finding),
            size: [w, h],
            jpeg: Some(imaging::encode_jpeg_rgb(&photograph.small, JPEG_QUALITY)?),
            marks,
        });
    }
    Ok(Gallery {
        title: "Photographs".to_owned(),
        note: format!("{shown} of {count}. Rows of corners are green, the first corner is red, corners left out as mistakes are orange."),
        pictures,
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn factors_are_round() {
        for (x, round) in [(1.0, 1.0), (4.9, 2.0), (73.0, 50.0), (0.03, 0.02)] {
            assert!((super::round_number(x) / round - 1.0).abs() < 1e-9, "{x}");
        }
    }
}
