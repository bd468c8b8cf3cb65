//! Where in the images the residuals are: what they say about the interior orientation.

use scene::Reconstruction;

/// Cells along each side of an image.
pub const REGIONS: usize = 4;

/// Residuals of one camera, projection less observation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraResiduals {
    /// All of its observations.
    pub all: RegionResiduals,
    /// By region of the image, [`REGIONS`] x [`REGIONS`], row by row from the top left.
    pub regions: Vec<RegionResiduals>,
}

/// Residuals in a part of the images of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionResiduals {
    /// Number of observations.
    pub observations: usize,
    /// Root mean square of the distances, pixels.
    pub rms_px: f64,
    /// Mean along x and y, pixels: away from zero where the camera model does not fit.
    pub mean_px: [f64; 2],
}

#[derive(Clone, Default)]
struct Sums {
    count: f64,
    squares: f64,
    sum: [f64; 2],
}

impl Sums {
    fn add(&mut self, dx: f64, dy: f64) {
        self.count += 1.0;
        self.squares += dx * dx + dy * dy;
        self.sum[0] += dx;
        self.sum[1] += dy;
    }

    fn statistics(&self) -> RegionResiduals {
        let n = self.count.max(1.0);
        RegionResiduals { observations: self.count as usize, rms_px: (self.squares / n).sqrt(), mean_px: self.sum.map(|s| s / n) }
    }
}

/// Residuals of each camera of a model.
#[must_use]
pub fn camera_residuals(model: &Reconstruction) -> Vec<CameraResiduals> {
    let mut sums = vec![vec![Sums::default(); 1 + REGIONS * REGIONS]; model.cameras.len()];
    for point in &model.points {
        for &o in &point.track {
            let c = model.images[o.image.index()].camera.index();
            let (camera, pixel) = (&model.cameras[c], model.pixel(o));
            let Some(found) = model.cam_from_world(o.image).and_then(|pose| camera.project(&pose.apply(&point.xyz))) else { continue };
            let cell = |x: f64, size: u32| ((x / f64::from(size) * REGIONS as f64).max(0.0) as usize).min(REGIONS - 1);
            let region = cell(pixel.y, camera.height()) * REGIONS + cell(pixel.x, camera.width());
            let d = found - pixel;
            sums[c][0].add(d.x, d.y);
            sums[c][1 + region].add(d.x, d.y);
        }
    }
    let of = |s: &Vec<Sums>| CameraResiduals { all: s[0].statistics(), regions: s[1..].iter().map(Sums::statistics).collect() };
    sums.iter().map(of).collect()
}
