//! Canny's edge detector on a working plane.

use crate::lowpass::STEPS;
use crate::{BitMask, Plane, keep_components};

/// Hysteresis thresholds, grey values of 0..=255 per pixel of the plane along the gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CannyThresholds {
    /// An edge goes on while the gradient is above this one.
    pub low: f64,
    /// An edge has at least one pixel above this one.
    pub high: f64,
}

/// Sum of Sobel's weights on one side, times the steps of a grey value: response to a ramp of one grey value a pixel.
const UNIT: f64 = 8.0 * STEPS as f64;

/// Edges of an image that has been smoothed already (see [`crate::smooth`]).
///
/// Canny, *A computational approach to edge detection*, PAMI 1986: gradient by Sobel's operator, thinned to its ridges along four directions,
/// then hysteresis over 8-connected edges. The length of a gradient is taken as the larger component + 3/8 of the smaller one: off by -2.8 % to +6.8 %.
/// The border is continued by its last pixel; an edge never lies beyond it.
#[must_use]
pub fn canny(plane: &Plane, thresholds: &CannyThresholds) -> BitMask {
    let (w, h) = (plane.width(), plane.height());
    let (mut weak, mut strong) = (BitMask::new(w, h), BitMask::new(w, h));
    if w == 0 || h == 0 {
        return weak;
    }
    let steps = |threshold: f64| (threshold * UNIT).clamp(0.0, f64::from(u16::MAX)) as u16;
    let (low, high) = (steps(thresholds.low.min(thresholds.high)), steps(thresholds.high));
    // Three rows of gradients roll over the image and stay in the cache.
    let mut lines: [Line; 3] = std::array::from_fn(|_| Line::new(w));
    lines[2].differentiate(plane, 0);
    for y in 0..h {
        lines.rotate_left(1);
        if y + 1 < h {
            lines[2].differentiate(plane, y + 1)
        } else {
            lines[2].lengths.fill(0)
        }
        let [above, here, below] = &lines;
        for (i, lengths) in here.lengths[1..=w].chunks(64).enumerate() {
            let (mut weak_bits, mut strong_bits) = (0u64, 0u64);
            for (bit, &m) in lengths.iter().enumerate() {
                if m > low && is_ridge(above, here, below, 64 * i + bit) {
                    weak_bits |= 1 << bit;
                    strong_bits |= u64::from(m > high) << bit;
                }
            }
            weak.row_mut(y)[i] = weak_bits;
            strong.row_mut(y)[i] = strong_bits;
        }
    }
    keep_components(&weak, &strong, |_, strong| strong > 0)
}

/// Sobel gradients of one row, in 1/128 grey value per pixel.
struct Line {
    gx: Vec<i16>,
    gy: Vec<i16>,
    /// Their lengths, with a zero before the first and after the last pixel.
    lengths: Vec<u16>,
    /// Vertical sums 1 2 1 and differences, with the border continued by a pixel.
    sums: Vec<i16>,
    differences: Vec<i16>,
}

impl Line {
    fn new(w: usize) -> Self {
        Self { gx: vec![0; w], gy: vec![0; w], lengths: vec![0; w + 2], sums: vec![0; w + 2], differences: vec![0; w + 2] }
    }

    /// Takes the gradients of row `y`.
    fn differentiate(&mut self, plane: &Plane, y: usize) {
        let (w, h) = (plane.width(), plane.height());
        let (above, here, below) = (plane.row(y.saturating_sub(1)), plane.row(y), plane.row((y + 1).min(h - 1)));
        // Values up to 4080: sums up to 16,320 fit 16 bits with a sign.
        for (((s, &a), &c), &b) in self.sums[1..=w].iter_mut().zip(above).zip(here).zip(below) {
            *s = (a + 2 * c + b) as i16;
        }
        for ((d, &a), &b) in self.differences[1..=w].iter_mut().zip(above).zip(below) {
            *d = b as i16 - a as i16;
        }
        for line in [&mut self.sums, &mut self.differences] {
            (line[0], line[w + 1]) = (line[1], line[w]);
        }
        for (gx, s) in self.gx.iter_mut().zip(self.sums.windows(3)) {
            *gx = s[2] - s[0];
        }
        for (gy, d) in self.gy.iter_mut().zip(self.differences.windows(3)) {
            *gy = d[0] + 2 * d[1] + d[2];
        }
        for ((m, gx), gy) in self.lengths[1..=w].iter_mut().zip(&self.gx).zip(&self.gy) {
            let (gx, gy) = (gx.unsigned_abs(), gy.unsigned_abs());
            *m = gx.max(gy) + 3 * gx.min(gy) / 8;
        }
    }
}

/// Whether the gradient at column `x` of the middle row is not shorter than its neighbours along its direction. Of two equal neighbours the later one wins.
fn is_ridge(above: &Line, here: &Line, below: &Line, x: usize) -> bool {
    let (gx, gy) = (i32::from(here.gx[x]), i32::from(here.gy[x]));
    // Column x is entry x + 1 of the lengths. tan 22.5 deg = 0.41421 = 13,573 / 32,768.
    let (before, after) = if gy.abs() * 32_768 < gx.abs() * 13_573 {
        (here.lengths[x], here.lengths[x + 2])
    } else if gx.abs() * 32_768 < gy.abs() * 13_573 {
        (above.lengths[x + 1], below.lengths[x + 1])
    } else if (gx < 0) == (gy < 0) {
        (above.lengths[x], below.lengths[x + 2])
    } else {
        (above.lengths[x + 2], below.lengths[x])
    };
    let length = here.lengths[x + 1];
    length >= before && length > after
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Raster;

    fn plane(w: usize, h: usize, value: impl Fn(f64, f64) -> f64) -> Plane {
        let values = (0..w * h).map(|i| (value((i % w) as f64 + 0.5, (i / w) as f64 + 0.5) * 16.0).round() as u16).collect();
        Raster::from_vec(w, h, values).expect("one value a pixel")
    }

    /// Gradient lengths from the definition, in floating point.
    fn gradient(plane: &Plane, x: usize, y: usize) -> f64 {
        let (w, h) = (plane.width() as i64, plane.height() as i64);
        let at = |dx: i64, dy: i64| {
            f64::from(plane[((x as i64 + dx).clamp(0, w - 1) as usize, (y as i64 + dy).clamp(0, h - 1) as usize)]) / 16.0
        };
        let gx = (at(1, -1) + 2.0 * at(1, 0) + at(1, 1) - at(-1, -1) - 2.0 * at(-1, 0) - at(-1, 1)) / 8.0;
        let gy = (at(-1, 1) + 2.0 * at(0, 1) + at(1, 1) - at(-1, -1) - 2.0 * at(0, -1) - at(1, -1)) / 8.0;
        gx.hypot(gy)
    }

    #[test]
    fn gradient_lengths_are_near_the_euclidean_ones() {
        let plane = plane(40, 30, |x, y| 120.0 + 60.0 * (x / 3.0).sin() * (y / 4.0).cos());
        let mut line = Line::new(40);
        for y in 0..30 {
            line.differentiate(&plane, y);
            for x in 0..40 {
                let (found, expected) = (f64::from(line.lengths[x + 1]) / UNIT, gradient(&plane, x, y));
                // The larger + 3/8 of the smaller: 0.972 at 45 deg, 1.068 at 20.6 deg; one step for the division.
                assert!(found >= expected * 0.972 - 1.0 / UNIT && found <= expected * 1.069 + 1.0 / UNIT, "{found} {expected}");
            }
        }
    }

    #[test]
    fn a_soft_disc_has_one_thin_closed_edge() {
        let (cx, cy, radius) = (50.0, 40.0, 20.0);
        let plane = plane(100, 80, |x, y| 60.0 + 80.0 / (1.0 + ((f64::hypot(x - cx, y - cy) - radius) / 1.0).exp()));
        let edges = canny(&plane, &CannyThresholds { low: 4.0, high: 10.0 });
        let mut on_circle = [false; 72];
        for y in 0..80 {
            for x in 0..100 {
                if edges.get(x, y) {
                    let (dx, dy) = (x as f64 + 0.5 - cx, y as f64 + 0.5 - cy);
                    assert!((dx.hypot(dy) - radius).abs() < 1.0, "an edge at {x} {y}");
                    on_circle[((dy.atan2(dx).to_degrees() + 360.0) / 5.0) as usize % 72] = true;
                }
            }
        }
        assert!(on_circle.iter().all(|&c| c), "no gap");
        // Eight-connected circles have 4 sqrt(2) r = 113 pixels; thick ones would have twice as many.
        assert!((100..150).contains(&edges.count()), "{}", edges.count());
    }

    #[test]
    fn hysteresis_follows_weak_edges_from_strong_ones_only() {
        // Two vertical steps: one that weakens downwards but starts strong, one that is weak throughout.
        let step = |x: f64, at: f64, height: f64| height / (1.0 + (-(x - at) / 0.8).exp());
        let plane = plane(80, 60, |x, y| 20.0 + step(x, 20.0, 90.0 - y) + step(x, 60.0, 30.0));
        let edges = canny(&plane, &CannyThresholds { low: 4.0, high: 15.0 });
        assert!((0..60).all(|y| (18..22).any(|x| edges.get(x, y))), "the strong edge to its weak end");
        assert!((0..60).all(|y| (50..70).all(|x| !edges.get(x, y))), "nothing of the weak one");
        let all = canny(&plane, &CannyThresholds { low: 4.0, high: 4.0 });
        assert!((0..60).all(|y| (58..62).any(|x| all.get(x, y))));
    }

    #[test]
    fn flat_and_empty_planes_have_no_edges() {
        let thresholds = CannyThresholds { low: 0.5, high: 1.0 };
        assert_eq!(canny(&Raster::filled(30, 20, 4080), &thresholds).count(), 0);
        assert_eq!(canny(&Raster::filled(0, 0, 0), &thresholds).count(), 0);
        assert_eq!(canny(&Raster::filled(1, 1, 9), &thresholds).count(), 0);
    }
}
