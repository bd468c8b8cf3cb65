//! Cameras behind a flat port: orientation follows the refracted rays.

use crate::support::{assert_consistent, input, rig_poses};
use mapping::{Mapper, OrientOptions, RigInput, RigMode, orient};
use nalgebra::{Unit, Vector3};
use scene::{Camera, CameraModel, FlatPort, Scale};
use synthetic::survey::{Survey, SurveyOptions, survey};
use synthetic::{Alignment, deviation};

/// A lens of 62 degrees in air behind acrylic, 32 mm before it and a little tilted, over a sea bed some 3 m away.
fn behind_a_port() -> Survey {
    let lens = Camera::new(CameraModel::SimpleRadial, 960, 600, &[600.0, 480.0, 300.0, -0.05]).expect("valid");
    let port = FlatPort {
        normal: Unit::new_normalize(Vector3::new(0.01, -0.006, 1.0)),
        distance_m: 0.032,
        thickness_m: 0.008_42,
        index_air: 1.0,
        index_port: 1.491,
        index_water: 1.3414,
        object_distance_m: 3.0,
    };
    survey(&SurveyOptions { cameras: 2, exposures: 15, camera: lens.behind(Some(port)).expect("possible"), ..SurveyOptions::default() })
}

/// Largest error of a projection centre, metres, on the known rig.
fn error_m(made: &Survey, mapper: Mapper, change: impl Fn(&Camera) -> Camera, fixed: bool) -> f64 {
    let mut input = input(made);
    for camera in &mut input.cameras {
        (camera.camera, camera.fixed) = (change(&camera.camera), fixed);
    }
    input.rig = RigInput { mode: RigMode::Rigid, poses: rig_poses(&made.truth, None), baselines: Vec::new() };
    let out = orient(&input, &OrientOptions { mapper, ..OrientOptions::default() }).expect("a sound survey");
    assert_consistent(&out, &input);
    assert_eq!(out.models[0].scale, Scale::Metric);
    deviation(&out.models[0], &made.truth, Alignment::Se3).expect("all oriented").max_centre.0
}

#[test]
fn exact_observations_through_a_port_give_the_truth() {
    let made = behind_a_port();
    for mapper in [Mapper::Global, Mapper::Incremental] {
        let error = error_m(&made, mapper, |camera| *camera, true);
        // As without a port: keypoints are stored as f32.
        assert!(error < 1e-5, "{mapper:?}: {error}");
    }
}

#[test]
fn the_lens_behind_a_port_is_refined() {
    let made = behind_a_port();
    let longer = |camera: &Camera| {
        let mut camera = *camera;
        camera.params_mut()[0] *= 1.01;
        camera
    };
    // Scale and principal distance are determined by the rig; 1e-4 m as where lengths hardly weigh.
    let error = error_m(&made, Mapper::Incremental, longer, false);
    assert!(error < 1e-4, "{error}");
}

#[test]
fn distortion_does_not_take_up_a_port() {
    let made = behind_a_port();
    let error = error_m(&made, Mapper::Incremental, Camera::central, false);
    // The reason for the model: millimetres, at no noise at all.
    assert!(error > 1e-3, "{error}");
}
