//! A rendered dive with true orientation: reef, ripples, water, noise, lens distortion, true masks.

use dense::{DepthMap, DepthOptions, FusionOptions, View, estimate_depth, fuse};
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::TriMesh;
use scene::ImageId;
use std::convert::Infallible;
use synthetic::dive::{DiveOptions, render_dive};

const EXPOSURES: usize = 10;

#[test]
fn the_reef_is_where_it_was_rendered_and_the_water_stays_empty() {
    let dive = render_dive(&DiveOptions { exposures: EXPOSURES, width: 288, height: 180, ..Default::default() });
    let truth = dive.truth("png");
    let view = |camera: usize, exposure: usize| {
        let index = camera * EXPOSURES + exposure;
        let image = ImageId::new(index);
        let cam_from_world = truth.cam_from_world(image).expect("every frame is posed");
        View {
            image,
            camera: truth.cameras[camera],
            cam_from_world,
            rgb: dive.images[index].rgb.clone(),
            mask: Some(dive.images[index].mask.clone()),
        }
    };
    let maps: Vec<DepthMap> = [(0, 4), (1, 4), (0, 5), (1, 5)]
        .map(|(camera, exposure)| {
            let neighbours = [view(1 - camera, exposure), view(camera, 9 - exposure), view(1 - camera, 9 - exposure)];
            estimate_depth(&view(camera, exposure), &neighbours.each_ref(), (2.0, 9.0), &DepthOptions::default()).expect("valid views")
        })
        .into();
    for map in &maps {
        let seen = dive.images[map.image.index()].mask.data().iter().filter(|&&m| m > 0).count();
        // Straightened images are a little larger than the frames.
        assert!(map.known() * 100 > seen * 85, "{} of {seen}", map.known());
    }
    let images: Vec<ImageId> = maps.iter().map(|m| m.image).collect();
    let load = |id| Ok::<_, Infallible>(maps.iter().find(|m| m.image == id).cloned());
    let cloud = fuse(&images, load, &FusionOptions::default()).expect("loading cannot fail").cloud;
    let vector = |p: &nalgebra::Point3<f64>| Vector::new(p.x as f32, p.y as f32, p.z as f32);
    let mesh = TriMesh::new(dive.mesh.vertices.iter().map(vector).collect(), dive.mesh.faces.clone()).expect("the dive has a surface");
    let mut errors: Vec<f32> = cloud.positions.iter().map(|p| mesh.distance_to_local_point(vector(p), false)).collect();
    errors.sort_unstable_by(f32::total_cmp);
    let n = errors.len();
    // A frame shows about 37,000 pixels of structure; what one of the four maps alone sees, or at a glancing angle, is left out.
    assert!(n > 27_000, "{n}");
    // A pixel is 16 mm on the reef, and a pixel of parallax of the rig's base 0.16 m in depth: a match is good to a tenth of a pixel.
    assert!(
        errors[n / 2] < 0.004 && errors[n * 9 / 10] < 0.02 && errors[n * 99 / 100] < 0.08,
        "{:?}",
        [50, 90, 99].map(|q| errors[n * q / 100])
    );
}
