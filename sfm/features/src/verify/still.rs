//! Matches that do not move: parts of the vehicle in view, captions, the edge of a lens hood.

use super::models::Pixels;
use scene::Camera;

/// Width of the border, as a share of the diagonal.
const BORDER: f64 = 0.1;
/// Share of still matches in the border above which they are not taken for the scene.
const BORDER_SHARE: f64 = 0.9;

/// Positions of the matches that do not move, rising; none between images of different size.
pub(super) fn still(pixels: &Pixels, cameras: [&Camera; 2], max_still_px: f64) -> Vec<usize> {
    if (cameras[0].width(), cameras[0].height()) != (cameras[1].width(), cameras[1].height()) {
        return Vec::new();
    }
    (0..pixels.a.len()).filter(|&i| (pixels.a[i] - pixels.b[i]).norm() <= max_still_px).collect()
}

/// Whether they lie along the border of the image.
pub(super) fn along_the_border(still: &[usize], pixels: &Pixels, camera: &Camera) -> bool {
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    let border = BORDER * width.hypot(height);
    let inside = |v: f64, size: f64| v > border && v < size - border;
    let within = still.iter().filter(|&&i| inside(pixels.a[i].x, width) && inside(pixels.a[i].y, height)).count();
    (still.len() - within) as f64 >= BORDER_SHARE * still.len() as f64
}
