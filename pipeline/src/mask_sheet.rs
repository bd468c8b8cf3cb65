//! A sheet of images beside their masks.

use scene::{Mask, Raster};

/// An image and its masks; where there is none, all of it takes part.
#[derive(Clone, Debug)]
pub struct Row {
    /// The image.
    pub rgb: Raster<[u8; 3]>,
    /// One mask a strategy.
    pub masks: Vec<Option<Mask>>,
}

/// Width of a picture on the sheet, pixels.
const WIDTH: usize = 360;
/// Gap between pictures, pixels.
const GAP: usize = 4;
/// Colour over what is masked.
const SHADE: [u16; 3] = [190, 20, 90];

/// All rows, one below the other: the image, and the image with what each mask takes away shaded.
#[must_use]
pub fn sheet(rows: &[Row]) -> Raster<[u8; 3]> {
    let columns = 1 + rows.iter().map(|r| r.masks.len()).max().unwrap_or(0);
    let heights: Vec<usize> = rows.iter().map(|r| WIDTH * r.rgb.height() / r.rgb.width().max(1)).collect();
    let mut out = Raster::filled(columns * (WIDTH + GAP) - GAP, heights.iter().map(|h| h + GAP).sum(), [255; 3]);
    let mut top = 0;
    for (row, &height) in rows.iter().zip(&heights) {
        let small = imaging::resize_area_rgb(&row.rgb, WIDTH, height);
        paste(&mut out, &small, 0, top);
        for (i, mask) in row.masks.iter().enumerate() {
            let mut shaded = small.clone();
            if let Some(mask) = mask {
                let mask = imaging::resize_nearest(mask, WIDTH, height);
                for (pixel, _) in shaded.data_mut().iter_mut().zip(mask.data()).filter(|(_, m)| **m <= 127) {
                    // A third of the picture shows through.
                    (0..3).for_each(|c| pixel[c] = ((u16::from(pixel[c]) + 2 * SHADE[c]) / 3) as u8);
                }
            }
            paste(&mut out, &shaded, (i + 1) * (WIDTH + GAP), top);
        }
        top += height + GAP;
    }
    out
}

fn paste(out: &mut Raster<[u8; 3]>, picture: &Raster<[u8; 3]>, left: usize, top: usize) {
    for y in 0..picture.height() {
        out.row_mut(top + y)[left..left + picture.width()].copy_from_slice(picture.row(y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_masked_is_shaded() {
        let mut mask = Raster::filled(72, 36, 255u8);
        (0..36).for_each(|y| mask.row_mut(y)[..36].fill(0));
        let row = Row { rgb: Raster::filled(72, 36, [90; 3]), masks: vec![Some(mask), None] };
        let out = sheet(&[row.clone(), row]);
        assert_eq!((out.width(), out.height()), (3 * WIDTH + 2 * GAP, 2 * (180 + GAP)));
        assert_eq!([out[(10, 5)], out[(WIDTH + GAP + 10, 5)], out[(2 * WIDTH - 10, 5)]], [[90; 3], [156, 43, 90], [90; 3]]);
        assert_eq!(out[(2 * (WIDTH + GAP) + 10, 200)], [90; 3]);
        assert_eq!(sheet(&[]).height(), 0);
    }
}
