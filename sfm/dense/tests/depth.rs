//! Depth maps of a scene whose geometry is known.

mod common;

use common::{Look, Truth, compare, pinhole, view, views};
use dense::{DenseError, DepthMap, DepthOptions, DepthSeed, View, estimate_depth, estimate_depth_from_seeds};
use nalgebra::Vector2;
use scene::{Camera, CameraModel, Raster};

const RANGE: (f64, f64) = (2.0, 12.0);

/// Two levels even on these small images.
fn options() -> DepthOptions {
    DepthOptions { coarsest_side: 100, ..Default::default() }
}

fn depth(views: &[View]) -> DepthMap {
    let neighbours: Vec<&View> = views[1..].iter().collect();
    estimate_depth(&views[0], &neighbours, RANGE, &options()).expect("valid views")
}

fn assert_good(truth: &Truth, known: f64, within: f64) {
    // A pixel of parallax is 4 % of the depth here, a match is good to a twentieth of it. An error of that size over half a window of 11 pixels
    // tilts a plane by 5 degrees; more views make it smaller.
    assert!(
        truth.known > known && truth.within_1_percent > within && truth.median_error < 0.003 && truth.median_normal_deg < 8.0,
        "{truth:?}"
    );
}

#[test]
fn surfaces_and_their_edge_are_found() {
    let map = depth(&views(pinhole(), Look::Textured));
    assert_good(&compare(&map), 0.9, 0.95);
    assert_eq!(DepthMap::from_bytes(&map.to_bytes()).expect("whole"), map);
    // Around the sphere's edge depth is that of one of both surfaces, not between them.
    let (mut known, mut between) = (0, 0);
    for y in 1..149 {
        for x in 1..199 {
            let z = map.depth[(x, y)];
            let around = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)].map(|p| map.depth[p]);
            let (low, high) = around.iter().fold((z, z), |(l, h), &a| (l.min(a), h.max(a)));
            if low > 0.0 && high > 1.15 * low {
                known += 1;
                between += usize::from(z > 1.05 * low && z < 0.95 * high);
            }
        }
    }
    assert!(known > 100 && between * 20 < known, "{between} of {known}");
}

#[test]
fn a_distorted_lens_makes_no_difference() {
    let camera = Camera::new(CameraModel::OpenCv, 200, 150, &[190.0, 192.0, 103.0, 74.0, 0.15, 0.1, 0.002, -0.001]).expect("valid");
    let map = depth(&views(camera, Look::Textured));
    assert_eq!(map.camera.model(), CameraModel::Pinhole);
    // The border of the rectified raster shows nothing.
    assert_good(&compare(&map), 0.75, 0.92);
}

#[test]
fn a_stereo_pair_is_enough() {
    let all = views(pinhole(), Look::Textured);
    // A fifth of the image is not in the other one, and beside the sphere the wall is hidden.
    assert_good(&compare(&depth(&all[..2])), 0.75, 0.85);
}

#[test]
fn a_view_that_looks_elsewhere_does_no_harm() {
    let mut all = views(pinhole(), Look::Textured);
    let before = compare(&depth(&all));
    all.push(view(5, pinhole(), [0.5, 0.0, 0.0], [0.0, 2.5, 0.0], Look::Textured));
    let after = compare(&depth(&all));
    assert_good(&after, before.known - 0.03, before.within_1_percent - 0.02);
}

#[test]
fn masked_pixels_stay_empty_and_support_nothing() {
    let mut all = views(pinhole(), Look::Textured);
    let mut mask = Raster::filled(200, 150, 255u8);
    for y in 0..150 {
        mask.row_mut(y)[..100].fill(0);
    }
    all[0].mask = Some(mask.clone());
    let map = depth(&all);
    assert!((0..150).all(|y| map.depth.row(y)[..100].iter().all(|&z| z == 0.0)));
    let truth = compare(&map);
    assert_good(&truth, 0.4, 0.93);
    // Where every neighbour is masked nothing can be matched.
    for v in &mut all {
        v.mask = Some(Raster::filled(200, 150, 0));
    }
    all[0].mask = None;
    assert_eq!(depth(&all).known(), 0);
}

#[test]
fn a_bare_wall_gives_nothing() {
    let map = depth(&views(pinhole(), Look::Bare));
    assert!(map.known() < 200 * 150 / 100, "{}", map.known());
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let all = views(pinhole(), Look::Textured);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| depth(&all[..3]).to_bytes())
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn seeds_help_where_the_range_is_wide() {
    let all = views(pinhole(), Look::Textured);
    let neighbours: Vec<&View> = all[1..3].iter().collect();
    let truth = depth(&all);
    let mut seeds = Vec::new();
    for (x, y) in (5..145).step_by(20).flat_map(|y| (5..195).step_by(20).map(move |x| (x, y))) {
        let z = f64::from(truth.depth[(x, y)]);
        if z > 0.0 {
            seeds.push(DepthSeed { position: Vector2::new((x as f64 + 0.5) / 200.0, (y as f64 + 0.5) / 150.0), depth: z });
        }
    }
    // With so few passes a random start does not converge.
    let options = DepthOptions { coarse_passes: 1, ..Default::default() };
    let range = (0.5, 100.0);
    let with = compare(&estimate_depth_from_seeds(&all[0], &neighbours, range, &seeds, &options).expect("valid"));
    let without = compare(&estimate_depth(&all[0], &neighbours, range, &options).expect("valid"));
    assert!(with.known * with.within_1_percent > without.known * without.within_1_percent, "{with:?} {without:?}");
}

#[test]
fn impossible_input_is_refused() {
    let all = views(pinhole(), Look::Bare);
    let run = |range, options: &DepthOptions| estimate_depth(&all[0], &[&all[1]], range, options);
    for range in [(0.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        assert!(matches!(run(range, &DepthOptions::default()), Err(DenseError::BadRange(..))));
    }
    let bad = DepthOptions { noise: 0.0, ..Default::default() };
    assert!(matches!(run(RANGE, &bad), Err(DenseError::BadOption { name: "noise", .. })));
    let mut small = all[1].clone();
    small.rgb = Raster::filled(3, 3, [0; 3]);
    assert!(matches!(estimate_depth(&all[0], &[&small], RANGE, &DepthOptions::default()), Err(DenseError::SizeMismatch { .. })));
    assert_eq!(estimate_depth(&all[0], &[], RANGE, &DepthOptions::default()).expect("possible").known(), 0);
    let tiny = Camera::from_focal(CameraModel::Pinhole, 1, 1, 1.0).expect("valid");
    let tiny = [view(0, tiny, [0.0; 3], [0.0; 3], Look::Bare), view(1, tiny, [1.0, 0.0, 0.0], [0.0; 3], Look::Bare)];
    assert_eq!(depth(&tiny).known(), 0);
}
