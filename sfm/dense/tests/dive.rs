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
    let mut options = DiveOptions::small(EXPOSURES, 288, 180);
    options.motion.radius_m = 4.2;
    // 0.8 of the sensor's width: 230 pixels.
    options.rig.cameras.iter_mut().for_each(|camera| camera.focal_mm = 0.8 * 9.216);
    let dive = render_dive(&options).expect("the options are possible");
    let truth = dive.scene.truth("png");
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
    let surface = dive.scene.world.mesh();
    let mesh = TriMesh::new(surface.vertices.iter().map(vector).collect(), surface.faces).expect("the dive has a surface");
    // Errors in pixels of the parallax that the rig's base gives at their distance.
    let centre = truth.cam_from_world(ImageId::new(4)).expect("every frame is posed").centre();
    let base_px = 230.0 * dive.scene.cameras[1].cam_from_rig.centre().norm();
    let parallax_px = |p: &nalgebra::Point3<f64>| {
        let error = f64::from(mesh.distance_to_local_point(vector(p), false));
        error * base_px / (p.coords - centre).norm_squared()
    };
    let mut errors: Vec<f64> = cloud.positions.iter().map(parallax_px).collect();
    errors.sort_unstable_by(f64::total_cmp);
    let n = errors.len();
    // A frame shows about 42,000 pixels of structure; what one of the four maps alone sees, or at a glancing angle, is left out.
    assert!(n > 27_000, "{n}");
    // A twentieth of a pixel in the middle, a fifth for nine of ten: windows lie over edges of growth there, and over silhouettes in the last
    // hundredth. The scene does not matter: what is twice as far has four times the error in metres.
    assert!(
        errors[n / 2] < 0.05 && errors[n * 9 / 10] < 0.2 && errors[n * 99 / 100] < 0.6,
        "{:?}",
        [50, 90, 99].map(|q| errors[n * q / 100])
    );
}
