//! The window of the reference image, prepared once for all planes that are tried at a pixel.

use crate::view::ACTIVE;
use scene::Raster;

/// Samples of a window, padded to whole groups of 8 lanes: 6 x 6 with a distance of 2 pixels, and the centre.
pub(crate) const SAMPLES: usize = 40;
const USED: usize = 37;
/// Half width of the window, pixels.
pub(crate) const RADIUS: i32 = 5;

/// Offsets of the samples along x, pixels.
pub(crate) const DX: [f32; SAMPLES] = offsets(true);
/// Offsets of the samples along y, pixels.
pub(crate) const DY: [f32; SAMPLES] = offsets(false);

const fn offsets(along_x: bool) -> [f32; SAMPLES] {
    let mut out = [0.0; SAMPLES];
    let mut k = 0;
    while k < 36 {
        out[k] = (2 * if along_x { k % 6 } else { k / 6 }) as f32 - RADIUS as f32;
        k += 1;
    }
    out
}

/// Bilateral weights: nearness in the image times nearness in intensity.
///
/// As in Schoenberger et al. 2016: they let a window at a depth edge follow the surface of its centre.
pub(crate) struct PatchWeights {
    spatial: [f32; SAMPLES],
    /// By difference of intensity, grey levels.
    colour: [f32; 256],
    /// Added to variances: noise of the image, squared, in units of [`super::GreyView`].
    pub noise_variance: f32,
}

impl PatchWeights {
    /// Deviations in grey levels of 0..=255 and in pixels.
    pub fn new(colour_sigma: f32, spatial_sigma_px: f32, noise: f32) -> Self {
        let mut spatial = [0.0; SAMPLES];
        for k in 0..USED {
            spatial[k] = (-(DX[k] * DX[k] + DY[k] * DY[k]) / (2.0 * spatial_sigma_px * spatial_sigma_px)).exp();
        }
        let colour = std::array::from_fn(|d| (-((d * d) as f32) / (2.0 * colour_sigma * colour_sigma)).exp());
        Self { spatial, colour, noise_variance: (noise * 256.0) * (noise * 256.0) }
    }
}

/// The weighted window around a pixel of the reference.
pub(crate) struct Patch {
    /// Weights, their sum is 1.
    pub weight: [f32; SAMPLES],
    /// Weight times (intensity minus mean).
    pub weighted_value: [f32; SAMPLES],
    /// Weighted mean of the intensity.
    pub mean: f32,
    /// Weighted variance of the intensity.
    pub variance: f32,
}

impl Patch {
    /// `None` where the pixel is invalid or the window shows less contrast than the noise.
    #[inline]
    pub fn new(grey: &Raster<u16>, valid: &Raster<u8>, x: usize, y: usize, weights: &PatchWeights) -> Option<Self> {
        if valid[(x, y)] & ACTIVE == 0 {
            return None;
        }
        let (w, h) = (grey.width() as i32, grey.height() as i32);
        let centre = grey[(x, y)];
        let (mut weight, mut value) = ([0.0f32; SAMPLES], [0.0f32; SAMPLES]);
        let mut sample = |k: usize, sx: i32, sy: i32| {
            if sx < 0 || sy < 0 || sx >= w || sy >= h {
                return;
            }
            let at = (sx as usize, sy as usize);
            let v = grey[at];
            weight[k] = weights.spatial[k] * weights.colour[usize::from(v.abs_diff(centre) >> 8)] * f32::from(valid[at] & ACTIVE);
            value[k] = f32::from(v);
        };
        for j in 0..6 {
            for i in 0..6 {
                sample(6 * j + i, x as i32 + 2 * i as i32 - RADIUS, y as i32 + 2 * j as i32 - RADIUS);
            }
        }
        sample(USED - 1, x as i32, y as i32);
        let sum = lanes_sum(&weight);
        let scale = 1.0 / sum;
        let mut product = [0.0f32; SAMPLES];
        for k in 0..SAMPLES {
            weight[k] *= scale;
            product[k] = weight[k] * value[k];
        }
        let mean = lanes_sum(&product);
        let mut weighted_value = [0.0f32; SAMPLES];
        for k in 0..SAMPLES {
            let centred = value[k] - mean;
            weighted_value[k] = weight[k] * centred;
            product[k] = weighted_value[k] * centred;
        }
        let variance = lanes_sum(&product);
        (variance > weights.noise_variance).then_some(Self { weight, weighted_value, mean, variance })
    }
}

/// Sum in a fixed order: 8 lanes, then pairs of lanes.
#[inline(always)]
fn lanes_sum(values: &[f32; SAMPLES]) -> f32 {
    let mut lanes = [0.0f32; 8];
    for chunk in values.as_chunks::<8>().0 {
        for l in 0..8 {
            lanes[l] += chunk[l];
        }
    }
    reduce(lanes)
}

/// Sum of 8 lanes in a fixed order.
#[inline(always)]
pub(crate) fn reduce(l: [f32; 8]) -> f32 {
    ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]))
}
