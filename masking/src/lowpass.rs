//! One channel of an image at a working size, and its low pass. Integers of 16 bits throughout.

use scene::Raster;

/// Steps of a [`Plane`] in one grey value: four bits for what averaging adds to 8 bits.
pub const STEPS: u16 = 16;

/// Grey values times 16, at most 255 * 16 = 4080.
pub type Plane = Raster<u16>;

/// Channel `channel` (0 red, 1 green, 2 blue), each pixel the mean over a square of `factor` pixels; the rest at the right and lower border is left out.
///
/// # Panics
/// When `channel` is above 2, or `factor` not in 1..=64.
#[must_use]
pub fn reduced_channel(rgb: &Raster<[u8; 3]>, channel: usize, factor: usize) -> Plane {
    assert!(channel < 3 && (1..=64).contains(&factor), "channel {channel}, factor {factor}");
    let (w, h) = (rgb.width() / factor, rgb.height() / factor);
    let mut values = Vec::with_capacity(w * h);
    if factor == 1 {
        values.extend(rgb.data().iter().map(|p| u16::from(p[channel]) * STEPS));
    } else {
        // Sums of 64 x 64 bytes times 16 fit 32 bits; the division by the area is a multiplication that is exact in this range.
        let area = (factor * factor) as u32;
        let mut sums = vec![0u32; w];
        for y in 0..h {
            sums.fill(0);
            for row in y * factor..(y + 1) * factor {
                let row = &rgb.row(row)[..w * factor];
                match factor {
                    2 => add_groups::<2>(row, channel, &mut sums),
                    3 => add_groups::<3>(row, channel, &mut sums),
                    4 => add_groups::<4>(row, channel, &mut sums),
                    _ => {
                        for (sum, pixels) in sums.iter_mut().zip(row.chunks_exact(factor)) {
                            *sum += pixels.iter().map(|p| u32::from(p[channel])).sum::<u32>();
                        }
                    }
                }
            }
            values.extend(sums.iter().map(|&s| ((s * u32::from(STEPS) + area / 2) / area) as u16));
        }
    }
    Raster::from_vec(w, h, values).expect("one value a pixel was pushed")
}

fn add_groups<const F: usize>(row: &[[u8; 3]], channel: usize, sums: &mut [u32]) {
    for (sum, pixels) in sums.iter_mut().zip(row.as_chunks::<F>().0) {
        *sum += pixels.iter().map(|p| u32::from(p[channel])).sum::<u32>();
    }
}

/// Gaussian low pass of variance `passes` (sigma = sqrt(passes) pixels), as repeated binomial filters 1 4 6 4 1 in both directions; the
/// border is continued by its last pixel. Each direction of each pass rounds to a sixteenth of a grey value.
///
/// A binomial filter has exactly this variance and comes close to the Gaussian after two passes (its largest weight is 6 % smaller after one, 1.5 % after
/// four), and its weights sum to 16: everything stays within 16 bits.
#[must_use]
pub fn smooth(plane: &Plane, passes: usize) -> Plane {
    let (w, h) = (plane.width(), plane.height());
    let mut out = plane.clone();
    if w == 0 || h == 0 {
        return out;
    }
    let mut line = vec![0u16; w + 4];
    for _ in 0..passes {
        let source = out.clone();
        for y in 0..h {
            let at = |dy: isize| source.row(y.saturating_add_signed(dy).min(h - 1));
            let (a, b, c, d, e) = (at(-2), at(-1), at(0), at(1), at(2));
            for (x, value) in line[2..w + 2].iter_mut().enumerate() {
                *value = binomial(a[x], b[x], c[x], d[x], e[x]);
            }
            let (first, last) = (line[2], line[w + 1]);
            line[..2].fill(first);
            line[w + 2..].fill(last);
            for (value, p) in out.row_mut(y).iter_mut().zip(line.windows(5)) {
                *value = binomial(p[0], p[1], p[2], p[3], p[4]);
            }
        }
    }
    out
}

fn binomial(a: u16, b: u16, c: u16, d: u16, e: u16) -> u16 {
    // At most 16 * 4080 + 8 = 65,288.
    (a + e + 4 * (b + d) + 6 * c + 8) >> 4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(w: usize, h: usize) -> Raster<[u8; 3]> {
        let value = |i: usize, c: usize| ((i * 3 + c) as u32).wrapping_mul(2_654_435_761).to_be_bytes()[0];
        Raster::from_vec(w, h, (0..w * h).map(|i| [value(i, 0), value(i, 1), value(i, 2)]).collect()).expect("one value a pixel")
    }

    #[test]
    fn reduction_is_the_mean_over_squares() {
        let rgb = noise(23, 17);
        for factor in [1, 2, 3, 4, 5, 7] {
            let found = reduced_channel(&rgb, 2, factor);
            assert_eq!((found.width(), found.height()), (23 / factor, 17 / factor));
            for y in 0..found.height() {
                for x in 0..found.width() {
                    let square = (0..factor * factor).map(|i| f64::from(rgb[(x * factor + i % factor, y * factor + i / factor)][2]));
                    let mean = square.sum::<f64>() / (factor * factor) as f64;
                    assert!((f64::from(found[(x, y)]) / 16.0 - mean).abs() <= 0.5 / 16.0 + 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_line_spreads_like_a_gaussian() {
        let vertical: Plane =
            Raster::from_vec(41, 41, (0..41 * 41).map(|i| if i % 41 == 20 { 4080 } else { 0 }).collect()).expect("one value a pixel");
        let horizontal: Plane =
            Raster::from_vec(41, 41, (0..41 * 41).map(|i| if i / 41 == 20 { 4080 } else { 0 }).collect()).expect("one value a pixel");
        for passes in [1usize, 2, 4, 9] {
            let variance = passes as f64;
            let (vertical, horizontal) = (smooth(&vertical, passes), smooth(&horizontal, passes));
            for i in 0..41usize {
                let gaussian = (-0.5 * (i as f64 - 20.0).powi(2) / variance).exp() / (2.0 * std::f64::consts::PI * variance).sqrt();
                for found in [vertical[(i, 11)], horizontal[(30, i)]] {
                    // Binomial against normal distribution: 0.024 at one pass (0.375 for 0.399), falling with the power 3/2; rounding of each pass.
                    let tolerance = 0.025 / variance.powf(1.5) + 0.5 * variance / 4080.0;
                    assert!(
                        (f64::from(found) / 4080.0 - gaussian).abs() < tolerance,
                        "{passes} passes, {i}: {found} {}",
                        gaussian * 4080.0
                    );
                }
            }
        }
    }

    #[test]
    fn the_largest_value_does_not_overflow() {
        let white = reduced_channel(&Raster::filled(9, 9, [255; 3]), 1, 1);
        assert_eq!(smooth(&white, 3), white);
        assert_eq!(smooth(&white, 0), white);
        assert_eq!(smooth(&Raster::filled(0, 4, 0), 2).data().len(), 0);
    }
}
