//! The motion between two images, coarsely, from the images alone.

use imaging::{gaussian_blur, resize_area_grey, resize_area_rgb};
use nalgebra::{SMatrix, SVector};
use scene::Raster;

/// From a place of one image to the place of the same thing in another: u = a x + b y + c, v = d x + e y + f, in long sides from the middle of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// a, b, c, d, e, f.
    pub terms: [f64; 6],
}

impl Affine {
    /// No motion.
    pub const IDENTITY: Self = Self { terms: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0] };

    pub(super) fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let [a, b, c, d, e, f] = self.terms;
        [a * x + b * y + c, d * x + e * y + f]
    }

    /// Where the middle of the first pixel of a row lies in the other image, both of `width` x `height` pixels, and how far the next ones are from there; pixels.
    pub(super) fn along_row(&self, y: usize, width: usize, height: usize) -> ([f64; 2], [f64; 2]) {
        let long = width.max(height) as f64;
        let middle = [width as f64 / 2.0, height as f64 / 2.0];
        let [u, v] = self.at((0.5 - middle[0]) / long, (y as f64 + 0.5 - middle[1]) / long);
        ([u * long + middle[0], v * long + middle[1]], [self.terms[0], self.terms[3]])
    }
}

/// What of an image is kept to find motions with: its luma at a long side of 160 pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Glimpse {
    luma: Raster<u8>,
}

/// Long side of a glimpse, pixels.
const LONG_SIDE: usize = 160;
/// Low pass that is taken off, pixels of a glimpse: what is left is detail, not the light of the lamps or the gradient of the water.
const SMOOTH: f32 = 6.0;
/// Detail counts up to this, grey values: neither a lamp nor a fish may decide.
const MOST: f32 = 25.0;
/// Largest shift that is looked for, as a share of width and height.
const REACH: f64 = 0.3;
/// Images of less correlation say nothing of their motion.
const MIN_CORRELATION: f64 = 0.5;
/// Steps of the refinement.
const STEPS: usize = 12;

impl Glimpse {
    /// Of an image.
    #[must_use]
    pub fn new(rgb: &Raster<[u8; 3]>) -> Self {
        let scale = LONG_SIDE as f64 / rgb.width().max(rgb.height()).max(1) as f64;
        let side = |length: usize| ((length as f64 * scale).round() as usize).max(1);
        let small = resize_area_rgb(rgb, side(rgb.width()), side(rgb.height()));
        Self { luma: imaging::grey_from_rgb(&small).map(|v| (v * 255.0).round() as u8) }
    }

    /// From what [`Glimpse::luma`] gave.
    #[must_use]
    pub fn from_luma(luma: Raster<u8>) -> Self {
        Self { luma }
    }

    /// A small grey image.
    #[must_use]
    pub fn luma(&self) -> &Raster<u8> {
        &self.luma
    }

    fn detail(&self) -> Raster<f32> {
        let luma = self.luma.map(|&v| f32::from(v));
        let mut detail = gaussian_blur(&luma, 0.8);
        let smooth = gaussian_blur(&luma, SMOOTH);
        detail.data_mut().iter_mut().zip(smooth.data()).for_each(|(d, s)| *d = (*d - s).clamp(-MOST, MOST));
        detail
    }
}

/// Where places of one image lie in another: a shift that is searched for at half the size, refined to an affine map by Gauss and Newton's method on the grey values (Lucas and Kanade, *An
/// iterative image registration technique with an application to stereo vision*, IJCAI 1981). `None` for images of different sizes and where the images do not resemble each other: the shift is too
/// large, or there is nothing but water.
#[must_use]
pub fn motion(from: &Glimpse, to: &Glimpse) -> Option<Affine> {
    let (width, height) = (from.luma.width(), from.luma.height());
    if (width, height) != (to.luma.width(), to.luma.height()) || width < 16 || height < 16 {
        return None;
    }
    let (a, b) = (from.detail(), to.detail());
    let halved = |image: &Raster<f32>| resize_area_grey(image, width / 2, height / 2);
    let [du, dv] = shift(&halved(&a), &halved(&b))?;
    let long = width.max(height) as f64;
    let mut best = Affine { terms: [1.0, 0.0, 2.0 * du as f64 / long, 0.0, 1.0, 2.0 * dv as f64 / long] };
    let mut most = correlation(&a, &b, &best);
    let mut tried = best;
    for _ in 0..STEPS {
        let Some(next) = refined(&a, &b, &tried) else { break };
        let found = correlation(&a, &b, &next);
        tried = next;
        if found > most {
            (best, most) = (next, found);
        }
    }
    (most >= MIN_CORRELATION).then_some(best)
}

/// The shift in whole pixels with the largest correlation over what overlaps.
fn shift(a: &Raster<f32>, b: &Raster<f32>) -> Option<[isize; 2]> {
    let (w, h) = (a.width() as isize, a.height() as isize);
    let (reach_x, reach_y) = ((REACH * w as f64) as isize, (REACH * h as f64) as isize);
    let mut best: Option<(f32, [isize; 2])> = None;
    for dv in -reach_y..=reach_y {
        for du in -reach_x..=reach_x {
            let (mut ab, mut aa, mut bb) = (0.0f32, 0.0f32, 0.0f32);
            for y in (-dv).max(0)..(h - dv).min(h) {
                let (from, to) = ((-du).max(0), (w - du).min(w));
                let row_a = &a.row(y as usize)[from as usize..to as usize];
                let row_b = &b.row((y + dv) as usize)[(from + du) as usize..(to + du) as usize];
                for (&p, &q) in row_a.iter().zip(row_b) {
                    ab += p * q;
                    aa += p * p;
                    bb += q * q;
                }
            }
            let found = ab / (aa * bb).sqrt().max(1e-6);
            if best.is_none_or(|(most, _)| found > most) {
                best = Some((found, [du, dv]));
            }
        }
    }
    best.map(|(_, shift)| shift)
}

/// Value and gradient between pixels; `None` outside.
fn sample(image: &Raster<f32>, u: f64, v: f64) -> Option<[f64; 3]> {
    let (x, y) = (u - 0.5, v - 0.5);
    if !(x >= 0.0 && y >= 0.0 && x < (image.width() - 1) as f64 && y < (image.height() - 1) as f64) {
        return None;
    }
    let (i, j) = (x as usize, y as usize);
    let (fx, fy) = (x - i as f64, y - j as f64);
    let at = |i: usize, j: usize| f64::from(image[(i, j)]);
    let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
    let (top, bottom) = (p + fx * (q - p), r + fx * (s - r));
    Some([top + fy * (bottom - top), (q - p) * (1.0 - fy) + (s - r) * fy, bottom - top])
}

/// Calls with the place (long sides from the middle), the value of the first image there, and value and gradient of the second.
fn over_common(a: &Raster<f32>, b: &Raster<f32>, map: &Affine, mut f: impl FnMut([f64; 2], f64, [f64; 3])) {
    let (width, height) = (a.width(), a.height());
    let long = width.max(height) as f64;
    for y in 0..height {
        let (start, step) = map.along_row(y, width, height);
        for (x, &value) in a.row(y).iter().enumerate() {
            if let Some(there) = sample(b, start[0] + step[0] * x as f64, start[1] + step[1] * x as f64) {
                let place = [(x as f64 + 0.5 - width as f64 / 2.0) / long, (y as f64 + 0.5 - height as f64 / 2.0) / long];
                f(place, f64::from(value), there);
            }
        }
    }
}

/// Correlation over what overlaps; 0 where that is less than a third of the image.
fn correlation(a: &Raster<f32>, b: &Raster<f32>, map: &Affine) -> f64 {
    let (mut ab, mut aa, mut bb, mut count) = (0.0, 0.0, 0.0, 0usize);
    over_common(a, b, map, |_, p, [q, ..]| {
        (ab, aa, bb, count) = (ab + p * q, aa + p * p, bb + q * q, count + 1);
    });
    // Less detail than half a grey value is noise.
    if 3 * count < a.data().len() || aa.min(bb) < 0.25 * count as f64 { 0.0 } else { ab / (aa * bb).sqrt() }
}

/// One step of Gauss and Newton's method, with the weights of Geman and McClure: what is occluded, moves by itself or lies far off the plane counts little.
fn refined(a: &Raster<f32>, b: &Raster<f32>, map: &Affine) -> Option<Affine> {
    const SCALE: f64 = 8.0;
    let long = a.width().max(a.height()) as f64;
    let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
    over_common(a, b, map, |[x, y], value, [there, gu, gv]| {
        let residual = value - there;
        let weight = (1.0 + (residual / SCALE).powi(2)).powi(-2);
        let (gu, gv) = (gu * long, gv * long);
        let row = SVector::<f64, 6>::from([gu * x, gu * y, gu, gv * x, gv * y, gv]);
        normal += weight * row * row.transpose();
        right += weight * residual * row;
    });
    let step = normal.cholesky()?.solve(&right);
    let terms: [f64; 6] = std::array::from_fn(|i| map.terms[i] + step[i]);
    terms.iter().all(|t| t.is_finite()).then_some(Affine { terms })
}
