//! From depth maps to one cloud.

use crate::DepthMap;
use crate::cache::Cache;
use crate::consistency::{Opinion, PosedMap, Support, Tolerance};
use crate::isolated::has_company;
use nalgebra::{Point3, Vector2, Vector3};
use rayon::prelude::*;
use scene::{Cloud, ImageId};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Which depths become points.
#[derive(Clone, Debug, PartialEq)]
pub struct FusionOptions {
    /// A point is seen alike in at least this many maps, the one that proposes it included. Where an image has fewer neighbours with maps,
    /// all of them must agree, and at least one.
    pub min_views: usize,
    /// The point of another map, projected into the one that proposes it, is at most this far from its pixel.
    pub max_reprojection_px: f64,
    /// Relative difference of the depths in the other camera.
    pub max_relative_depth: f64,
    /// Largest angle between the normals, radians.
    pub max_normal_angle: f64,
    /// Depths of less confidence propose nothing; they may still support.
    pub min_confidence: f32,
    /// Standard deviation of a match in an image, pixels: what the estimated sigma is propagated from.
    pub match_sigma_px: f64,
    /// A point stays when at least this many others lie within `isolation_radius_gsd`; 0: every point stays.
    pub min_company: usize,
    /// Radius of that rule, in ground sample distances at the point.
    pub isolation_radius_gsd: f64,
    /// At most this many maps are held at a time, and never fewer than one image and its neighbours.
    pub cached_maps: usize,
}

impl Default for FusionOptions {
    fn default() -> Self {
        Self {
            min_views: 3,
            max_reprojection_px: 1.0,
            max_relative_depth: 0.02,
            max_normal_angle: 60f64.to_radians(),
            min_confidence: 0.0,
            match_sigma_px: 0.3,
            min_company: 8,
            isolation_radius_gsd: 4.0,
            cached_maps: 32,
        }
    }
}

/// What went in and out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FusionSummary {
    /// Maps that were there.
    pub maps: usize,
    /// Pixels with a depth.
    pub depths: usize,
    /// Of these, part of a point that another image proposed.
    pub merged: usize,
    /// Of these, seen alike in too few maps.
    pub unsupported: usize,
    /// Of these, in the way of what more maps see behind than agree.
    pub contradicted: usize,
    /// Points removed because they had no company.
    pub isolated: usize,
    /// Points of the cloud.
    pub points: usize,
    /// Median ground sample distance of the points, in units of the world a pixel.
    pub median_gsd: Option<f64>,
}

/// A cloud and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Fusion {
    /// Points with normals, colours, views and sigmas.
    pub cloud: Cloud,
    /// Counts.
    pub summary: FusionSummary,
}

/// Fuses the depth maps of `images`, which `load` reads on demand (`None`: there is none).
///
/// Every pixel with a depth that is not part of a point yet proposes one, image after image in the order given, row after row. The maps of
/// the image's neighbours are asked about it: they agree when depth (the map's plane continued to the exact place), place in the image and
/// normal fit; they contradict when they see a surface clearly behind (Merrell et al., *Real-time visibility-based fusion of depth maps*,
/// ICCV 2007). A proposal with enough agreement, and more of it than contradiction, becomes the mean of the agreeing positions,
/// normals and colours. The agreeing pixels are part of it and propose nothing later, and what agrees with a part of an earlier image's point
/// is that point again: one point each. So images with the finest ground sample distance should come first.
///
/// sigma is propagated: from `match_sigma_px` in every agreeing view, by their parallax, to the depth, and across the ray. It knows nothing of
/// errors that the views share (orientation, calibration, refraction).
///
/// # Errors
/// What `load` returns.
pub fn fuse<E>(images: &[ImageId], load: impl FnMut(ImageId) -> Result<Option<DepthMap>, E>, options: &FusionOptions) -> Result<Fusion, E> {
    let mut cache = Cache::new(options.cached_maps, load);
    let listed: BTreeSet<ImageId> = images.iter().copied().collect();
    let mut used: BTreeMap<ImageId, Used> = BTreeMap::new();
    let (mut cloud, mut gsds, mut summary) = (Cloud::default(), Vec::new(), FusionSummary::default());
    let tolerance = Tolerance {
        reprojection_px: options.max_reprojection_px,
        relative_depth: options.max_relative_depth,
        min_normal_cosine: options.max_normal_angle.cos(),
    };
    for &image in images {
        let Some(reference) = cache.get(image)? else { continue };
        summary.maps += 1;
        let mut neighbours: Vec<Arc<DepthMap>> = Vec::new();
        for &other in reference.neighbours.iter().filter(|&&other| other != image && listed.contains(&other)) {
            neighbours.extend(cache.get(other)?);
        }
        for map in neighbours.iter().chain([&reference]) {
            used.entry(map.image).or_insert_with(|| Used::new(map.depth.data().len()));
        }
        let rows = propose(&reference, &neighbours, &used, &tolerance, options);
        for &(other, pixel) in rows.iter().flat_map(|row| &row.claimed) {
            used.entry(other).and_modify(|flags| flags.set(pixel as usize));
        }
        for row in rows {
            summary.depths += row.depths;
            summary.merged += row.merged;
            summary.unsupported += row.unsupported;
            summary.contradicted += row.contradicted;
            gsds.extend(row.gsds);
            cloud.positions.extend(row.cloud.positions);
            cloud.normals.extend(row.cloud.normals);
            cloud.colours.extend(row.cloud.colours);
            cloud.views.extend(row.cloud.views);
            cloud.sigmas.extend(row.cloud.sigmas);
        }
    }
    let radii: Vec<f64> = gsds.iter().map(|g| g * options.isolation_radius_gsd).collect();
    let keep = has_company(&cloud.positions, &radii, options.min_company);
    summary.isolated = keep.iter().filter(|&&k| !k).count();
    retain(&mut cloud, &keep);
    let mut kept_gsds: Vec<f64> = gsds.iter().zip(&keep).filter(|(_, k)| **k).map(|(g, _)| *g).collect();
    summary.points = cloud.len();
    if !kept_gsds.is_empty() {
        let middle = kept_gsds.len() / 2;
        summary.median_gsd = Some(*kept_gsds.select_nth_unstable_by(middle, f64::total_cmp).1);
    }
    Ok(Fusion { cloud, summary })
}

/// One bit a pixel of a map: whether it is part of a point.
struct Used(Vec<u64>);

impl Used {
    fn new(pixels: usize) -> Self {
        Self(vec![0; pixels.div_ceil(64)])
    }

    fn get(&self, pixel: usize) -> bool {
        self.0[pixel / 64] >> (pixel % 64) & 1 == 1
    }

    fn set(&mut self, pixel: usize) {
        self.0[pixel / 64] |= 1 << (pixel % 64);
    }
}

/// Points of one row and the pixels of other maps that are part of them.
#[derive(Default)]
struct Row {
    cloud: Cloud,
    gsds: Vec<f64>,
    claimed: Vec<(ImageId, u32)>,
    depths: usize,
    merged: usize,
    unsupported: usize,
    contradicted: usize,
}

fn propose(
    reference: &DepthMap,
    neighbours: &[Arc<DepthMap>],
    used: &BTreeMap<ImageId, Used>,
    tolerance: &Tolerance,
    options: &FusionOptions,
) -> Vec<Row> {
    let posed = PosedMap::new(reference);
    let others: Vec<PosedMap> = neighbours.iter().map(|m| PosedMap::new(m)).collect();
    // At least one other: a single map proves nothing.
    let needed = options.min_views.min(others.len() + 1).max(2) - 1;
    let is_used = |image: ImageId, pixel: usize| used.get(&image).is_some_and(|flags| flags.get(pixel));
    let width = reference.depth.width();
    (0..reference.depth.height())
        .into_par_iter()
        .map(|y| {
            let mut row = Row::default();
            let mut supports: Vec<(u32, Support)> = Vec::new();
            for x in 0..width {
                let Some(x_in_cam) = reference.point_in_cam(x, y) else { continue };
                row.depths += 1;
                let pixel = y * width + x;
                if is_used(reference.image, pixel) {
                    row.merged += 1;
                    continue;
                }
                if reference.confidence.data()[pixel] < options.min_confidence {
                    row.unsupported += 1;
                    continue;
                }
                let position = posed.to_world(&x_in_cam);
                let normal = posed.normal_in_world(pixel);
                let reference_px = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
                supports.clear();
                let mut contradictions = 0;
                for (i, other) in others.iter().enumerate() {
                    match other.opinion(&posed, &reference_px, &position, &normal, tolerance) {
                        Opinion::Agreement(support) => supports.push((i as u32, support)),
                        Opinion::Contradiction => contradictions += 1,
                        Opinion::None | Opinion::Other => {}
                    }
                }
                if supports.iter().any(|(i, s)| is_used(others[*i as usize].map.image, s.pixel)) {
                    row.merged += 1;
                } else if supports.len() < needed {
                    row.unsupported += 1;
                } else if contradictions > supports.len() {
                    row.contradicted += 1;
                } else {
                    let gsd = x_in_cam.z / reference.camera.mean_focal();
                    row.claimed.push((reference.image, pixel as u32));
                    row.push(position, normal, reference.rgb.data()[pixel], &supports, &others, gsd, options.match_sigma_px);
                }
            }
            row
        })
        .collect()
}

impl Row {
    #[expect(clippy::too_many_arguments, reason = "the parts of one point")]
    fn push(
        &mut self,
        position: Vector3<f64>,
        normal: Vector3<f64>,
        colour: [u8; 3],
        supports: &[(u32, Support)],
        others: &[PosedMap],
        gsd: f64,
        match_sigma_px: f64,
    ) {
        let (mut sum, mut normals, mut colours, mut information) = (position, normal, colour.map(u32::from), 0.0);
        for (i, support) in supports {
            sum += support.position;
            normals += support.normal;
            let other = others[*i as usize].map.rgb.data()[support.pixel];
            colours = [0, 1, 2].map(|c| colours[c] + u32::from(other[c]));
            information += (support.parallax_px / match_sigma_px).powi(2);
            self.claimed.push((others[*i as usize].map.image, support.pixel as u32));
        }
        let count = supports.len() as u32 + 1;
        let across = match_sigma_px * gsd / f64::from(count).sqrt();
        self.cloud.positions.push(Point3::from(sum / f64::from(count)));
        self.cloud.normals.push(normals.try_normalize(1e-9).unwrap_or(normal).cast());
        self.cloud.colours.push(colours.map(|c| ((c + count / 2) / count) as u8));
        self.cloud.views.push(count as u16);
        self.cloud.sigmas.push((1.0 / information + across * across).sqrt() as f32);
        self.gsds.push(gsd);
    }
}

/// Keeps the marked points.
fn retain(cloud: &mut Cloud, keep: &[bool]) {
    fn filter<T>(values: &mut Vec<T>, keep: &[bool]) {
        let mut marks = keep.iter();
        values.retain(|_| marks.next().copied().unwrap_or(true));
    }
    filter(&mut cloud.positions, keep);
    filter(&mut cloud.normals, keep);
    filter(&mut cloud.colours, keep);
    filter(&mut cloud.views, keep);
    filter(&mut cloud.sigmas, keep);
}
