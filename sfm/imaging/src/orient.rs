//! EXIF orientation.

use scene::Raster;

/// Side of the blocks in which rows become columns: a block of f32 fits the first-level cache.
const BLOCK: usize = 32;

/// Whether an EXIF orientation exchanges width and height.
pub(crate) fn exchanges_axes(orientation: u8) -> bool {
    (5..=8).contains(&orientation)
}

/// The raster turned upright according to an EXIF orientation (tag 274): 1 as stored, 2 mirrored left-right, 3 turned by
/// 180 degrees, 4 mirrored top-bottom, 5 transposed, 6 to be turned clockwise, 7 transverse, 8 to be turned counter-clockwise.
/// Any other value changes nothing.
#[must_use]
pub fn apply_orientation<T: Copy>(raster: Raster<T>, orientation: u8) -> Raster<T> {
    let (w, h) = (raster.width(), raster.height());
    if !(2..=8).contains(&orientation) || raster.data().is_empty() {
        return raster;
    }
    if !exchanges_axes(orientation) {
        let mut raster = raster;
        match orientation {
            2 => raster.data_mut().chunks_exact_mut(w).for_each(<[T]>::reverse),
            3 => raster.data_mut().reverse(),
            _ => {
                for y in 0..h / 2 {
                    let (above, below) = raster.data_mut().split_at_mut((h - 1 - y) * w);
                    above[y * w..(y + 1) * w].swap_with_slice(&mut below[..w]);
                }
            }
        }
        return raster;
    }
    // Row y of the output is column x of the input, each perhaps counted from its far end.
    let (columns_reversed, rows_reversed) = (matches!(orientation, 7 | 8), matches!(orientation, 6 | 7));
    let mut out = Raster::filled(h, w, raster.data()[0]);
    for x0 in (0..w).step_by(BLOCK) {
        for y0 in (0..h).step_by(BLOCK) {
            for x in x0..(x0 + BLOCK).min(w) {
                let row = out.row_mut(if columns_reversed { w - 1 - x } else { x });
                for y in y0..(y0 + BLOCK).min(h) {
                    row[if rows_reversed { h - 1 - y } else { y }] = raster.data()[y * w + x];
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// EXIF 2.32, table for tag 274: where row 0 and column 0 of the stored image lie in the upright one. Cell (x, y) of
    /// the upright image, from the stored one.
    fn naive(stored: &Raster<u32>, orientation: u8) -> Raster<u32> {
        let (w, h) = (stored.width(), stored.height());
        let (ow, oh) = if (5..=8).contains(&orientation) { (h, w) } else { (w, h) };
        let mut values = Vec::new();
        for y in 0..oh {
            for x in 0..ow {
                let (sx, sy) = match orientation {
                    2 => (w - 1 - x, y),
                    3 => (w - 1 - x, h - 1 - y),
                    4 => (x, h - 1 - y),
                    5 => (y, x),
                    6 => (y, h - 1 - x),
                    7 => (w - 1 - y, h - 1 - x),
                    8 => (w - 1 - y, x),
                    _ => (x, y),
                };
                values.push(stored[(sx, sy)]);
            }
        }
        Raster::from_vec(ow, oh, values).expect("one value a pixel")
    }

    #[test]
    fn all_orientations_agree_with_the_table() {
        for (w, h) in [(1, 1), (3, 2), (2, 5), (37, 70), (64, 33)] {
            let stored = Raster::from_vec(w, h, (0..(w * h) as u32).collect()).expect("one value a pixel");
            for orientation in 0..=9 {
                assert_eq!(
                    apply_orientation(stored.clone(), orientation),
                    naive(&stored, orientation),
                    "{w}x{h} orientation {orientation}"
                );
            }
        }
    }

    #[test]
    fn six_turns_clockwise() {
        // A camera held upright: stored row "1 2 3" becomes a column, its left end on top.
        let stored = Raster::from_vec(3, 1, vec![1, 2, 3]).expect("three values");
        let upright = apply_orientation(stored, 6);
        assert_eq!((upright.width(), upright.height(), upright.data()), (1, 3, &[1, 2, 3][..]));
    }
}
