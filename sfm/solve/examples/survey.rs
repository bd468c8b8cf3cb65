//! Adjusts a survey as large as that of Rofallski et al. 2020: `survey [baselines|rigid] [FRAMES POINTS]`.
//!
//! 1,582 exposures of three cameras, 1.6 million points and about 8 million observations with 1 px of noise and 2 % of outliers, from
//! perturbed start values; the distances between the cameras of every exposure are observed.

use nalgebra::Vector2;
use scene::Reconstruction;
use scene::camera::MAX_CAMERA_PARAMS;
use solve::adjust::{AdjustOptions, Baseline, CameraBlock, ImageObservation, Loss, PointBlock, PoseBlock, Problem, adjust};
use std::time::Instant;
use synthetic::geometry::{FrameBaseline, GeometryOptions, geometry};
use synthetic::noise::{NoiseOptions, perturb};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let rigid = arguments.first().is_some_and(|mode| mode == "rigid");
    let mut options = GeometryOptions::paper();
    if let [_, frames, points] = &arguments[..] {
        (options.motion.frames, options.points) = (frames.parse()?, points.parse()?);
    }
    let start = Instant::now();
    let mut made = geometry(&options)?;
    let noise = NoiseOptions { positions: 0.02, rotations_deg: 0.3, points: 0.02, seed: 3, ..NoiseOptions::default() };
    perturb(&mut made.truth, &noise);
    let mut problem = problem(&made.truth, &made.baselines, rigid);
    drop(made);
    println!("made in {:.1} s: {} observations", start.elapsed().as_secs_f64(), problem.observations.len());
    let start = Instant::now();
    let options = AdjustOptions { loss: Loss::Cauchy { scale_px: 2.0 }, ..AdjustOptions::default() };
    let summary = adjust(&mut problem, &options)?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "cost {:.3} to {:.3}, {} iterations, {:?}, {seconds:.1} s, {:.2} s an iteration, rms {:.3} px",
        summary.initial_cost,
        summary.final_cost,
        summary.iterations,
        summary.termination,
        seconds / summary.iterations.max(1) as f64,
        summary.reprojection.rms_px
    );
    Ok(())
}

/// One pose a frame, or one an image.
fn problem(survey: &Reconstruction, baselines: &[FrameBaseline], rigid: bool) -> Problem {
    let cameras = survey.cameras.len() as u32;
    let place = |image: u32| if rigid { (image / cameras, image % cameras) } else { (image, 0) };
    let mut problem = Problem::default();
    for camera in &survey.cameras {
        let mut free = [false; MAX_CAMERA_PARAMS];
        free[..camera.model().param_kinds().len()].fill(true);
        problem.cameras.push(CameraBlock { free, ..CameraBlock::fixed(*camera) });
    }
    if rigid {
        problem.frames.extend(survey.frames.iter().filter_map(|f| f.rig_from_world).map(PoseBlock::free));
        let sensors = survey.rigs[0].sensors.iter().enumerate();
        problem.sensors.extend(sensors.map(|(i, s)| PoseBlock { free: i > 0, ..PoseBlock::fixed(s.cam_from_rig) }));
    } else {
        problem.sensors.push(PoseBlock::fixed(scene::Rigid3::identity()));
        let images = (0..survey.images.len()).map(scene::ImageId::new);
        problem.frames.extend(images.filter_map(|i| survey.cam_from_world(i)).map(PoseBlock::free));
    }
    for (p, point) in survey.points.iter().enumerate() {
        problem.points.push(PointBlock { xyz: point.xyz, free: true });
        for o in &point.track {
            let (frame, sensor) = place(o.image.0);
            let [x, y] = survey.keypoints[o.image.index()][o.keypoint.index()];
            problem.observations.push(ImageObservation {
                frame,
                sensor,
                camera: survey.images[o.image.index()].camera.0,
                point: p as u32,
                pixel: Vector2::new(f64::from(x), f64::from(y)),
                sigma_px: 1.0,
            });
        }
    }
    for b in baselines {
        let [a, b_end] = b.images.map(|i| place(i.0));
        if !rigid || a.0 == 0 {
            problem.baselines.push(Baseline { a, b: b_end, length: b.length_m, sigma: 0.001 });
        }
    }
    problem
}
