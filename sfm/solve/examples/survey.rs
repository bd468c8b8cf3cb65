//! Adjusts a survey as large as that of Rofallski et al. 2020, and compares its errors with its covariance:
//! `survey [baselines|rigid] [FRAMES POINTS]`.
//!
//! 1,582 exposures of three cameras, 1.6 million points and about 8 million observations with 1 px of noise and 2 % of outliers, from
//! perturbed start values; the distances between the cameras of every exposure are observed, 4,746 of them. A robust adjustment is followed
//! by one without what it shows to be wrong, whose covariance is that of its errors.

use nalgebra::Vector2;
use scene::camera::MAX_CAMERA_PARAMS;
use scene::{Reconstruction, Rigid3};
use solve::adjust::{
    AdjustOptions, AdjustSummary, Baseline, CameraBlock, CovarianceOptions, ImageObservation, Loss, NormalisedError, PointBlock, PoseBlock,
    Problem, adjust, consistency, joint_consistency,
};
use solve::triangulate::triangulation_angle;
use std::time::Instant;
use synthetic::Random;
use synthetic::geometry::{FrameBaseline, GeometryOptions, geometry};
use synthetic::noise::{NoiseOptions, perturb};

/// Standard deviation of the distances of the cameras, metres.
const BASELINE_SIGMA_M: f64 = 0.001;
/// What is further from where its point projects is wrong, standard deviations: of right observations one in 300,000.
const WRONG: f64 = 5.0;
/// Points seen from a smaller angle are left out: their errors along the rays are too large for a linear model.
const MIN_ANGLE_DEG: f64 = 1.5;
/// Observations that a frame needs to take part.
const MIN_OBSERVATIONS: usize = 15;
/// The inverse of more poses takes hours; all of them together are compared without one.
const MAX_INVERTED_FRAMES: usize = 2000;
/// Quantile 0.95 of chi-square with three degrees of freedom.
const CHI_SQUARE_3_95: f64 = 7.815;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let rigid = arguments.first().is_some_and(|mode| mode == "rigid");
    let mut options = GeometryOptions::paper();
    if let [_, frames, points] = &arguments[..] {
        (options.motion.frames, options.points) = (frames.parse()?, points.parse()?);
    }
    let start = Instant::now();
    let mut made = geometry(&options)?;
    let truth = poses(&made.truth, rigid);
    let points: Vec<_> = made.truth.points.iter().map(|p| p.xyz).collect();
    let noise = NoiseOptions { positions: 0.02, rotations_deg: 0.3, points: 0.02, seed: 3, ..NoiseOptions::default() };
    perturb(&mut made.truth, &noise);
    let mut problem = problem(&made.truth, &made.baselines, rigid);
    drop(made);
    println!(
        "made in {:.1} s: {} observations, {} baselines",
        start.elapsed().as_secs_f64(),
        problem.observations.len(),
        problem.baselines.len()
    );
    timed(
        "robust",
        &mut problem,
        &AdjustOptions { loss: Loss::Cauchy { scale_px: 2.0 }, function_tolerance: 1e-5, ..AdjustOptions::default() },
    )?;
    loop {
        let (wrong, weak) = filter(&mut problem);
        leave_out_blind(&mut problem);
        println!("{wrong} observations are wrong, {weak} points are weak");
        if wrong + weak == 0 {
            break;
        }
        timed("least squares", &mut problem, &AdjustOptions { function_tolerance: 1e-9, ..AdjustOptions::default() })?;
    }
    let start = Instant::now();
    let held = problem.frames.len() / 2;
    problem.frames[held].free = false;
    if problem.frames.len() > MAX_INVERTED_FRAMES {
        print("all poses", &joint_consistency(&problem, &truth, &CovarianceOptions::default())?);
        println!("in {:.1} s; the inverse of {} poses would take hours", start.elapsed().as_secs_f64(), problem.frames.len());
        return Ok(());
    }
    let found = consistency(&problem, &truth, &CovarianceOptions::default())?;
    println!("covariance of {} frames in {:.1} s", problem.frames.len(), start.elapsed().as_secs_f64());
    let bend = found.covariance.baseline_bends.iter().map(|b| b * b).sum::<f64>().sqrt();
    println!("the baselines bend by {bend:.3} standard deviations");
    print("all poses", &found.joint);
    print("each pose", &found.single);
    // The world in which the truth agrees with what is held.
    let into = problem.frames[held].pose.inverse() * truth[held];
    let (mut inside, mut count) = (0, 0);
    for ((point, xyz), covariance) in problem.points.iter().zip(&points).zip(&found.covariance.points) {
        let inverse = covariance.and_then(|c| c.try_inverse());
        if let Some(inverse) = inverse {
            let error = point.xyz - into.apply(xyz);
            inside += usize::from(error.dot(&(inverse * error)) < CHI_SQUARE_3_95);
            count += 1;
        }
    }
    println!("points: {:.4} of {count} within their 95 % ellipsoid", inside as f64 / count.max(1) as f64);
    Ok(())
}

fn print(what: &str, e: &NormalisedError) {
    println!(
        "{what}: normalised error squared {:.4} a scalar, 95 % band {:.4} to {:.4}: {}",
        e.value / e.expected,
        e.band[0] / e.expected,
        e.band[1] / e.expected,
        if e.is_in_band() { "inside" } else { "OUTSIDE" }
    );
}

fn timed(what: &str, problem: &mut Problem, options: &AdjustOptions) -> Result<AdjustSummary, Box<dyn std::error::Error>> {
    let start = Instant::now();
    let summary = adjust(problem, options)?;
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{what}: cost {:.3} to {:.3}, {} iterations, {:?}, {seconds:.1} s, {:.2} s an iteration, rms {:.3} px",
        summary.initial_cost,
        summary.final_cost,
        summary.iterations,
        summary.termination,
        seconds / summary.iterations.max(1) as f64,
        summary.reprojection.rms_px
    );
    Ok(summary)
}

/// Takes out observations that are wrong and points that are left with few or with a narrow angle. Returns the number of each.
fn filter(problem: &mut Problem) -> (usize, usize) {
    let before = problem.observations.len();
    let (points, frames, sensors, cameras) = (&problem.points, &problem.frames, &problem.sensors, &problem.cameras);
    let pose = |o: &ImageObservation| sensors[o.sensor as usize].pose * frames[o.frame as usize].pose;
    problem.observations.retain(|o| {
        let projected = cameras[o.camera as usize].camera.project(&pose(o).apply(&points[o.point as usize].xyz));
        projected.is_some_and(|p| (p - o.pixel).norm() < WRONG * o.sigma_px)
    });
    let wrong = before - problem.observations.len();
    // Observations of a point follow each other.
    let mut good = Vec::with_capacity(problem.observations.len());
    let mut weak = 0;
    for track in problem.observations.chunk_by(|a, b| a.point == b.point) {
        let xyz = &points[track[0].point as usize].xyz;
        let centres: Vec<_> = track.iter().map(|o| pose(o).centre()).collect();
        let wide = |(i, a)| centres[..i].iter().any(|b| triangulation_angle(a, b, xyz) >= MIN_ANGLE_DEG.to_radians());
        if centres.iter().enumerate().any(wide) {
            good.extend_from_slice(track);
        } else {
            weak += 1;
        }
    }
    problem.observations = good;
    (wrong, weak)
}

/// Frames that see next to nothing take no part.
fn leave_out_blind(problem: &mut Problem) {
    let mut seen = vec![0; problem.frames.len()];
    problem.observations.iter().for_each(|o| seen[o.frame as usize] += 1);
    let is_blind = |f: u32| seen[f as usize] < MIN_OBSERVATIONS;
    problem.observations.retain(|o| !is_blind(o.frame));
    problem.baselines.retain(|b| !is_blind(b.a.0) && !is_blind(b.b.0));
}

/// Pose of each frame of the problem.
fn poses(survey: &Reconstruction, rigid: bool) -> Vec<Rigid3> {
    if rigid {
        survey.frames.iter().filter_map(|f| f.rig_from_world).collect()
    } else {
        (0..survey.images.len()).map(scene::ImageId::new).filter_map(|i| survey.cam_from_world(i)).collect()
    }
}

/// One pose a frame, or one an image.
fn problem(survey: &Reconstruction, baselines: &[FrameBaseline], rigid: bool) -> Problem {
    let cameras = survey.cameras.len() as u32;
    let place = |image: u32| if rigid { (image / cameras, image % cameras) } else { (image, 0) };
    let mut problem = Problem { frames: poses(survey, rigid).into_iter().map(PoseBlock::free).collect(), ..Problem::default() };
    for camera in &survey.cameras {
        let mut free = [false; MAX_CAMERA_PARAMS];
        free[..camera.model().param_kinds().len()].fill(true);
        problem.cameras.push(CameraBlock { free, ..CameraBlock::fixed(*camera) });
    }
    if rigid {
        let sensors = survey.rigs[0].sensors.iter().enumerate();
        problem.sensors.extend(sensors.map(|(i, s)| PoseBlock { free: i > 0, ..PoseBlock::fixed(s.cam_from_rig) }));
    } else {
        problem.sensors.push(PoseBlock::fixed(Rigid3::identity()));
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
    let mut random = Random::new(5);
    for b in baselines {
        let [a, b_end] = b.images.map(|i| place(i.0));
        let length = b.length_m + BASELINE_SIGMA_M * random.normal();
        problem.baselines.push(Baseline { a, b: b_end, length, sigma: BASELINE_SIGMA_M });
    }
    problem
}
