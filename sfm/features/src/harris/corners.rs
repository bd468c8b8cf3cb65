//! Corners.

use super::patch::{MARGIN_PX, describe};
use crate::FeatureError;
use imaging::gaussian_blur;
use scene::{Features, Keypoint, Mask, Raster};

/// Side of the cells that corners are spread over, in corners a cell.
const PER_CELL: usize = 24;

/// Options of [`extract_harris`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarrisOptions {
    /// Most corners an image.
    pub max_features: usize,
    /// Standard deviation of the low pass before the derivatives, pixels.
    pub derivative_sigma_px: f32,
    /// Standard deviation of the window that gradients are gathered over, pixels.
    pub window_sigma_px: f32,
    /// k of the response det - k trace^2.
    pub k: f32,
    /// Weakest corner, as a share of the strongest one's response.
    pub min_share: f32,
}

impl Default for HarrisOptions {
    fn default() -> Self {
        Self { max_features: 8192, derivative_sigma_px: 1.0, window_sigma_px: 2.5, k: 0.04, min_share: 1e-5 }
    }
}

impl HarrisOptions {
    fn check(&self) -> Result<(), FeatureError> {
        let positive = |option, value: f32| {
            let possible = value > 0.0 && value < 100.0;
            if possible {
                Ok(())
            } else {
                Err(FeatureError::Option { option, value: value.to_string(), expected: "above 0 and below 100" })
            }
        };
        positive("derivative_sigma_px", self.derivative_sigma_px)?;
        positive("window_sigma_px", self.window_sigma_px)?;
        positive("k", self.k)
    }
}

/// Finds corners in a grey image (0..=1), the strongest first, and describes each by the grey values about it.
///
/// Response det(M) - k trace(M)^2 of the gradients' second moments M (Harris & Stephens, *A combined corner and edge detector*, Alvey Vision
/// Conference 1988), maxima over 3 x 3 pixels, refined by a parabola in each direction. Positions are in pixels with the centre of the
/// top-left pixel at (0.5, 0.5). Corners on pixels where the mask is 0, or too near to the border for their description, are dropped. Runs on
/// one thread.
///
/// # Errors
/// [`FeatureError::MaskSize`] and [`FeatureError::Option`].
pub fn extract_harris(grey: &Raster<f32>, mask: Option<&Mask>, options: &HarrisOptions) -> Result<Features, FeatureError> {
    options.check()?;
    let (width, height) = (grey.width(), grey.height());
    if let Some(mask) = mask.filter(|m| (m.width(), m.height()) != (width, height)) {
        return Err(FeatureError::MaskSize { width, height, mask_width: mask.width(), mask_height: mask.height() });
    }
    if width < 2 * MARGIN_PX + 3 || height < 2 * MARGIN_PX + 3 {
        return Ok(Features::default());
    }
    let smooth = gaussian_blur(grey, options.derivative_sigma_px);
    let response = response(&smooth, options);
    let found = maxima(&response, mask, options);
    let kept = spread(found, (width, height), options.max_features);
    // Where a corner lies is known to about half of the derivatives' window.
    let scale = (options.derivative_sigma_px.powi(2) + 0.25).sqrt() * 1.2;
    let mut features = Features::default();
    for corner in kept {
        if let Some(descriptor) = describe(&smooth, corner.x, corner.y) {
            features.keypoints.push(Keypoint { x: corner.x + 0.5, y: corner.y + 0.5, scale, orientation: 0.0 });
            features.descriptors.push(descriptor);
        }
    }
    Ok(features)
}

/// A corner; the centre of the top-left pixel at (0, 0).
#[derive(Clone, Copy)]
struct Corner {
    x: f32,
    y: f32,
    response: f32,
}

fn response(smooth: &Raster<f32>, options: &HarrisOptions) -> Raster<f32> {
    let (width, height) = (smooth.width(), smooth.height());
    let mut products = [(); 3].map(|()| Raster::filled(width, height, 0.0f32));
    for y in 1..height - 1 {
        let (above, here, below) = (smooth.row(y - 1), smooth.row(y), smooth.row(y + 1));
        for x in 1..width - 1 {
            let (gx, gy) = ((here[x + 1] - here[x - 1]) / 2.0, (below[x] - above[x]) / 2.0);
            for (product, value) in products.iter_mut().zip([gx * gx, gx * gy, gy * gy]) {
                product.row_mut(y)[x] = value;
            }
        }
    }
    let [xx, xy, yy] = products.map(|p| gaussian_blur(&p, options.window_sigma_px));
    let of = xx.data().iter().zip(xy.data()).zip(yy.data()).map(|((&a, &b), &c)| a * c - b * b - options.k * (a + c) * (a + c));
    Raster::from_vec(width, height, of.collect()).expect("one value a pixel")
}

fn maxima(response: &Raster<f32>, mask: Option<&Mask>, options: &HarrisOptions) -> Vec<Corner> {
    let strongest = response.data().iter().copied().fold(0.0f32, f32::max);
    let least = strongest * options.min_share;
    let mut found = Vec::new();
    for y in MARGIN_PX..response.height() - MARGIN_PX {
        let rows = [response.row(y - 1), response.row(y), response.row(y + 1)];
        for x in MARGIN_PX..response.width() - MARGIN_PX {
            let v = rows[1][x];
            // Of equal neighbours the first one counts.
            let first = rows[0][x - 1..=x + 1].iter().chain(&rows[1][x - 1..x]).all(|n| v > *n);
            let last = rows[1][x + 1..x + 2].iter().chain(&rows[2][x - 1..=x + 1]).all(|n| v >= *n);
            let shown = mask.is_none_or(|m| m.row(y)[x] > 0);
            if v > least && first && last && shown {
                let peak = |before: f32, after: f32| {
                    let bend = before - 2.0 * v + after;
                    if bend < 0.0 { ((before - after) / (2.0 * bend)).clamp(-0.5, 0.5) } else { 0.0 }
                };
                let (dx, dy) = (peak(rows[1][x - 1], rows[1][x + 1]), peak(rows[0][x], rows[2][x]));
                found.push(Corner { x: x as f32 + dx, y: y as f32 + dy, response: v });
            }
        }
    }
    found.sort_by(|a, b| b.response.total_cmp(&a.response));
    found
}

/// Of too many corners, those first whose cell has the fewest stronger ones: no region monopolises.
fn spread(found: Vec<Corner>, (width, height): (usize, usize), most: usize) -> Vec<Corner> {
    if found.len() <= most {
        return found;
    }
    let side = ((width * height * PER_CELL) as f32 / most.max(1) as f32).sqrt().max(1.0);
    let columns = (width as f32 / side).ceil() as usize + 1;
    let mut counts = vec![0u32; columns * ((height as f32 / side).ceil() as usize + 1)];
    let mut ranked: Vec<(u32, Corner)> = found
        .into_iter()
        .map(|corner| {
            let count = &mut counts[(corner.y / side) as usize * columns + (corner.x / side) as usize];
            *count += 1;
            (*count, corner)
        })
        .collect();
    ranked.sort_by_key(|&(rank, _)| rank);
    ranked.truncate(most);
    ranked.into_iter().map(|(_, corner)| corner).collect()
}
