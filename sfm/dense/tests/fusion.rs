//! Clouds of a scene whose geometry is known.

mod common;

use common::{Look, View, distance_to_surface, pinhole, views};
use dense::{DepthMap, DepthOptions, Fusion, FusionOptions, estimate_depth, fuse};
use scene::ImageId;
use std::cell::Cell;
use std::convert::Infallible;
use std::sync::LazyLock;

static MAPS: LazyLock<Vec<DepthMap>> = LazyLock::new(|| {
    let all = views(pinhole(), Look::Textured);
    (0..all.len())
        .map(|i| {
            let neighbours: Vec<&View> = all.iter().filter(|v| v.image.index() != i).collect();
            estimate_depth(&all[i], &neighbours, (2.0, 12.0), &DepthOptions::default()).expect("valid views")
        })
        .collect()
});

fn images() -> Vec<ImageId> {
    (0..MAPS.len()).map(ImageId::new).collect()
}

fn fused(images: &[ImageId], options: &FusionOptions) -> Fusion {
    fuse(images, |id| Ok::<_, Infallible>(MAPS.get(id.index()).cloned()), options).expect("loading cannot fail")
}

#[test]
fn the_cloud_lies_on_the_surfaces() {
    let Fusion { cloud, summary } = fused(&images(), &FusionOptions::default());
    let n = cloud.len();
    assert!([cloud.normals.len(), cloud.colours.len(), cloud.views.len(), cloud.sigmas.len(), summary.points] == [n; 5]);
    assert_eq!(summary.depths, MAPS.iter().map(DepthMap::known).sum::<usize>());
    assert_eq!(summary.depths, summary.merged + summary.unsupported + summary.contradicted + summary.isolated + summary.points);
    // One view shows 30,000 pixels, and the five together somewhat more of the scene; each surface point stands there once.
    assert!((25_000..60_000).contains(&n), "{summary:?}");
    let mut errors: Vec<f64> = cloud.positions.iter().map(|p| distance_to_surface(&p.coords)).collect();
    let normalised: f64 = errors.iter().zip(&cloud.sigmas).filter(|(e, s)| **e < 3.0 * f64::from(**s)).count() as f64 / n as f64;
    errors.sort_unstable_by(f64::total_cmp);
    // The ground sample distance is 0.03; a depth's sigma about 0.02.
    assert!(errors[n / 2] < 0.012 && errors[n * 95 / 100] < 0.06, "{} {}", errors[n / 2], errors[n * 95 / 100]);
    assert!(normalised > 0.9, "{normalised}");
    let gsd = summary.median_gsd.expect("points");
    assert!((0.02..0.04).contains(&gsd), "{gsd}");
    // Normals point at the cameras, which all look along +z.
    assert!(cloud.normals.iter().filter(|v| v.z < 0.0).count() > n * 99 / 100);
    assert!(cloud.views.iter().all(|&v| (3..=5).contains(&v)));
}

#[test]
fn one_view_proves_nothing_and_two_do() {
    assert_eq!(fused(&[ImageId(0)], &FusionOptions::default()).cloud.len(), 0);
    let pair = fused(&[ImageId(0), ImageId(1)], &FusionOptions::default());
    assert!(pair.cloud.len() > 15_000, "{:?}", pair.summary);
    assert!(fused(&[], &FusionOptions::default()).cloud.is_empty());
    // Images without a map are passed over.
    assert_eq!(fused(&[ImageId(0), ImageId(1), ImageId(99)], &FusionOptions::default()), pair);
}

#[test]
fn neither_threads_nor_cache_change_a_bit() {
    let run = |threads, cached_maps| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| fused(&images(), &FusionOptions { cached_maps, ..Default::default() }))
    };
    assert_eq!(run(1, 1), run(2, 32));
}

#[test]
fn the_cache_loads_each_map_once_where_it_can() {
    let loads = Cell::new(0);
    let load = |id: ImageId| {
        loads.set(loads.get() + 1);
        Ok::<_, Infallible>(MAPS.get(id.index()).cloned())
    };
    fuse(&images(), load, &FusionOptions::default()).expect("loading cannot fail");
    assert_eq!(loads.get(), MAPS.len());
}

#[test]
fn junk_is_not_fused_and_errors_are_passed_on() {
    // A map with depths of nowhere: nobody agrees, and it does not spoil what the others say.
    let junk = |id: ImageId| {
        let mut map = MAPS[id.index()].clone();
        if id == ImageId(2) {
            for (i, z) in map.depth.data_mut().iter_mut().enumerate().filter(|(_, z)| **z > 0.0) {
                *z = 2.2 + (i * 7919 % 1000) as f32 / 1000.0;
            }
        }
        Ok::<_, Infallible>(Some(map))
    };
    let Fusion { cloud, summary } = fuse(&images(), junk, &FusionOptions::default()).expect("loading cannot fail");
    let far = cloud.positions.iter().filter(|p| distance_to_surface(&p.coords) > 0.15).count();
    assert!(cloud.len() > 20_000 && far * 200 < cloud.len(), "{far} {summary:?}");
    assert_eq!(fuse(&images(), |_| Err("disk"), &FusionOptions::default()), Err("disk"));
}
