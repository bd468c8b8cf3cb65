//! The image-processing route.

use crate::lowpass::STEPS;
use crate::{
    BitMask, CannyThresholds, Plane, canny, close, dilate, fill_holes, fill_holes_in, keep_components, otsu, reduced_channel,
    remove_specks, smooth,
};
use scene::{Mask, Raster};

/// Which side of Otsu's threshold is structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Polarity {
    /// Structure is darker than the water, as on a reef in daylight (Rofallski et al. 2020).
    Dark,
    /// Structure is brighter than the water, as in the light of a vehicle at depth.
    Bright,
    /// The side that is textured more; see [`ip_mask`].
    #[default]
    Auto,
}

/// Options of the image-processing route. Lengths and areas are relative to the image, so that one setting serves every camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IpOptions {
    /// Channel that separates structure from water: 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// The image is reduced by the smallest whole factor that brings its long side to at most this many pixels; 0 works at full size. Edges
    /// of the mask are then as coarse as the factor.
    pub working_long_side_px: usize,
    /// Standard deviation of the low pass, pixels of the working size; its square is rounded to a whole number.
    pub blur_sigma_px: f64,
    /// Canny's thresholds at the working size. The defaults lie just above what particles in water show, so as to keep faint sea floor at the rim of the light; a
    /// noisy camera needs higher ones.
    pub canny: CannyThresholds,
    /// Radius of the disc of the closing, as a share of the long side. Too large, it closes gaps in the structure; too small, it loses sea floor between edges.
    pub closing_radius: f64,
    /// Structure of less than this share of the image, with what it encloses, is removed: particles, fish.
    pub min_structure_area: f64,
    /// Holes of less than this share of the image are filled.
    pub min_hole_area: f64,
    /// The threshold in place of Otsu's, a grey value: that of a whole dive, from [`histogram`]s of its images.
    pub threshold: Option<u8>,
    /// Which side of Otsu's threshold is structure.
    pub polarity: Polarity,
    /// A connected part of either side of Otsu's threshold is structure altogether where at least this share of it is textured.
    pub min_textured_share: f64,
    /// The side that is structure is so up to this distance from texture, as a share of the long side.
    pub reach: f64,
    /// An image of which a smaller share than this is textured, or enclosed by edges, shows nothing but water (with particles in it).
    pub min_texture: f64,
}

impl Default for IpOptions {
    fn default() -> Self {
        Self {
            channel: 2,
            working_long_side_px: 1000,
            blur_sigma_px: 1.5,
            canny: CannyThresholds { low: 0.55, high: 1.1 },
            closing_radius: 0.012,
            min_structure_area: 0.004,
            min_hole_area: 0.002,
            threshold: None,
            polarity: Polarity::Auto,
            min_textured_share: 0.35,
            reach: 0.03,
            min_texture: 0.015,
        }
    }
}

/// A mask, and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct IpMask {
    /// 255 structure, 0 background; the size of the image.
    pub mask: Mask,
    /// Otsu's threshold of the blue channel: values up to it are dark. 0 for an image of one value.
    pub threshold: u8,
    /// The side that was taken for structure, dark or bright; `None` where the image is empty.
    pub side: Option<Polarity>,
    /// Whether the image shows nothing but water: the mask is all background.
    pub empty: bool,
    /// Share of edge pixels at the working size, 0..=1.
    pub edge_share: f64,
}

/// Masks an image by threshold and edges, after Rofallski et al. 2020, section 4.1 and figure 5.
///
/// The blue channel, in which water is bright or (unlit) evenly dark, is smoothed and split by Otsu's threshold; Canny's edges of the same channel find
/// structured sea floor on either side of it. Both are united and closed, specks and small holes go.
///
/// Otsu's threshold splits every image, water alone too, and says nothing about which side is structure. So edges are closed first, and small
/// patches of them dropped (particles): what remains is *texture*, structure in any case. Hardly any texture, no structure: the image is empty. A connected
/// part of either side of the threshold that is textured to a good share is structure altogether. Of the side that [`Polarity`] names, under
/// [`Polarity::Auto`] the one that is textured more, what lies within `reach` of texture, or is enclosed by structure, is structure too: the smooth part of a hull or a pillar, but
/// not all the water that is as dark or as bright.
///
/// An image without pixels gives an empty mask.
#[must_use]
pub fn ip_mask(rgb: &Raster<[u8; 3]>, options: &IpOptions) -> IpMask {
    let (width, height) = (rgb.width(), rgb.height());
    let (plane, factor) = working_plane(rgb, options);
    if plane.data().is_empty() {
        return IpMask { mask: Raster::filled(width, height, 0), threshold: 0, side: None, empty: true, edge_share: 0.0 };
    }
    let pixels = plane.data().len() as f64;
    let area = |share: f64| (share * pixels).max(0.0) as usize;
    let length = |share: f64| (share * plane.width().max(plane.height()) as f64).round().clamp(0.0, 1000.0) as usize;
    let radius = length(options.closing_radius);

    let edges = canny(&plane, &options.canny);
    let closed = close(&edges, radius);
    // By their area with what they enclose: the outline of a smooth body is thin.
    let bodies = remove_specks(&fill_holes(&closed, usize::MAX), area(options.min_structure_area));
    let texture = closed.and(&bodies);
    let split = options.threshold.or_else(|| otsu(&counts(&plane)).map(|s| s.threshold));
    let is_water = (bodies.count() as f64) < options.min_texture * pixels;
    let (mut structure, mut side) = (BitMask::new(plane.width(), plane.height()), None);
    if let Some(threshold) = split
        && !is_water
    {
        let dark = BitMask::from_test(plane.width(), plane.height(), plane.data(), |v| grey(v) <= usize::from(threshold));
        let bright = dark.not();
        let structured = structured_side(&dark, &bright, &texture, options.polarity);
        structure = with_sides(&texture, &dark, &bright, structured, length(options.reach), options.min_textured_share);
        structure = remove_specks(&close(&structure, radius), area(options.min_structure_area));
        structure = fill_holes(&structure, area(options.min_hole_area));
        structure = fill_holes_in(&structure, if structured == Polarity::Bright { &bright } else { &dark }, HOLE_IN_SIDE);
        side = Some(structured);
    }
    IpMask {
        empty: structure.count() == 0,
        mask: structure.to_mask(width, height, factor),
        threshold: split.unwrap_or(0),
        side,
        edge_share: edges.count() as f64 / pixels,
    }
}

/// A hole that lies in the side of structure to this share is the smooth middle of a body.
const HOLE_IN_SIDE: f64 = 0.9;
/// Largest reduction, which the integer sums allow.
const MAX_FACTOR: usize = 64;

/// The side of a threshold that is structure: the one asked for, or the one with the larger share of texture.
fn structured_side(dark: &BitMask, bright: &BitMask, texture: &BitMask, polarity: Polarity) -> Polarity {
    let textured = |side: &BitMask| texture.count_common(side) as f64 / side.count().max(1) as f64;
    match polarity {
        Polarity::Auto if textured(dark) >= textured(bright) => Polarity::Dark,
        Polarity::Auto => Polarity::Bright,
        given => given,
    }
}

/// Texture, and with it what the two sides of a threshold add.
fn with_sides(texture: &BitMask, dark: &BitMask, bright: &BitMask, side: Polarity, reach: usize, min_textured_share: f64) -> BitMask {
    let mut out = texture.clone();
    for part in [dark, bright] {
        out.or(&keep_components(part, texture, |area, textured| textured as f64 >= min_textured_share * area as f64));
    }
    out.or(&dilate(texture, reach).and(if side == Polarity::Bright { bright } else { dark }));
    out
}

/// The channel that is split, smoothed, and by how much it is reduced.
fn working_plane(rgb: &Raster<[u8; 3]>, options: &IpOptions) -> (Plane, usize) {
    let long_side = rgb.width().max(rgb.height());
    let factor = if options.working_long_side_px == 0 { 1 } else { long_side.div_ceil(options.working_long_side_px) };
    let factor = factor.clamp(1, MAX_FACTOR.min(rgb.width().min(rgb.height())).max(1));
    let passes = (options.blur_sigma_px * options.blur_sigma_px).round().clamp(0.0, 100.0) as usize;
    (smooth(&reduced_channel(rgb, options.channel.min(2), factor), passes), factor)
}

/// How often each grey value occurs in the smoothed channel that [`ip_mask`] splits. Those of all images of a dive, summed, give its threshold by [`otsu`].
#[must_use]
pub fn histogram(rgb: &Raster<[u8; 3]>, options: &IpOptions) -> [u64; 256] {
    counts(&working_plane(rgb, options).0)
}

fn counts(plane: &Plane) -> [u64; 256] {
    // Four interleaved counts: neighbouring pixels are mostly equal, and one counter would wait for itself.
    let mut counts = [[0u32; 256]; 4];
    for pixels in plane.data().chunks(4) {
        for (count, &v) in counts.iter_mut().zip(pixels) {
            count[grey(v)] += 1;
        }
    }
    std::array::from_fn(|v| counts.iter().map(|c| u64::from(c[v])).sum())
}

/// The nearest of 256 grey values.
fn grey(value: u16) -> usize {
    usize::from((value + STEPS / 2) / STEPS).min(255)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structure_share;

    const SIZE: (usize, usize) = (640, 400);

    /// A picture of given blue, with a little noise as of a camera (sigma about 1.2 grey values).
    fn picture(blue: impl Fn(f64, f64) -> f64) -> Raster<[u8; 3]> {
        let (w, h) = SIZE;
        let noise = |i: usize| {
            let bits = (i as u32).wrapping_mul(2_654_435_761).rotate_left(15).wrapping_mul(0x85EB_CA6B);
            f64::from((bits >> 8 & 0xFF) + (bits >> 16 & 0xFF) + (bits >> 24)) / 128.0 - 3.0
        };
        let pixels = (0..w * h)
            .map(|i| {
                let v = (blue((i % w) as f64 + 0.5, (i / w) as f64 + 0.5) + noise(i)).round().clamp(0.0, 255.0) as u8;
                [10, v / 2, v]
            })
            .collect();
        Raster::from_vec(w, h, pixels).expect("one value a pixel")
    }

    fn texture(x: f64, y: f64) -> f64 {
        18.0 * (x / 4.0).sin() * (y / 5.0).cos() + 12.0 * ((x + 2.0 * y) / 9.0).sin()
    }

    /// Vignetted water, brighter in the middle.
    fn water(x: f64, y: f64) -> f64 {
        110.0 - 0.0004 * ((x - 300.0).powi(2) + (y - 180.0).powi(2))
    }

    fn in_pillar(x: f64, y: f64) -> bool {
        (x - 300.0).abs() < 60.0 && y > 80.0
    }

    /// Shares of the structure that is kept, and of the water that is masked.
    fn recall_and_masked(mask: &Mask, structure: impl Fn(f64, f64) -> bool) -> (f64, f64) {
        let (mut kept, mut of_structure, mut masked, mut of_water) = (0, 0, 0, 0);
        for y in 0..mask.height() {
            for x in 0..mask.width() {
                if structure(x as f64 + 0.5, y as f64 + 0.5) {
                    of_structure += 1;
                    kept += usize::from(mask[(x, y)] == 255);
                } else {
                    of_water += 1;
                    masked += usize::from(mask[(x, y)] == 0);
                }
            }
        }
        (kept as f64 / of_structure as f64, masked as f64 / of_water as f64)
    }

    #[test]
    fn a_pillar_is_found_darker_or_brighter_than_the_water() {
        for (level, side) in [(50.0, Polarity::Dark), (190.0, Polarity::Bright)] {
            let rgb = picture(|x, y| if in_pillar(x, y) { level + texture(x, y) } else { water(x, y) });
            let found = ip_mask(&rgb, &IpOptions::default());
            let (recall, masked) = recall_and_masked(&found.mask, in_pillar);
            // The outline may move by the low pass and the closing: a few pixels on a perimeter of 760 against 38,400 and 217,600 pixels.
            assert!(recall > 0.995 && masked > 0.97, "level {level}: {recall} kept, {masked} of the water masked");
            assert_eq!((found.side, found.empty), (Some(side), false));
        }
    }

    #[test]
    fn a_smooth_body_is_kept_with_its_inside() {
        // No texture but the outline, and a middle farther from it than the reach.
        let rgb = picture(|x, y| if (x - 300.0).hypot(y - 200.0) < 40.0 { 40.0 } else { water(x, y) });
        let found = ip_mask(&rgb, &IpOptions::default());
        let (recall, masked) = recall_and_masked(&found.mask, |x, y| (x - 300.0).hypot(y - 200.0) < 40.0);
        assert!(recall > 0.99 && masked > 0.97, "{recall} {masked}");
    }

    #[test]
    fn sea_floor_that_otsu_splits_is_kept_whole() {
        // Textured everywhere, dark towards the corners: half of it lies on either side of the threshold.
        let rgb = picture(|x, y| water(x, y) + texture(x, y));
        let found = ip_mask(&rgb, &IpOptions::default());
        assert!(structure_share(&found.mask) > 0.999, "{}", structure_share(&found.mask));
    }

    #[test]
    fn water_is_empty_with_particles_or_without() {
        let particle = |x: f64, y: f64| (x % 97.0 - 40.0).hypot(y % 83.0 - 50.0) < 2.0;
        for rgb in [picture(water), picture(|x, y| water(x, y) + if particle(x, y) { 25.0 } else { 0.0 }), picture(|_, _| 60.0)] {
            let found = ip_mask(&rgb, &IpOptions::default());
            assert!(found.empty && structure_share(&found.mask) == 0.0, "{} of edges", found.edge_share);
            assert_eq!(found.side, None);
        }
    }

    #[test]
    fn polarity_adds_the_side_that_it_names() {
        // Smooth bodies, one dark and one bright, whose outlines alone are texture.
        let body = |x: f64, y: f64, cx: f64| (x - cx).hypot(y - 200.0) < 90.0;
        let rgb = picture(|x, y| {
            if body(x, y, 160.0) {
                30.0
            } else if body(x, y, 460.0) {
                190.0
            } else {
                110.0
            }
        });
        let share = |polarity, cx| {
            let options = IpOptions { polarity, min_hole_area: 0.0, ..IpOptions::default() };
            recall_and_masked(&ip_mask(&rgb, &options).mask, |x, y| body(x, y, cx)).0
        };
        // Of the other body only half the width of the outline remains: 2 pixels of 90 are 4 %.
        assert!(share(Polarity::Dark, 160.0) > 0.99 && share(Polarity::Dark, 460.0) < 0.05);
        assert!(share(Polarity::Bright, 460.0) > 0.99 && share(Polarity::Bright, 160.0) < 0.05);
    }

    #[test]
    fn the_working_size_changes_the_outline_by_its_factor_only() {
        let rgb = picture(|x, y| if in_pillar(x, y) { 50.0 + texture(x, y) } else { water(x, y) });
        let full = ip_mask(&rgb, &IpOptions { working_long_side_px: 0, ..IpOptions::default() });
        let half = ip_mask(&rgb, &IpOptions { working_long_side_px: 320, ..IpOptions::default() });
        assert_eq!((half.mask.width(), half.mask.height()), SIZE);
        let different = full.mask.data().iter().zip(half.mask.data()).filter(|(a, b)| a != b).count();
        // Two to four pixels along 760 pixels of outline, half of them on either side.
        assert!(different < 6 * 760, "{different}");
    }

    #[test]
    fn odd_and_empty_sizes_are_masked_as_well() {
        for (w, h) in [(0, 0), (0, 7), (1, 1), (1, 4000), (3001, 2), (1003, 777)] {
            let rgb = Raster::filled(w, h, [1, 2, 3]);
            let found = ip_mask(&rgb, &IpOptions::default());
            assert_eq!((found.mask.width(), found.mask.height(), found.empty), (w, h, true));
        }
    }

    #[test]
    fn absurd_options_do_not_panic() {
        let rgb = picture(|x, y| if in_pillar(x, y) { 50.0 + texture(x, y) } else { water(x, y) });
        for v in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
            let options = IpOptions {
                channel: 9,
                working_long_side_px: 3,
                blur_sigma_px: v.min(3.0),
                canny: CannyThresholds { low: v, high: v },
                closing_radius: v.min(0.5),
                min_structure_area: v,
                min_hole_area: v,
                threshold: Some(0),
                polarity: Polarity::Auto,
                min_textured_share: v,
                reach: v.min(0.5),
                min_texture: v,
            };
            assert_eq!(ip_mask(&rgb, &options).mask.data().len(), rgb.data().len());
        }
    }
}
