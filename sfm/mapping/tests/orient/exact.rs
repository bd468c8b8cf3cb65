//! The oracle of the accuracy: what an adjustment makes of the same keypoints when it starts at the truth and knows which
//! of them show the same point. No orientation can be expected to be closer to the truth than that; the noise alone
//! decides how close it is.

use mapping::{MapInput, RigMode};
use nalgebra::Vector2;
use scene::{CameraId, ImageId, Reconstruction};
use solve::adjust::{AdjustOptions, Baseline, CameraBlock, ImageObservation, PointBlock, PoseBlock, Problem, ScaleBar, adjust};
use solve::triangulate::{View, triangulate};

/// The adjusted truth; `interior` frees focal length and distortion, `sensors` the poses in the rig. The known lengths of
/// the input take part.
pub fn adjusted_truth(truth: &Reconstruction, input: &MapInput, interior: bool, sensors: bool) -> Reconstruction {
    let mut problem = Problem::default();
    for &camera in &truth.cameras {
        let mut block = CameraBlock::fixed(camera);
        for (free, kind) in block.free.iter_mut().zip(camera.model().param_kinds()) {
            *free = interior && *kind != scene::camera::ParamKind::PrincipalPoint;
        }
        problem.cameras.push(block);
    }
    let mut first_sensor = Vec::new();
    for rig in &truth.rigs {
        first_sensor.push(problem.sensors.len());
        for (i, sensor) in rig.sensors.iter().enumerate() {
            problem.sensors.push(PoseBlock { pose: sensor.cam_from_rig, free: sensors && i > 0, prior: None });
        }
    }
    problem.frames = truth.frames.iter().map(|f| PoseBlock::free(f.rig_from_world.expect("the truth is oriented"))).collect();
    let place = |image: ImageId| {
        let image = &truth.images[image.index()];
        let rig = truth.frames[image.frame.index()].rig.index();
        let sensor = truth.rigs[rig].sensors.iter().position(|s| s.camera == image.camera).expect("part of its rig");
        (image.frame.0, (first_sensor[rig] + sensor) as u32)
    };
    let observe = |image: ImageId, point: usize, pixel: Vector2<f64>| {
        let (frame, sensor) = place(image);
        ImageObservation { frame, sensor, camera: truth.images[image.index()].camera.0, point: point as u32, pixel, sigma_px: 1.0 }
    };
    for point in truth.points.iter().filter(|p| p.track.len() > 1) {
        let index = problem.points.len();
        problem.points.push(PointBlock { xyz: point.xyz, free: true });
        problem.observations.extend(point.track.iter().map(|&o| observe(o.image, index, truth.pixel(o))));
    }
    for baseline in &input.rig.baselines {
        let image = |camera: CameraId, exposure: u32| {
            let of = |i: &&ImageId| truth.images[i.index()].camera == camera;
            let at = |i: &ImageId| truth.frames[truth.images[i.index()].frame.index()].exposure == exposure;
            truth.oriented_images().collect::<Vec<_>>().iter().filter(of).find(|i| at(i)).copied()
        };
        let exposures = if input.rig.mode == RigMode::Rigid { 1 } else { truth.frames.len() as u32 };
        for e in 0..exposures {
            if let (Some(a), Some(b)) = (image(baseline.cameras.0, e), image(baseline.cameras.1, e)) {
                problem.baselines.push(Baseline { a: place(a), b: place(b), length: baseline.length_m, sigma: baseline.sigma_m });
            }
        }
    }
    for bar in input.scale_bars.iter().filter(|bar| !bar.check) {
        let first = problem.points.len();
        for end in &bar.ends {
            let views: Vec<View> = end
                .iter()
                .filter_map(|pick| {
                    let camera = truth.cameras[truth.images[pick.image.index()].camera.index()];
                    View::new(camera, &truth.cam_from_world(pick.image)?, Vector2::from(pick.pixel))
                })
                .collect();
            let index = problem.points.len();
            problem.points.push(PointBlock { xyz: triangulate(&views).expect("the ends are in view"), free: true });
            problem.observations.extend(end.iter().map(|pick| observe(pick.image, index, Vector2::from(pick.pixel))));
        }
        problem.scale_bars.push(ScaleBar { a: first as u32, b: first as u32 + 1, length: bar.length_m, sigma: bar.sigma_m });
    }
    let options = AdjustOptions { max_iterations: 100, function_tolerance: 1e-12, ..AdjustOptions::default() };
    let summary = adjust(&mut problem, &options).expect("the truth is a sound problem");
    assert!(summary.termination.is_converged(), "{summary:?}");
    let mut out = truth.clone();
    for (camera, block) in out.cameras.iter_mut().zip(&problem.cameras) {
        *camera = block.camera;
    }
    for (rig, &first) in out.rigs.iter_mut().zip(&first_sensor) {
        for (i, sensor) in rig.sensors.iter_mut().enumerate() {
            sensor.cam_from_rig = problem.sensors[first + i].pose;
        }
    }
    for (frame, block) in out.frames.iter_mut().zip(&problem.frames) {
        frame.rig_from_world = Some(block.pose);
    }
    out
}
