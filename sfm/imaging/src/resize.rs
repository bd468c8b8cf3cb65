//! Change of size.
//!
//! A point (x, y) of the input lies at (x * new_width / width, y * new_height / height) of the output: pixel edges map to pixel edges, as the
//! convention with centres at (0.5, 0.5) demands, and interior orientations scale by the same factors.

use scene::Raster;

/// Shrinks by averaging over the area that each new pixel covers (with fractions at its rim); an axis that grows is interpolated linearly
/// between pixel centres and continued by its last pixel. An empty input or output gives an empty or black raster.
#[must_use]
pub fn resize_area_grey(image: &Raster<f32>, width: usize, height: usize) -> Raster<f32> {
    resize(image, width, height, |row, weight, sums| sums.iter_mut().zip(row).for_each(|(s, &v)| *s += weight * v), |[v]| v)
}

/// [`resize_area_grey`] for colour; rounds to the nearest byte.
#[must_use]
pub fn resize_area_rgb(image: &Raster<[u8; 3]>, width: usize, height: usize) -> Raster<[u8; 3]> {
    let add = |row: &[[u8; 3]], weight: f32, sums: &mut [f32]| {
        sums.iter_mut().zip(row.as_flattened()).for_each(|(s, &v)| *s += weight * f32::from(v));
    };
    resize(image, width, height, add, |sums: [f32; 3]| sums.map(|v| (v + 0.5) as u8))
}

/// The value of the input pixel in which the centre of each new pixel falls: for masks and labels, which must not be mixed.
///
/// An input without pixels gives an output without pixels.
#[must_use]
pub fn resize_nearest<T: Copy>(image: &Raster<T>, width: usize, height: usize) -> Raster<T> {
    let (w, h) = (image.width(), image.height());
    let (width, height) = if w == 0 || h == 0 { (0, 0) } else { (width, height) };
    // Integer form of floor((x + 0.5) * w / width): exact at every size.
    let source = |i: usize, old: usize, new: usize| (2 * i + 1) * old / (2 * new);
    let columns: Vec<usize> = (0..width).map(|x| source(x, w, width)).collect();
    let mut values = Vec::with_capacity(width * height);
    for y in 0..height {
        let row = image.row(source(y, h, height));
        values.extend(columns.iter().map(|&x| row[x]));
    }
    Raster::from_vec(width, height, values).expect("one value a pixel was pushed")
}

/// Weights of the input pixels in one output pixel, along one axis.
struct Footprint {
    first: usize,
    weights: Vec<f32>,
}

fn footprints(old: usize, new: usize) -> Vec<Footprint> {
    let step = old as f64 / new as f64;
    (0..new)
        .map(|i| {
            if new > old {
                let centre = ((i as f64 + 0.5) * step - 0.5).clamp(0.0, (old - 1) as f64);
                let first = (centre as usize).min(old.saturating_sub(2));
                let fraction = (centre - first as f64) as f32;
                return Footprint { first, weights: if old == 1 { vec![1.0] } else { vec![1.0 - fraction, fraction] } };
            }
            let (from, to) = (i as f64 * step, (i + 1) as f64 * step);
            let first = (from as usize).min(old - 1);
            let last = (to.ceil() as usize).clamp(first + 1, old);
            let covered = |x: usize| (to.min((x + 1) as f64) - from.max(x as f64)).max(0.0);
            // By the sum and not by `step`: whole numbers stay whole numbers where an image is reduced by a whole factor.
            let sum: f64 = (first..last).map(covered).sum();
            Footprint { first, weights: (first..last).map(|x| (covered(x) / sum) as f32).collect() }
        })
        .collect()
}

fn resize<T: Clone, const C: usize>(
    image: &Raster<T>,
    width: usize,
    height: usize,
    add_row: impl Fn(&[T], f32, &mut [f32]),
    finish: impl Fn([f32; C]) -> T,
) -> Raster<T> {
    let (w, h) = (image.width(), image.height());
    let mut values = Vec::with_capacity(width * height);
    if w == 0 || h == 0 {
        values.resize(width * height, finish([0.0; C]));
        return Raster::from_vec(width, height, values).expect("one value a pixel was pushed");
    }
    let (columns, rows) = (footprints(w, width), footprints(h, height));
    let mut sums = vec![0.0f32; w * C];
    for row in &rows {
        sums.fill(0.0);
        for (i, &weight) in row.weights.iter().enumerate() {
            add_row(image.row(row.first + i), weight, &mut sums);
        }
        let pixels = sums.as_chunks::<C>().0;
        for column in &columns {
            let mut value = [0.0f32; C];
            for (pixel, &weight) in pixels[column.first..].iter().zip(&column.weights) {
                for c in 0..C {
                    value[c] += weight * pixel[c];
                }
            }
            values.push(finish(value));
        }
    }
    Raster::from_vec(width, height, values).expect("one value a pixel was pushed")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ramp(w: usize, h: usize) -> Raster<f32> {
        // Value of a plane at the pixel's centre.
        let values = (0..w * h).map(|i| (i % w) as f32 + 0.5 + 2.0 * ((i / w) as f32 + 0.5)).collect();
        Raster::from_vec(w, h, values).expect("one value a pixel")
    }

    #[test]
    fn a_plane_stays_a_plane_in_pixel_coordinates() {
        // 12x10 to 5x3: the mean over a footprint is the plane's value at its centre, which is the mapped centre of the new pixel.
        let (w, h, nw, nh) = (12, 10, 5, 3);
        let small = resize_area_grey(&ramp(w, h), nw, nh);
        for y in 0..nh {
            for x in 0..nw {
                let expected = (x as f32 + 0.5) * w as f32 / nw as f32 + 2.0 * (y as f32 + 0.5) * h as f32 / nh as f32;
                // Fractions at the rim weigh pixel centres, not the part covered: off by at most 1/4 of a grey value an axis here.
                assert!((small[(x, y)] - expected).abs() < 0.25 + 2.0 * 0.25, "{} {expected}", small[(x, y)]);
            }
        }
    }

    #[test]
    fn whole_factors_average_exactly() {
        let small = resize_area_grey(&ramp(8, 6), 4, 3);
        for y in 0..3 {
            for x in 0..4 {
                assert_eq!(small[(x, y)], 2.0 * x as f32 + 1.0 + 2.0 * (2.0 * y as f32 + 1.0));
            }
        }
    }

    #[test]
    fn growing_interpolates_between_centres() {
        let wide = resize_area_grey(&Raster::from_vec(2, 1, vec![0.0, 1.0]).expect("two values"), 4, 1);
        assert_eq!(wide.data(), [0.0, 0.25, 0.75, 1.0]);
        assert_eq!(resize_area_grey(&Raster::filled(1, 1, 0.5), 3, 2).data(), [0.5; 6]);
    }

    #[test]
    fn nearest_takes_the_pixel_of_the_centre() {
        let mask = Raster::from_vec(4, 1, vec![0u8, 255, 0, 255]).expect("four values");
        assert_eq!(resize_nearest(&mask, 2, 1).data(), [255, 255]);
        assert_eq!(resize_nearest(&mask, 8, 1).data(), [0, 0, 255, 255, 0, 0, 255, 255]);
        assert_eq!(resize_nearest(&Raster::filled(0, 0, 0u8), 3, 3).data().len(), 0);
    }

    proptest! {
        #[test]
        fn the_mean_is_kept_when_shrinking(w in 1usize..40, h in 1usize..40, fx in 0.05..1.0f64, fy in 0.05..1.0f64, seed in 0u32..1000) {
            let (nw, nh) = (((w as f64 * fx) as usize).max(1), ((h as f64 * fy) as usize).max(1));
            let values: Vec<f32> = (0..w * h).map(|i| ((i as u32 + seed).wrapping_mul(2_654_435_761) >> 24) as f32 / 255.0).collect();
            let mean = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / v.len() as f64;
            let image = Raster::from_vec(w, h, values).expect("one value a pixel");
            let small = resize_area_grey(&image, nw, nh);
            // Every input pixel is covered once in all: up to rounding of weights in f32.
            prop_assert!((mean(image.data()) - mean(small.data())).abs() < 1e-5);
        }

        #[test]
        fn a_constant_stays_constant(w in 1usize..30, h in 1usize..30, nw in 1usize..50, nh in 1usize..50, v in 0u8..=255) {
            let out = resize_area_rgb(&Raster::filled(w, h, [v, 255 - v, 7]), nw, nh);
            prop_assert!(out.data().iter().all(|&p| p == [v, 255 - v, 7]));
        }
    }
}
