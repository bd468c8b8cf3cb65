//! Views, and their distortion-free counterparts in which planes induce exact homographies.

use crate::rays::FAR_M;
use crate::{DenseError, RayOffsets};
use nalgebra::{Vector2, Vector3};
use scene::{Camera, CameraModel, ImageId, Mask, Raster, Rigid3};
use std::sync::Arc;

/// Field of view that a distortion-free raster may reach: tan of the half angle, 60 degrees.
const MAX_TANGENT: f64 = 1.732;
/// A distortion-free raster may be longer than its view by this factor.
const MAX_GROWTH: f64 = 1.5;

/// An oriented image at working resolution.
#[derive(Clone, Debug)]
pub struct View {
    /// The image.
    pub image: ImageId,
    /// Its camera, resized to `rgb`.
    pub camera: Camera,
    /// Its pose.
    pub cam_from_world: Rigid3,
    /// sRGB colours.
    pub rgb: Raster<[u8; 3]>,
    /// Which pixels take part (255), same size as `rgb`; `None`: all.
    pub mask: Option<Mask>,
}

impl View {
    /// Checks that camera, colours and mask have one size.
    ///
    /// # Errors
    /// [`DenseError::SizeMismatch`].
    pub fn validate(&self) -> Result<(), DenseError> {
        let expected = (self.camera.width() as usize, self.camera.height() as usize);
        let check = |what, found| {
            if found == expected { Ok(()) } else { Err(DenseError::SizeMismatch { image: self.image, what, expected, found }) }
        };
        check("colour raster", (self.rgb.width(), self.rgb.height()))?;
        self.mask.as_ref().map_or(Ok(()), |m| check("mask", (m.width(), m.height())))
    }
}

/// The pixel takes part.
pub(crate) const ACTIVE: u8 = 1;
/// The pixel shows something, masked or not.
pub(crate) const INSIDE: u8 = 2;

/// A view without distortion.
#[derive(Clone, Debug)]
pub(crate) struct Rectified {
    /// Always [`CameraModel::Pinhole`].
    pub camera: Camera,
    pub rgb: Raster<[u8; 3]>,
    /// 65,280 times the luma in 0..=1.
    pub grey: Raster<u16>,
    /// [`INSIDE`] where the pixel is in the image, and [`ACTIVE`] where it is not masked either.
    pub valid: Raster<u8>,
    /// Behind a port, where the rays of the pixels pass.
    pub offsets: Option<Arc<RayOffsets>>,
}

/// Resamples a view to a pinhole camera of the same focal length, large enough for the whole field of view within
/// [`MAX_GROWTH`] and [`MAX_TANGENT`]. A view that already is a pinhole is only copied. Behind a port the raster is that of directions in the
/// water, and [`RayOffsets`] tell where the rays pass.
pub(crate) fn rectify(view: &View) -> Result<Rectified, DenseError> {
    view.validate()?;
    if view.camera.model() == CameraModel::Pinhole && view.camera.port().is_none() {
        let valid = view.mask.as_ref().map_or_else(
            || Raster::filled(view.rgb.width(), view.rgb.height(), INSIDE | ACTIVE),
            |mask| mask.map(|&m| if m >= 128 { INSIDE | ACTIVE } else { INSIDE }),
        );
        return Ok(Rectified { camera: view.camera, grey: view.rgb.map(|&c| luma(c)), rgb: view.rgb.clone(), valid, offsets: None });
    }
    let seen_by = view.camera.with_object_distance(FAR_M);
    let camera = pinhole_for(&seen_by).map_err(|source| DenseError::Rectification { image: view.image, source })?;
    let (w, h) = (camera.width() as usize, camera.height() as usize);
    let mut out = Rectified {
        camera,
        rgb: Raster::filled(w, h, [0; 3]),
        grey: Raster::filled(w, h, 0),
        valid: Raster::filled(w, h, 0),
        offsets: None,
    };
    out.offsets = RayOffsets::new(&seen_by, &camera).map(Arc::new);
    let &[fx, fy, cx, cy] = camera.params() else { return Ok(out) };
    for y in 0..h {
        for x in 0..w {
            let direction = Vector3::new((x as f64 + 0.5 - cx) / fx, (y as f64 + 0.5 - cy) / fy, 1.0);
            let Some(pixel) = seen_by.project_direction(&direction) else { continue };
            let Some((colour, grey)) = bilinear(&view.rgb, &pixel) else { continue };
            out.rgb[(x, y)] = colour;
            out.grey[(x, y)] = grey;
            let masked = view.mask.as_ref().is_some_and(|m| m.at_point(pixel.x, pixel.y).is_none_or(|&v| v < 128));
            out.valid[(x, y)] = if masked { INSIDE } else { INSIDE | ACTIVE };
        }
    }
    Ok(out)
}

/// The pinhole camera that covers the field of view of `camera` at its focal length.
fn pinhole_for(camera: &Camera) -> Result<Camera, scene::CameraError> {
    let (w, h) = (f64::from(camera.width()), f64::from(camera.height()));
    let focal = camera.mean_focal();
    let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    const STEPS: usize = 32;
    for i in 0..=STEPS {
        let t = i as f64 / STEPS as f64;
        for pixel in [[t * w, 0.0], [t * w, h], [0.0, t * h], [w, t * h]] {
            if let Some(uv) = camera.unproject(&Vector2::from(pixel)) {
                low = low.inf(&uv);
                high = high.sup(&uv);
            }
        }
    }
    // Nothing on the border has an inverse: take the field of view that a pinhole would have.
    if low.x >= high.x || low.y >= high.y {
        let [cx, cy] = camera.principal_point();
        (low, high) = (Vector2::new(-cx / focal, -cy / focal), Vector2::new((w - cx) / focal, (h - cy) / focal));
    }
    let side = |low: f64, high: f64, size: f64| {
        let (low, high) = (low.max(-MAX_TANGENT), high.min(MAX_TANGENT));
        let pixels = ((high - low) * focal).round().clamp(1.0, (MAX_GROWTH * size).round());
        // Centred on the field of view where that is cut.
        (pixels, pixels / 2.0 - focal * (low + high) / 2.0)
    };
    let (width, cx) = side(low.x, high.x, w);
    let (height, cy) = side(low.y, high.y, h);
    Camera::new(CameraModel::Pinhole, width as u32, height as u32, &[focal, focal, cx, cy])
}

/// 65,280 times the luma (weights of BT.601 in 256ths).
fn luma([r, g, b]: [u8; 3]) -> u16 {
    77 * u16::from(r) + 150 * u16::from(g) + 29 * u16::from(b)
}

/// Colour and [`luma`] at a point, linear between pixel centres; `None` outside of the image.
fn bilinear(rgb: &Raster<[u8; 3]>, pixel: &Vector2<f64>) -> Option<([u8; 3], u16)> {
    let (w, h) = (rgb.width(), rgb.height());
    if !(pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= w as f64 && pixel.y <= h as f64) {
        return None;
    }
    let (x, y) = ((pixel.x - 0.5).clamp(0.0, (w - 1) as f64), (pixel.y - 0.5).clamp(0.0, (h - 1) as f64));
    let (x0, y0) = (x as usize, y as usize);
    let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
    let (fx, fy) = ((x - x0 as f64) as f32, (y - y0 as f64) as f32);
    let corners = [rgb[(x0, y0)], rgb[(x1, y0)], rgb[(x0, y1)], rgb[(x1, y1)]];
    let weights = [(1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy];
    let mix = |value: &dyn Fn([u8; 3]) -> f32| corners.iter().zip(weights).map(|(&c, w)| w * value(c)).sum::<f32>();
    let colour = [0, 1, 2].map(|i| (mix(&|c| f32::from(c[i])) + 0.5) as u8);
    Some((colour, (mix(&|c| f32::from(luma(c))) + 0.5) as u16))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(camera: Camera) -> View {
        let (w, h) = (camera.width() as usize, camera.height() as usize);
        // Colours are smooth functions of the normalised coordinates, which rectification must keep.
        let mut rgb = Raster::filled(w, h, [0; 3]);
        for y in 0..h {
            for x in 0..w {
                let uv = camera.unproject(&Vector2::new(x as f64 + 0.5, y as f64 + 0.5)).expect("invertible");
                rgb[(x, y)] = [(128.0 + 100.0 * uv.x) as u8, (128.0 + 100.0 * uv.y) as u8, 7];
            }
        }
        View { image: ImageId(0), camera, cam_from_world: Rigid3::identity(), rgb, mask: None }
    }

    #[test]
    fn rectified_colours_stand_at_their_direction() {
        for (model, params) in [
            (CameraModel::OpenCv, &[300.0, 310.0, 160.0, 110.0, 0.2, 0.3, 0.002, -0.001][..]),
            (CameraModel::SimpleRadial, &[300.0, 160.0, 110.0, -0.15][..]),
            (CameraModel::Fisheye, &[200.0, 200.0, 160.0, 110.0, 0.01, 0.0, 0.0, 0.0][..]),
        ] {
            let rectified = rectify(&view(Camera::new(model, 320, 220, params).expect("valid"))).expect("possible");
            let (w, h) = (rectified.camera.width() as usize, rectified.camera.height() as usize);
            let mut inside = 0;
            for y in 0..h {
                for x in 0..w {
                    if rectified.valid[(x, y)] & ACTIVE == 0 {
                        continue;
                    }
                    inside += 1;
                    let uv = rectified.camera.unproject(&Vector2::new(x as f64 + 0.5, y as f64 + 0.5)).expect("pinhole");
                    let expected = [128.0 + 100.0 * uv.x, 128.0 + 100.0 * uv.y];
                    for (c, e) in rectified.rgb[(x, y)].iter().zip(expected) {
                        // Truncation to a byte, rounding, and one pixel's slope at the rim.
                        assert!((f64::from(*c) - e).abs() < 2.0, "{model:?} ({x}, {y}): {c} {e}");
                    }
                }
            }
            // The whole field of view stays: at least as many pixels as the inverse of the area's largest shrinkage.
            assert!(inside > 320 * 220 * 3 / 5, "{model:?}: {inside}");
        }
    }

    #[test]
    fn mask_follows_and_sizes_are_checked() {
        let mut v = view(Camera::new(CameraModel::SimpleRadial, 64, 48, &[60.0, 32.0, 24.0, 0.1]).expect("valid"));
        let mut mask = Raster::filled(64, 48, 255);
        for y in 0..48 {
            mask.row_mut(y)[..32].fill(0);
        }
        v.mask = Some(mask);
        let rectified = rectify(&v).expect("possible");
        let centre = rectified.camera.principal_point()[0] as usize;
        for y in 0..rectified.valid.height() {
            assert!(rectified.valid.row(y)[..centre - 1].iter().all(|&m| m & ACTIVE == 0));
        }
        assert!(rectified.valid.row(rectified.valid.height() / 2)[centre + 1..].iter().all(|&m| m == INSIDE | ACTIVE));
        v.mask = Some(Raster::filled(64, 47, 255));
        assert!(matches!(rectify(&v), Err(DenseError::SizeMismatch { what: "mask", .. })));
    }
}
