//! The adjuster against Ceres on *Bundle Adjustment in the Large* (Agarwal et al., ECCV 2010).
//!
//! Reads `$SFM_DATA/bal/problem-*.txt.bz2`, unpacked by `bunzip2` or Python, whichever there is.

use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};
use scene::camera::MAX_CAMERA_PARAMS;
use scene::{Camera, CameraModel, Rigid3};
use solve::adjust::{AdjustOptions, CameraBlock, ImageObservation, PointBlock, PoseBlock, Problem, adjust};
use std::path::Path;
use std::process::Command;

fn unpack(path: &Path) -> Option<String> {
    let unpackers = [("bunzip2", vec!["-c"]), ("python3", vec!["-c", "import bz2,sys;sys.stdout.write(bz2.open(sys.argv[1],'rt').read())"])];
    let run = |(program, arguments): &(&str, Vec<&str>)| Command::new(program).args(arguments).arg(path).output().ok();
    let output = unpackers.iter().filter_map(run).find(|o| o.status.success())?;
    String::from_utf8(output.stdout).ok()
}

/// The problem of a file: one frame and one camera (focal length and two radial terms) an image.
///
/// BAL's cameras look along -z with y up, and p = -P / P.z. Turned by pi about x they look along z with y down; u stays
/// and v changes sign. Its radial polynomial is ours.
fn parse(text: &str) -> Problem {
    let mut numbers = text.split_ascii_whitespace().map(|n| n.parse::<f64>().expect("a number"));
    let mut next = || numbers.next().expect("as many numbers as the header says");
    let [cameras, points, observations] = [next(), next(), next()].map(|n| n as usize);
    let mut problem = Problem { sensors: vec![PoseBlock::fixed(Rigid3::identity())], ..Problem::default() };
    for _ in 0..observations {
        let [image, point, x, y] = [next(), next(), next(), next()];
        let (frame, camera) = (image as u32, image as u32);
        problem.observations.push(ImageObservation { frame, sensor: 0, camera, point: point as u32, pixel: Vector2::new(x, -y), sigma_px: 1.0 });
    }
    let turn = UnitQuaternion::new_normalize(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    for _ in 0..cameras {
        let [w, t] = [Vector3::new(next(), next(), next()), Vector3::new(next(), next(), next())];
        let [f, k1, k2] = [next(), next(), next()];
        problem.frames.push(PoseBlock::free(Rigid3::new(turn * UnitQuaternion::from_scaled_axis(w), turn * t)));
        let camera = Camera::new(CameraModel::Radial, 1, 1, &[f, 0.0, 0.0, k1, k2]).expect("valid");
        let mut free = [false; MAX_CAMERA_PARAMS];
        (free[0], free[3], free[4]) = (true, true, true);
        problem.cameras.push(CameraBlock { free, ..CameraBlock::fixed(camera) });
    }
    problem.points = (0..points).map(|_| PointBlock { xyz: Vector3::new(next(), next(), next()), free: true }).collect();
    problem
}

fn check(file: &str, max_iterations: usize, ceres_cost: f64, tolerance: f64) {
    let Some(data) = std::env::var_os("SFM_DATA") else {
        eprintln!("skipped: SFM_DATA does not name the data folder");
        return;
    };
    let path = Path::new(&data).join("bal").join(file);
    let Some(text) = unpack(&path) else {
        eprintln!("skipped: cannot unpack {}", path.display());
        return;
    };
    let mut problem = parse(&text);
    let options = AdjustOptions { max_iterations, ..AdjustOptions::default() };
    let start = std::time::Instant::now();
    let summary = adjust(&mut problem, &options).expect("a valid problem");
    eprintln!("{file}: {:.3} s, {summary:#?}", start.elapsed().as_secs_f64());
    assert_eq!(summary.observations_left_out, 0);
    assert!(summary.final_cost < ceres_cost * (1.0 + tolerance), "{file}: {} is more than Ceres' {ceres_cost}", summary.final_cost);
}

// Ceres 2.1 with its defaults (function tolerance 1e-6) and SPARSE_SCHUR. It stops where a step gains less than 1e-6 of
// the cost; neither program has then converged further than that.

#[test]
fn dubrovnik_16() {
    check("problem-16-22106-pre.txt.bz2", 50, 18033.9035, 1e-6);
}

#[test]
fn trafalgar_21() {
    check("problem-21-11315-pre.txt.bz2", 50, 30378.64, 1e-6);
}
