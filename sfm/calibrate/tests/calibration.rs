//! Calibrations of cameras and rigs that are known.

use calibrate::{CalibrateError, Calibration, CameraSetup, KnownCamera, Setup, View, calibrate, drift, fit_held};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use rayon::prelude::*;
use scene::camera::MAX_CAMERA_PARAMS;
use scene::{Camera, CameraModel, Rigid3};
use synthetic::Random;

const NOISE_PX: f64 = 0.1;
const COLUMNS: usize = 9;
const ROWS: usize = 6;
const SQUARE_M: f64 = 0.03;

fn camera(c: usize) -> Camera {
    let d = c as f64;
    let params = [1350.0 + 10.0 * d, 660.0 - 8.0 * d, 470.0 + 5.0 * d, 0.2, 0.3, -0.1, 0.002, -0.001, 0.001, -0.0008];
    Camera::new(CameraModel::Brown, 1280, 960, &params).expect("valid")
}

fn cam_from_rig(c: usize) -> Rigid3 {
    let d = c as f64;
    Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::new(0.01, 0.12, -0.02) * d), Vector3::new(-0.12 * d, 0.01 * d, 0.005 * d))
}

/// A rig that sees a board from many sides; each point that falls into an image is seen.
fn dive(cameras: usize, exposures: usize, noise: f64, seed: u64) -> Setup {
    let mut random = Random::new(seed);
    let target: Vec<Vector3<f64>> =
        (0..ROWS * COLUMNS).map(|k| Vector3::new((k % COLUMNS) as f64, (k / COLUMNS) as f64, 0.0) * SQUARE_M).collect();
    let middle = Vector3::new((COLUMNS - 1) as f64, (ROWS - 1) as f64, 0.0) * (SQUARE_M / 2.0);
    let mut views = Vec::new();
    for exposure in 0..exposures {
        // The poses are the same for every seed: only the noise differs.
        let mut place = Random::new(1000 + exposure as u64);
        let turn = Vector3::new(place.range(-0.6, 0.6), place.range(-0.6, 0.6), place.range(-0.8, 0.8));
        let at = Vector3::new(place.range(-0.08, 0.14), place.range(-0.06, 0.06), place.range(0.35, 0.6));
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        let rig_from_target = Rigid3::new(rotation, at - rotation * middle);
        for c in 0..cameras {
            let project = |x: &Vector3<f64>| camera(c).project(&(cam_from_rig(c) * rig_from_target).apply(x));
            let seen = target.iter().enumerate().filter_map(|(k, x)| {
                let p = project(x)?;
                let inside = p.x > 0.0 && p.y > 0.0 && p.x < 1280.0 && p.y < 960.0;
                inside.then(|| (k, p + Vector2::new(random.normal(), random.normal()) * noise))
            });
            let points: Vec<_> = seen.collect();
            if points.len() > 20 {
                views.push(View { camera: c, exposure, points });
            }
        }
    }
    Setup {
        target,
        cameras: vec![CameraSetup { width: 1280, height: 960, model: CameraModel::Brown, held: [false; MAX_CAMERA_PARAMS] }; cameras],
        views,
    }
}

#[test]
fn exact_views_give_the_cameras_and_the_rig() {
    let found = calibrate(&dive(3, 14, 0.0, 1)).unwrap();
    for (c, camera_found) in found.cameras.iter().enumerate() {
        for (found, truth) in camera_found.camera.params().iter().zip(camera(c).params()) {
            assert!((found - truth).abs() < 1e-5 * truth.abs().max(1.0), "camera {c}: {found} {truth}");
        }
        let (found, truth) = (camera_found.cam_from_rig, cam_from_rig(c));
        assert!((found.centre() - truth.centre()).norm() < 1e-7 && found.rotation.angle_to(&truth.rotation) < 1e-6);
    }
    assert!(found.rms_px < 1e-5 && found.outliers.is_empty());
}

/// Normalised errors of all parameters, rig included, and the normalised square of the noise.
fn normalised(found: &Calibration) -> Vec<f64> {
    let mut errors = Vec::new();
    for (c, found) in found.cameras.iter().enumerate() {
        errors.extend(found.parameters.iter().zip(camera(c).params()).map(|(p, truth)| (p.value - truth) / p.sigma));
        if c > 0 {
            let truth = cam_from_rig(c);
            let turn = (truth.rotation * found.cam_from_rig.rotation.inverse()).scaled_axis();
            let shift = truth.translation - found.cam_from_rig.translation;
            errors.extend((0..3).map(|k| turn[k] / found.sigma_pose[k]));
            errors.extend((0..3).map(|k| shift[k] / found.sigma_pose[3 + k]));
        }
    }
    for b in &found.baselines {
        let truth = (cam_from_rig(b.cameras.0).centre() - cam_from_rig(b.cameras.1).centre()).norm();
        errors.push((b.length_m - truth) / b.sigma_m);
    }
    errors
}

#[test]
fn in_five_hundred_trials_errors_are_as_large_as_their_standard_deviations_say() {
    let trials = 500;
    let all: Vec<Vec<f64>> =
        (0..trials).into_par_iter().map(|seed| normalised(&calibrate(&dive(2, 12, NOISE_PX, seed)).unwrap())).collect();
    let count = all[0].len();
    assert_eq!(count, 2 * 10 + 6 + 1);
    let mut mean_square = 0.0;
    for k in 0..count {
        let within = all.iter().filter(|errors| errors[k].abs() < 3.0).count();
        assert!(within * 100 >= 95 * trials as usize, "value {k}: {within} of {trials} within three standard deviations");
        let rms = (all.iter().map(|e| e[k] * e[k]).sum::<f64>() / trials as f64).sqrt();
        // 20 % asked; 500 trials tell a standard deviation to 3.2 %. (100 tell it to 7 %: of 27 values one is then 20 % off now and again.)
        assert!((0.87..1.13).contains(&rms), "value {k}: errors are {rms} of what is stated");
        mean_square += rms * rms / count as f64;
    }
    assert!((0.97..1.03).contains(&mean_square.sqrt()), "{mean_square}");
}

#[test]
fn standard_deviation_of_unit_weight_is_the_noise() {
    let found = calibrate(&dive(2, 12, NOISE_PX, 3)).unwrap();
    // 2,500 residuals tell it to 1.4 %.
    assert!((found.sigma0_px / NOISE_PX - 1.0).abs() < 0.05, "{}", found.sigma0_px);
    // Radial distortion is far from 0; correlations are those of a matrix of correlations.
    assert_eq!(found.cameras[0].parameters[3].significant, Some(true));
    assert_eq!(found.cameras[0].parameters[0].significant, None);
    let r = &found.cameras[0].correlations;
    assert!((0..10).all(|i| (r[(i, i)] - 1.0).abs() < 1e-12 && (0..10).all(|j| r[(i, j)].abs() <= 1.0 + 1e-9)));
}

#[test]
fn a_third_camera_may_share_exposures_with_the_second_alone() {
    let mut setup = dive(3, 20, 0.0, 4);
    setup.views.retain(|v| if v.exposure < 10 { v.camera < 2 } else { v.camera > 0 });
    let found = calibrate(&setup).unwrap();
    assert!((found.cameras[2].cam_from_rig.centre() - cam_from_rig(2).centre()).norm() < 1e-6);
    let mut apart = dive(2, 20, 0.0, 4);
    apart.views.retain(|v| (v.exposure < 10) == (v.camera == 0));
    assert_eq!(calibrate(&apart), Err(CalibrateError::NotConnected { camera: 1 }));
}

#[test]
fn mistaken_points_are_left_out_and_told() {
    let mut setup = dive(2, 12, NOISE_PX, 5);
    setup.views[3].points[7].1 += Vector2::new(4.0, -3.0);
    let found = calibrate(&setup).unwrap();
    assert_eq!(found.outliers, [(3, 7)]);
    assert!((found.sigma0_px / NOISE_PX - 1.0).abs() < 0.05);
}

#[test]
fn views_that_do_not_determine_a_calibration_are_refused() {
    let good = dive(2, 12, NOISE_PX, 6);
    let mut few = good.clone();
    few.views.retain(|v| v.camera == 0 || v.exposure < 2);
    assert!(matches!(calibrate(&few), Err(CalibrateError::TooFewViews { camera: 1, needed: 3, .. })));

    let mut mirrored = good.clone();
    mirrored.target.iter_mut().for_each(|x| x.x = -x.x);
    assert_eq!(calibrate(&mirrored), Err(CalibrateError::Mirrored { view: 0 }));

    // A board straight in front, at several distances.
    let mut parallel = good.clone();
    parallel.cameras.truncate(1);
    parallel.views = (0..6)
        .map(|e| {
            let at = Vector3::new(-0.12 + 0.01 * e as f64, -0.08, 0.4 + 0.05 * e as f64);
            let points = good.target.iter().enumerate().map(|(k, x)| (k, camera(0).project(&(x + at)).unwrap())).collect();
            View { camera: 0, exposure: e, points }
        })
        .collect();
    assert!(matches!(calibrate(&parallel), Err(CalibrateError::Parallel { camera: 0, .. })));

    let mut wrong = good.clone();
    wrong.views[0].points[0].0 = 99;
    assert_eq!(calibrate(&wrong), Err(CalibrateError::BadIndex { view: 0 }));
    let mut solid = good.clone();
    solid.target[3].z = 0.1;
    assert_eq!(calibrate(&solid), Err(CalibrateError::NotFlat));
    let mut line = good;
    line.views[1].points.retain(|(k, _)| *k < COLUMNS);
    assert!(matches!(calibrate(&line), Err(CalibrateError::Degenerate { view: 1 })));
}

fn known(found: &Calibration) -> Vec<KnownCamera> {
    let of = |c: &calibrate::CalibratedCamera| KnownCamera {
        camera: c.camera,
        covariance: c.covariance.clone(),
        cam_from_rig: c.cam_from_rig,
        pose_covariance: c.pose_covariance,
    };
    found.cameras.iter().map(of).collect()
}

#[test]
fn chance_is_no_drift_and_drift_is_none_of_chance() {
    let before = known(&calibrate(&dive(2, 12, NOISE_PX, 50)).unwrap());
    // Twenty other calibrations of the same rig: probabilities are spread evenly, so that one in twenty is below 0.05.
    let mut low = 0;
    let mut values = 0;
    for seed in 51..71 {
        let setup = dive(2, 12, NOISE_PX, seed);
        let found = drift(&before, &calibrate(&setup).unwrap()).unwrap();
        let tests = found.iter().flat_map(|c| [c.interior, c.pose]).flatten();
        let probabilities: Vec<f64> = tests.map(|t| t.probability).collect();
        assert_eq!(probabilities.len(), 3);
        assert!(probabilities.iter().all(|p| *p > 1e-3), "{probabilities:?}");
        low += probabilities.iter().filter(|p| **p < 0.05).count();
        values += probabilities.len();
        // The principal distance of both is uncertain by 0.4 px, which moves the corners of the image by 0.3.
        assert!(found.iter().all(|c| c.shift_rms_px < 1.0), "{found:?}");
        let fit = fit_held(&setup, &before).unwrap();
        assert!((0.95..1.15).contains(&(fit.sigma0_px / NOISE_PX)), "{}", fit.sigma0_px);
    }
    // The first calibration is in all of them: up to 3 x 5 %.
    assert!(low * 100 <= 15 * values, "{low} of {values}");

    // The second camera was knocked by six tenths of a degree, and its lens was refocused by 3 px.
    let mut setup = dive(2, 12, NOISE_PX, 80);
    let knocked = Rigid3::new(
        UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0105, 0.0)) * cam_from_rig(1).rotation,
        cam_from_rig(1).translation,
    );
    let mut lens = camera(1);
    lens.params_mut()[0] += 3.0;
    let exact = calibrate(&dive(2, 12, 0.0, 80)).unwrap();
    let mut random = Random::new(81);
    for view in setup.views.iter_mut().filter(|v| v.camera == 1) {
        let pose = knocked * exact.exposures[view.exposure].unwrap();
        for (k, pixel) in &mut view.points {
            *pixel = lens.project(&pose.apply(&setup.target[*k])).unwrap() + Vector2::new(random.normal(), random.normal()) * NOISE_PX;
        }
    }
    let found = drift(&before, &calibrate(&setup).unwrap()).unwrap();
    assert!(found[0].interior.unwrap().probability > 1e-3);
    assert!(found[1].interior.unwrap().probability < 1e-6 && found[1].pose.unwrap().probability < 1e-6, "{found:?}");
    assert!((found[1].turned_rad - 0.0105).abs() < 0.002, "{}", found[1].turned_rad);
    assert!(found[1].shift_rms_px > 1.0 && found[1].shift_max_px > found[1].shift_rms_px);
    assert!(fit_held(&setup, &before).unwrap().sigma0_px > 3.0 * NOISE_PX);
    assert_eq!(drift(&before[..1], &exact), None);
}

#[test]
fn a_parameter_that_is_held_stays_and_has_no_deviation() {
    let mut setup = dive(1, 12, NOISE_PX, 7);
    setup.cameras[0].held[8] = true;
    setup.cameras[0].held[9] = true;
    let found = calibrate(&setup).unwrap();
    let camera = &found.cameras[0];
    assert!(camera.parameters[8].value == 0.0 && camera.parameters[8].sigma == 0.0 && camera.parameters[8].significant.is_none());
    assert!(camera.parameters[0].sigma > 0.0 && camera.correlations[(8, 0)] == 0.0 && camera.correlations[(8, 8)] == 1.0);
    let mean: f64 = found.residuals(&setup).iter().flatten().map(|r| r.unwrap().norm_squared()).sum::<f64>() / found.observations as f64;
    assert!((mean.sqrt() - found.rms_px).abs() < 1e-12);
}
