//! Where depth is found and where it is lost, on a dive of `sfm synth` that was oriented (`sfm run DIVE/dive.toml --until orient`): `dive DIVE
//! EVERY [CLOUD.ply]` makes the depth map of every EVERYth image and compares it with truth/depth. With CLOUD.ply all maps are made and fused.
//!
//! The dive needs pinhole cameras with lens distortion (`--port none`) and the true masks.

use dense::{
    DepthMap, DepthOptions, FusionOptions, View, ViewSelectionOptions, depth_range, depth_seeds, estimate_depth_from_seeds, fuse,
    select_views,
};
use nalgebra::{Vector2, Vector3};
use scene::{ImageId, Raster, Reconstruction};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::error::Error;
use std::path::Path;

/// Upper ends of the bands of distance, metres.
const BANDS: [f64; 6] = [3.0, 4.0, 5.0, 7.0, 10.0, 100.0];

/// Pixels of a band of distance.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    /// Structure by the true mask.
    structure: usize,
    /// Of these, seen by one other view of the selection, or by two.
    seen: [usize; 2],
    /// Of these seen by one, with a depth.
    known: usize,
    /// Of these, right to two ground sample distances, and to one pixel of parallax.
    right: [usize; 2],
}

fn stem(model: &Reconstruction, image: ImageId) -> String {
    let name = &model.images[image.index()].name;
    name.rsplit_once('.').map_or(name.clone(), |(stem, _)| stem.to_owned())
}

fn read_view(dive: &Path, model: &Reconstruction, image: ImageId) -> Result<View, Box<dyn Error>> {
    let rgb = imaging::decode_rgb(&std::fs::read(dive.join("frames").join(&model.images[image.index()].name))?)?;
    let mask = imaging::decode_grey_u8(&std::fs::read(dive.join(format!("truth/masks/{}.png", stem(model, image))))?)?;
    let camera = model.cameras[model.images[image.index()].camera.index()];
    Ok(View { image, camera, cam_from_world: model.cam_from_world(image).ok_or("not oriented")?, rgb, mask: Some(mask) })
}

fn read_depth(dive: &Path, model: &Reconstruction, image: ImageId) -> Result<Raster<f64>, Box<dyn Error>> {
    let read = image::open(dive.join(format!("truth/depth/{}.png", stem(model, image))))?.into_luma16();
    let (w, h) = (read.width() as usize, read.height() as usize);
    Ok(Raster::from_vec(w, h, read.into_raw().into_iter().map(|q| f64::from(q) / 4000.0).collect()).ok_or("one depth a pixel")?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (dive, every, cloud) = match &arguments[..] {
        [dive, every] => (Path::new(dive), every.parse::<usize>()?, None),
        [dive, every, cloud] => (Path::new(dive), every.parse()?, Some(cloud)),
        _ => return Err("dive DIVE EVERY [CLOUD.ply]".into()),
    };
    let model = scene::format::read_colmap_binary(&dive.join("out/sparse"))?;
    let images: Vec<ImageId> = model.oriented_images().collect();
    let views = images.iter().map(|&i| Ok((i, read_view(dive, &model, i)?))).collect::<Result<BTreeMap<_, _>, Box<dyn Error>>>()?;
    let depths = images.iter().map(|&i| Ok((i, read_depth(dive, &model, i)?))).collect::<Result<BTreeMap<_, _>, Box<dyn Error>>>()?;
    let (mut counts, mut maps, mut seconds) = ([Counts::default(); BANDS.len()], BTreeMap::new(), 0.0);
    let (options, selection) = (DepthOptions::default(), ViewSelectionOptions::default());
    for (number, &image) in images.iter().enumerate() {
        if number % every != 0 && cloud.is_none() {
            continue;
        }
        let neighbours = select_views(&model, image, &selection);
        let Some(range) = depth_range(&model, image) else { continue };
        let others: Vec<&View> = neighbours.iter().map(|i| &views[i]).collect();
        let start = cpu_time::ProcessTime::now();
        let map = estimate_depth_from_seeds(&views[&image], &others, range, &depth_seeds(&model, image), &options)?;
        seconds += start.elapsed().as_secs_f64();
        if number % every == 0 {
            count(&map, &views, &depths, &mut counts);
        }
        maps.insert(image, map);
    }
    println!("{} maps, {seconds:.1} CPU s", maps.len());
    println!("up to m   structure  seen by 1    by 2   known  of them right to 2 GSD   to 1 px   all: right to 2 GSD of seen");
    for (far, c) in BANDS.iter().zip(&counts) {
        let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
        println!(
            "{far:7} {:11} {:9.1} % {:6.1} % {:6.1} % {:12.1} % {:12.1} % {:12.1} %",
            c.structure,
            share(c.seen[0], c.structure),
            share(c.seen[1], c.structure),
            share(c.known, c.seen[0]),
            share(c.right[0], c.known),
            share(c.right[1], c.known),
            share(c.right[0], c.seen[0]),
        );
    }
    if let Some(cloud) = cloud {
        let fusion = fuse(&images, |i| Ok::<_, Infallible>(maps.get(&i).cloned()), &FusionOptions::default())?;
        println!("{:?}", fusion.summary);
        scene::format::write_ply_cloud(&fusion.cloud, &mut std::io::BufWriter::new(std::fs::File::create(cloud)?))?;
    }
    Ok(())
}

fn count(map: &DepthMap, views: &BTreeMap<ImageId, View>, depths: &BTreeMap<ImageId, Raster<f64>>, counts: &mut [Counts; BANDS.len()]) {
    let view = &views[&map.image];
    let (mask, truth) = (view.mask.as_ref(), &depths[&map.image]);
    let world_from_cam = view.cam_from_world.inverse();
    for y in 0..map.depth.height() {
        for x in 0..map.depth.width() {
            let p = Vector2::new(x as f64 + 0.5, y as f64 + 0.5);
            let Some(uv) = map.camera.unproject(&p) else { continue };
            let ray = Vector3::new(uv.x, uv.y, 1.0);
            let Some(q) = view.camera.project(&ray) else { continue };
            let Some(&z) = truth.at_point(q.x, q.y) else { continue };
            if z <= 0.0 || mask.and_then(|m| m.at_point(q.x, q.y)).is_none_or(|&m| m == 0) {
                continue;
            }
            let band = BANDS.iter().position(|&far| z < far).unwrap_or(BANDS.len() - 1);
            let c = &mut counts[band];
            c.structure += 1;
            let point = world_from_cam.apply(&(ray * z));
            let (mut seen, mut parallax) = (0, 0.0f64);
            for other in &map.neighbours {
                let other = &views[other];
                let in_other = other.cam_from_world.apply(&point);
                if in_other.z <= 0.0 {
                    continue;
                }
                let Some(r) = other.camera.project(&in_other) else { continue };
                let visible = depths[&other.image].at_point(r.x, r.y).is_some_and(|&d| (d / in_other.z - 1.0).abs() < 0.02);
                let active = other.mask.as_ref().and_then(|m| m.at_point(r.x, r.y)).is_some_and(|&m| m > 0);
                if visible && active {
                    seen += 1;
                    let nearer = other.cam_from_world.apply(&world_from_cam.apply(&(ray * (z * 1.001))));
                    if let Some(s) = other.camera.project(&nearer) {
                        parallax = parallax.max((s - r).norm() / (0.001 * z));
                    }
                }
            }
            c.seen[0] += usize::from(seen > 0);
            c.seen[1] += usize::from(seen > 1);
            let found = f64::from(map.depth[(x, y)]);
            if seen == 0 || found <= 0.0 {
                continue;
            }
            c.known += 1;
            c.right[0] += usize::from((found - z).abs() * ray.norm() < 2.0 * z / map.camera.mean_focal());
            c.right[1] += usize::from((found - z).abs() * parallax < 1.0);
        }
    }
}
