//! Depth maps and a cloud of a scene with true cameras (Strecha et al., CVPR 2008), without structure from motion: `strecha FOLDER LONG_SIDE NEAR
//! FAR OUT`. Writes depth, normal and fused cloud files for looking at, and prints how long it took.

use dense::{DepthMap, DepthOptions, FusionOptions, View, estimate_depth, fit, fuse};
use nalgebra::{Matrix3, Vector3};
use scene::{Camera, CameraModel, ImageId, Raster, Rigid3};
use std::error::Error;
use std::io::Write;
use std::path::Path;

fn read_view(folder: &Path, name: &str, id: usize, long_side: u32) -> Result<View, Box<dyn Error>> {
    let text = std::fs::read_to_string(folder.join("gt_dense_cameras").join(format!("{name}.camera")))?;
    let v: Vec<f64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    let cam_from_world_rotation = Matrix3::from_row_slice(&v[12..21]).transpose();
    let centre = Vector3::from_column_slice(&v[21..24]);
    let camera = Camera::new(CameraModel::Pinhole, v[24] as u32, v[25] as u32, &[v[0], v[4], v[2], v[5]])?;
    let rgb = imaging::decode_rgb(&std::fs::read(folder.join("images").join(name))?)?;
    let (w, h) = fit(camera.width(), camera.height(), long_side);
    Ok(View {
        image: ImageId::new(id),
        camera: camera.resized(w, h)?,
        cam_from_world: Rigid3::from_matrix(&cam_from_world_rotation, -(cam_from_world_rotation * centre)),
        rgb: imaging::resize_area_rgb(&rgb, w as usize, h as usize),
        mask: None,
    })
}

fn write_pictures(map: &DepthMap, out: &Path) -> Result<(), Box<dyn Error>> {
    let mut known: Vec<f32> = map.depth.data().iter().copied().filter(|&z| z > 0.0).collect();
    known.sort_unstable_by(f32::total_cmp);
    let Some(&low) = known.get(known.len() / 50) else { return Ok(()) };
    let high = known[known.len() - 1 - known.len() / 50];
    let depth =
        map.depth.map(|&z| if z > 0.0 { [(255.0 - 215.0 * ((z - low) / (high - low)).clamp(0.0, 1.0)) as u8; 3] } else { [0, 0, 90] });
    let normal = map.normal.map(|n| n.map(|c| (127.5 + 127.5 * c) as u8));
    let save = |what: &str, raster: &Raster<[u8; 3]>| -> Result<(), Box<dyn Error>> {
        Ok(std::fs::write(out.join(format!("{what}{:02}.png", map.image)), imaging::encode_png_rgb(raster)?)?)
    };
    save("depth", &depth)?;
    save("normal", &normal)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, long_side, near, far, out] = &arguments[..] else { return Err("strecha FOLDER LONG_SIDE NEAR FAR OUT".into()) };
    let (folder, out) = (Path::new(folder), Path::new(out));
    std::fs::create_dir_all(out)?;
    let mut names: Vec<String> = std::fs::read_dir(folder.join("gt_dense_cameras"))?
        .filter_map(|e| e.ok()?.file_name().into_string().ok()?.strip_suffix(".camera").map(str::to_owned))
        .collect();
    names.sort();
    let views = names.iter().enumerate().map(|(i, n)| read_view(folder, n, i, long_side.parse()?)).collect::<Result<Vec<_>, _>>()?;
    let mut maps = Vec::new();
    for (i, view) in views.iter().enumerate() {
        let mut order: Vec<usize> = (0..views.len()).filter(|&j| j != i).collect();
        order.sort_by_key(|&j| j.abs_diff(i));
        let neighbours: Vec<&View> = order.iter().take(4).map(|&j| &views[j]).collect();
        let start = std::time::Instant::now();
        let map = estimate_depth(view, &neighbours, (near.parse()?, far.parse()?), &DepthOptions::default())?;
        let share = 100.0 * map.known() as f64 / map.depth.data().len() as f64;
        eprintln!("{} {share:.1} % known, {:.2} s, {} bytes", names[i], start.elapsed().as_secs_f64(), map.to_bytes().len());
        write_pictures(&map, out)?;
        maps.push(map);
    }
    let start = std::time::Instant::now();
    let images: Vec<ImageId> = maps.iter().map(|m| m.image).collect();
    let fusion = fuse(&images, |id| Ok::<_, std::convert::Infallible>(maps.get(id.index()).cloned()), &FusionOptions::default())?;
    eprintln!("{:?}, {:.2} s", fusion.summary, start.elapsed().as_secs_f64());
    let cloud = &fusion.cloud;
    let mut file = std::io::BufWriter::new(std::fs::File::create(out.join("cloud.ply"))?);
    write!(file, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", cloud.len())?;
    write!(file, "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n")?;
    write!(file, "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float sigma\nend_header\n")?;
    for i in 0..cloud.len() {
        let (p, n) = (cloud.positions[i].cast::<f32>(), cloud.normals[i]);
        for value in p.iter().chain(n.iter()) {
            file.write_all(&value.to_le_bytes())?;
        }
        file.write_all(&cloud.colours[i])?;
        file.write_all(&cloud.sigmas[i].to_le_bytes())?;
    }
    Ok(())
}
