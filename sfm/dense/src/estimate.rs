//! From an image and its neighbours to a depth map.

use crate::bytes::{storable_confidence, storable_normal};
use crate::depth_map::remove_small_segments;
use crate::patchmatch::{
    Cell, GreyView, Kernel, Level, LevelOffsets, PatchWeights, Pinhole, SearchOptions, SourceView, Start, halve_grey, halve_valid, search,
};
use crate::seeds::seed_raster;
use crate::view::{Rectified, rectify};
use crate::{DenseError, DepthMap, DepthSeed, View};
use scene::Raster;

/// How depth is searched. The defaults suit photographs and video from an ROV.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthOptions {
    /// Updates of every pixel at the coarsest resolution, where the search starts.
    pub coarse_passes: u32,
    /// Updates of every pixel at each finer resolution.
    pub fine_passes: u32,
    /// The image is halved until its long side is at most this, pixels.
    pub coarsest_side: u32,
    /// A pixel's cost is the mean over this many neighbours that fit best, so that a surface may be hidden in the others. `None`: 1 of up
    /// to 2, 2 of up to 5, 3 of more.
    pub best_views: Option<usize>,
    /// Depths of which the normalised correlation is below this are dropped.
    pub min_correlation: f32,
    /// Noise of the images, grey levels of 0..=255: windows with less contrast are left empty, little contrast lowers the correlation.
    pub noise: f32,
    /// Samples of a window count less when they differ from its centre by more than about this, grey levels.
    pub colour_sigma: f32,
    /// Samples of a window count less when they are farther than about this, pixels. The window is 11 pixels wide.
    pub spatial_sigma_px: f32,
    /// Largest angle between a surface's normal and the ray, radians.
    pub max_slant: f32,
    /// Connected groups of fewer pixels are dropped.
    pub min_segment: usize,
    /// Seed of the random search.
    pub seed: u64,
}

impl Default for DepthOptions {
    fn default() -> Self {
        Self {
            coarse_passes: 6,
            fine_passes: 2,
            coarsest_side: 200,
            best_views: None,
            min_correlation: 0.5,
            noise: 0.7,
            colour_sigma: 20.0,
            spatial_sigma_px: 4.0,
            max_slant: 80f32.to_radians(),
            min_segment: 40,
            seed: 0,
        }
    }
}

impl DepthOptions {
    fn validate(&self) -> Result<(), DenseError> {
        let check = |ok: bool, name, why| if ok { Ok(()) } else { Err(DenseError::BadOption { name, why }) };
        check(self.coarse_passes > 0, "coarse_passes", "must be at least 1")?;
        check(self.best_views != Some(0), "best_views", "must be at least 1")?;
        check(self.noise > 0.0 && self.noise.is_finite(), "noise", "must be positive")?;
        check(self.colour_sigma > 0.0, "colour_sigma", "must be positive")?;
        check(self.spatial_sigma_px > 0.0, "spatial_sigma_px", "must be positive")?;
        check((0.0..1.6).contains(&self.max_slant), "max_slant", "must lie between 0 and a right angle, in radians")?;
        check((-1.0..1.0).contains(&self.min_correlation), "min_correlation", "must lie between -1 and 1")
    }
}

/// Levels smaller than this hold no window.
const MIN_SIDE: usize = 16;
/// Relative difference of depth at which neighbouring pixels belong to different segments.
const SEGMENT_TOLERANCE: f32 = 0.02;

/// Depth, normal and confidence of a view from its neighbours, between the depths `range` (z in the camera frame).
///
/// Multi-view PatchMatch (see the module `patchmatch`) with normalised correlation in bilaterally weighted 11 x 11 windows, coarse to fine, on
/// distortion-free versions of the views; behind a flat port along the refracted rays ([`crate::RayOffsets`]). Masked pixels of the reference are not computed, and masked ones of a neighbour support nothing.
/// The result depends on the arguments alone, not on the number of threads. What one view alone claims is kept: [`crate::fuse`] asks
/// whether others agree.
///
/// Neighbours beyond the sixteenth are not used. Without neighbours every depth is unknown.
///
/// # Errors
/// [`DenseError`] when a view, the range or an option cannot be used.
pub fn estimate_depth(reference: &View, neighbours: &[&View], range: (f64, f64), options: &DepthOptions) -> Result<DepthMap, DenseError> {
    estimate_depth_from_seeds(reference, neighbours, range, &[], options)
}

/// As [`estimate_depth`], starting from pixels of known depth (see [`crate::depth_seeds`]), which finds more where the range is wide.
///
/// # Errors
/// As [`estimate_depth`].
pub fn estimate_depth_from_seeds(
    reference: &View,
    neighbours: &[&View],
    range: (f64, f64),
    seeds: &[DepthSeed],
    options: &DepthOptions,
) -> Result<DepthMap, DenseError> {
    options.validate()?;
    let (near, far) = range;
    if !(near > 0.0 && near < far && far.is_finite()) {
        return Err(DenseError::BadRange(near, far));
    }
    let rectified = rectify(reference)?;
    let sources = neighbours.iter().map(|view| Ok((*view, rectify(view)?))).collect::<Result<Vec<_>, DenseError>>()?;
    let search_options = SearchOptions {
        kernel: Kernel::detect(),
        seed: options.seed ^ (u64::from(reference.image.0) << 20),
        inverse_range: [(1.0 / far) as f32, (1.0 / near) as f32],
        best: options.best_views.unwrap_or(best_of(sources.len())).min(sources.len()).max(1),
        min_squared_cosine: options.max_slant.cos().powi(2),
    };
    let weights = PatchWeights::new(options.colour_sigma, options.spatial_sigma_px, options.noise);
    let cells =
        if sources.is_empty() { None } else { run_levels(reference, &rectified, &sources, seeds, &weights, &search_options, options) };
    Ok(to_map(reference, rectified, neighbours, cells, options))
}

/// See [`DepthOptions::best_views`].
fn best_of(sources: usize) -> usize {
    match sources {
        0..=2 => 1,
        3..=5 => 2,
        _ => 3,
    }
}

/// One image of the pyramid: grey values and which pixels take part.
type Layer = (Raster<u16>, Raster<u8>);

/// The view at every resolution, finest first; every layer is at least [`MIN_SIDE`] wide and high.
fn pyramid(rectified: &Rectified, levels: usize) -> Vec<Layer> {
    let mut out = vec![(rectified.grey.clone(), rectified.valid.clone())];
    for level in 1..levels {
        let (grey, valid) = &out[level - 1];
        out.push((halve_grey(grey), halve_valid(valid)));
    }
    out
}

fn level_count(views: &[&Rectified], reference: &Rectified, coarsest_side: u32) -> usize {
    let side = |r: &Rectified| r.grey.width().min(r.grey.height());
    let smallest = views.iter().map(|r| side(r)).min().unwrap_or(0).min(side(reference));
    let long = reference.grey.width().max(reference.grey.height());
    let mut levels = 1;
    while long >> (levels - 1) > coarsest_side as usize && smallest >> levels >= MIN_SIDE {
        levels += 1;
    }
    levels
}

fn run_levels(
    reference: &View,
    rectified: &Rectified,
    sources: &[(&View, Rectified)],
    seeds: &[DepthSeed],
    weights: &PatchWeights,
    search_options: &SearchOptions,
    options: &DepthOptions,
) -> Option<Raster<Cell>> {
    let all: Vec<&Rectified> = sources.iter().map(|(_, r)| r).collect();
    if all.iter().chain([&rectified]).any(|r| r.grey.width().min(r.grey.height()) < MIN_SIDE) {
        return None;
    }
    let levels = level_count(&all, rectified, options.coarsest_side);
    let own = pyramid(rectified, levels);
    let others: Vec<Vec<Layer>> = all.iter().map(|r| pyramid(r, levels)).collect();
    let world_from_reference = reference.cam_from_world.inverse();
    let mut found: Option<Raster<Cell>> = None;
    for index in (0..levels).rev() {
        let (grey, valid) = own[index].clone();
        let pinhole = Pinhole::at_level(&rectified.camera, index as u32);
        let views = sources.iter().zip(&others).map(|((view, r), layers)| {
            let other_from_reference = view.cam_from_world * world_from_reference;
            SourceView::new(
                GreyView::new(&layers[index].0, &layers[index].1),
                &pinhole,
                &Pinhole::at_level(&r.camera, index as u32),
                &other_from_reference,
            )
            .with_offsets(r.offsets.as_ref().map(|o| LevelOffsets::new(o, index as u32)))
        });
        let offsets = rectified.offsets.as_ref().map(|o| LevelOffsets::new(o, index as u32));
        let level = Level { grey, valid, pinhole, offsets, sources: views.collect(), weights };
        let first_pass = 1000 * index as u32;
        found = Some(match &found {
            None => {
                let start = seed_raster(reference, &rectified.camera, seeds, level.grey.width(), level.grey.height(), index as u32);
                search(&level, &Start::Seeds(&start), search_options, options.coarse_passes, first_pass)
            }
            Some(coarser) => search(&level, &Start::Coarser(coarser), search_options, options.fine_passes, first_pass),
        });
    }
    found
}

fn to_map(reference: &View, rectified: Rectified, neighbours: &[&View], cells: Option<Raster<Cell>>, options: &DepthOptions) -> DepthMap {
    let Rectified { camera, mut rgb, offsets, .. } = rectified;
    let offsets = offsets.as_deref().cloned();
    let (w, h) = (rgb.width(), rgb.height());
    let mut depth = Raster::filled(w, h, 0.0);
    let (mut normal, mut confidence) = (Raster::filled(w, h, [0.0; 3]), Raster::filled(w, h, 0.0));
    if let Some(cells) = &cells {
        for (z, cell) in depth.data_mut().iter_mut().zip(cells.data()) {
            if cell.cost <= 1.0 - options.min_correlation {
                *z = 1.0 / cell.plane.w;
            }
        }
        remove_small_segments(&mut depth, options.min_segment, SEGMENT_TOLERANCE);
        let pinhole = Pinhole::at_level(&camera, 0);
        for y in 0..h {
            for x in (0..w).filter(|&x| depth[(x, y)] > 0.0) {
                let cell = cells[(x, y)];
                normal[(x, y)] = storable_normal(cell.plane.normal(&pinhole, x as f32, y as f32));
                confidence[(x, y)] = storable_confidence(1.0 - cell.cost);
            }
        }
    }
    for (colour, &z) in rgb.data_mut().iter_mut().zip(depth.data()) {
        if z <= 0.0 {
            *colour = [0; 3];
        }
    }
    let neighbours = neighbours.iter().map(|v| v.image).collect();
    DepthMap {
        image: reference.image,
        camera,
        cam_from_world: reference.cam_from_world,
        offsets,
        neighbours,
        depth,
        normal,
        confidence,
        rgb,
    }
}
