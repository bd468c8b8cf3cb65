//! Time of one depth map of a rendered dive with two and four neighbours, and of fusing six.

use criterion::{Criterion, criterion_group, criterion_main};
use dense::{DepthMap, DepthOptions, FusionOptions, View, estimate_depth, fuse};
use scene::ImageId;
use std::convert::Infallible;
use std::hint::black_box;
use synthetic::dive::{DiveOptions, render_dive};

const EXPOSURES: usize = 8;
const RANGE: (f64, f64) = (2.0, 9.0);

fn views() -> Vec<View> {
    let dive = render_dive(&DiveOptions::small(EXPOSURES, 640, 400)).expect("the options are possible");
    let truth = dive.scene.truth("png");
    let view = |(index, image): (usize, &synthetic::dive::DiveImage)| View {
        image: ImageId::new(index),
        camera: truth.cameras[image.camera],
        cam_from_world: truth.cam_from_world(ImageId::new(index)).expect("every frame is posed"),
        rgb: image.rgb.clone(),
        mask: Some(image.mask.clone()),
    };
    dive.images.iter().enumerate().map(view).collect()
}

fn map(views: &[View], exposure: usize, neighbours: usize) -> DepthMap {
    let others = [EXPOSURES + exposure, exposure + 1, exposure - 1, EXPOSURES + exposure + 1];
    let others: Vec<&View> = others[..neighbours].iter().map(|&i| &views[i]).collect();
    estimate_depth(&views[exposure], &others, RANGE, &DepthOptions::default()).expect("valid views")
}

fn depth(c: &mut Criterion) {
    let views = views();
    let mut group = c.benchmark_group("dense");
    group.sample_size(10);
    for neighbours in [2, 4] {
        group.bench_function(format!("depth map of 640 x 400, {neighbours} neighbours"), |b| {
            b.iter(|| map(black_box(&views), 3, neighbours))
        });
    }
    let maps: Vec<DepthMap> = (1..EXPOSURES - 1).map(|e| map(&views, e, 4)).collect();
    let images: Vec<ImageId> = maps.iter().map(|m| m.image).collect();
    let load = |id| Ok::<_, Infallible>(maps.iter().find(|m| m.image == id).cloned());
    group.bench_function("fusion of six maps", |b| b.iter(|| fuse(&images, load, &FusionOptions::default())));
    group.finish();
}

criterion_group!(benches, depth);
criterion_main!(benches);
