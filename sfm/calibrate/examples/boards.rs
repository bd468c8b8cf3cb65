//! Calibrates one or two cameras from photographs of a chequerboard: `boards COLUMNSxROWS SQUARE_M LEFT... [-- RIGHT...]`; the n-th
//! photographs of both were taken at one instant.

use calibrate::{BoardFinding, CameraSetup, Setup, View, calibrate, detect_board};
use nalgebra::Vector3;
use scene::CameraModel;
use scene::camera::MAX_CAMERA_PARAMS;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [size, square, files @ ..] = args.as_slice() else { return Err("boards COLUMNSxROWS SQUARE_M LEFT... [-- RIGHT...]".into()) };
    let (columns, rows) = size.split_once('x').ok_or("give the size as 9x6")?;
    let (columns, rows): (usize, usize) = (columns.parse()?, rows.parse()?);
    let square: f64 = square.parse()?;
    let (mut cameras, mut views) = (Vec::new(), Vec::new());
    for (camera, files) in files.split(|f| f == "--").enumerate() {
        for (exposure, file) in files.iter().enumerate() {
            let image = imaging::decode_grey(&std::fs::read(file)?)?;
            let (width, height) = (image.width() as u32, image.height() as u32);
            if exposure == 0 {
                cameras.push(CameraSetup { width, height, model: CameraModel::OpenCv, held: [false; MAX_CAMERA_PARAMS] });
            }
            match detect_board(&image, columns, rows) {
                BoardFinding::Found(board) => {
                    views.push(View { camera, exposure, points: board.corners.into_iter().enumerate().collect() })
                }
                other => eprintln!("{file}: {other:?}"),
            }
        }
    }
    let target = (0..rows * columns).map(|k| Vector3::new((k % columns) as f64, (k / columns) as f64, 0.0) * square).collect();
    let found = calibrate(&Setup { target, cameras, views })?;
    println!(
        "RMS {:.4} px, sigma0 {:.4} px, {} points, {} left out",
        found.rms_px,
        found.sigma0_px,
        found.observations,
        found.outliers.len()
    );
    for camera in &found.cameras {
        println!("RMS {:.4} px", camera.rms_px);
        for p in &camera.parameters {
            println!("  {:3} {:12.5} +- {:.5} {:?}", p.name, p.value, p.sigma, p.significant);
        }
    }
    for b in &found.baselines {
        println!("baseline {:?} {:.6} +- {:.6} m", b.cameras, b.length_m, b.sigma_m);
    }
    Ok(())
}
