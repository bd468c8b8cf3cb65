//! Frames beside their truth, to look at.

use anyhow::Result;
use imaging::{encode_png_rgb, resize_area_rgb, resize_nearest};
use scene::Raster;
use std::sync::Mutex;
use synthetic::dive::{DiveImage, DiveScene};

/// Frames in the preview, spread over the dive.
const ROWS: usize = 5;
/// Width of each picture.
const WIDTH: usize = 360;
const GAP: usize = 4;
/// Depth of the brightest and the darkest grey, metres.
const DEPTHS_M: [f32; 2] = [1.0, 10.0];
/// Colours of the labels, in the order of their numbers.
const COLOURS: [[u8; 3]; 8] =
    [[20, 40, 90], [200, 120, 60], [225, 205, 150], [140, 130, 120], [250, 250, 250], [230, 60, 60], [250, 220, 40], [80, 220, 220]];

/// Gathers some frames; they may come in any order and from many threads.
pub(super) struct Preview {
    chosen: Vec<(usize, usize)>,
    rows: Vec<Mutex<Option<Raster<[u8; 3]>>>>,
}

impl Preview {
    pub fn new(dive: &DiveScene) -> Self {
        let shots = dive.exposures() * dive.cameras.len();
        let count = ROWS.min(shots);
        // Every camera in turn, from the first to the last exposure.
        let chosen: Vec<(usize, usize)> =
            (0..count).map(|k| (k % dive.cameras.len(), k * (dive.exposures() - 1) / (count - 1).max(1))).collect();
        Self { rows: chosen.iter().map(|_| Mutex::new(None)).collect(), chosen }
    }

    /// Takes a frame, if it is one of those to show.
    pub fn add(&self, image: &DiveImage) {
        for (slot, _) in self.rows.iter().zip(&self.chosen).filter(|(_, shot)| **shot == (image.camera, image.exposure)) {
            // A poisoned lock means that another frame's thread panicked, and with it the whole run.
            if let Ok(mut row) = slot.lock() {
                *row = Some(beside(image));
            }
        }
    }

    /// The picture: a row a frame, with frame, mask, labels and depth.
    pub fn encode(self) -> Result<Vec<u8>> {
        let rows: Vec<Raster<[u8; 3]>> = self.rows.into_iter().filter_map(|row| row.into_inner().ok().flatten()).collect();
        let width = rows.iter().map(Raster::width).max().unwrap_or(1);
        let height = rows.iter().map(|r| r.height() + GAP).sum::<usize>().max(1);
        let mut sheet = Raster::filled(width, height, [255; 3]);
        let mut top = 0;
        for row in &rows {
            for y in 0..row.height() {
                sheet.row_mut(top + y)[..row.width()].copy_from_slice(row.row(y));
            }
            top += row.height() + GAP;
        }
        Ok(encode_png_rgb(&sheet)?)
    }
}

fn beside(image: &DiveImage) -> Raster<[u8; 3]> {
    let width = WIDTH.min(image.rgb.width());
    let height = (image.rgb.height() * width / image.rgb.width()).max(1);
    let grey = |v: u8| [v; 3];
    let pictures = [
        resize_area_rgb(&image.rgb, width, height),
        resize_nearest(&image.mask, width, height).map(|&v| grey(v)),
        resize_nearest(&image.labels, width, height).map(|&l| COLOURS[usize::from(l) % COLOURS.len()]),
        resize_nearest(&image.depth, width, height).map(|&d| if d > 0.0 { grey(shade(d)) } else { COLOURS[0] }),
    ];
    let mut row = Raster::filled(4 * width + 3 * GAP, height, [255; 3]);
    for (k, picture) in pictures.iter().enumerate() {
        for y in 0..height {
            row.row_mut(y)[k * (width + GAP)..][..width].copy_from_slice(picture.row(y));
        }
    }
    row
}

/// Near is bright.
fn shade(depth: f32) -> u8 {
    let [near, far] = DEPTHS_M;
    (255.0 * (1.0 - ((depth - near) / (far - near)).clamp(0.0, 0.92))) as u8
}
