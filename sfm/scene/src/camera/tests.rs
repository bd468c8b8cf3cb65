use super::*;
use nalgebra::{Unit, Vector2, Vector3};
use proptest::prelude::*;

fn cameras() -> Vec<Camera> {
    let params: [&[f64]; 6] = [
        &[1200.0, 1210.0, 650.0, 390.0],
        &[1200.0, 650.0, 390.0, -0.12],
        &[1200.0, 650.0, 390.0, 0.3, 0.25],
        &[1200.0, 1190.0, 650.0, 390.0, 0.19, 0.49, 0.002, -0.001],
        &[600.0, 605.0, 650.0, 390.0, 0.03, -0.01, 0.004, -0.001],
        &[1200.0, 650.0, 390.0, 0.19, 0.4, -0.1, 0.002, -0.001, 0.003, -0.0005],
    ];
    let mut cameras: Vec<Camera> =
        CameraModel::ALL.into_iter().zip(params).map(|(m, p)| Camera::new(m, 1300, 780, p).expect("valid")).collect();
    // The same laws behind ports, one of which is tilted.
    cameras.push(cameras[0].behind(Some(port(Vector3::z()))).expect("possible"));
    cameras.push(cameras[5].behind(Some(port(Vector3::new(0.08, -0.05, 1.0)))).expect("possible"));
    cameras
}

fn port(normal: Vector3<f64>) -> FlatPort {
    FlatPort {
        normal: Unit::new_normalize(normal),
        distance_m: 0.03,
        thickness_m: 0.008_42,
        index_air: 1.0,
        index_port: 1.49,
        index_water: 1.34,
        object_distance_m: 2.0,
    }
}

proptest! {
    #[test]
    fn unproject_inverts_project(x in 0.0..1300.0f64, y in 0.0..780.0f64) {
        for camera in cameras() {
            let pixel = Vector2::new(x, y);
            let uv = camera.unproject(&pixel).expect("inside the image");
            let back = camera.project_direction(&Vector3::new(2.0 * uv.x, 2.0 * uv.y, 2.0)).expect("in front");
            prop_assert!((back - pixel).norm() < 1e-8, "{:?}: {pixel} became {back}", camera.model());
        }
    }

    #[test]
    fn jacobians_equal_differences(u in -0.5..0.5f64, v in -0.3..0.3f64, z in 0.5..20.0f64) {
        let x = Vector3::new(u * z, v * z, z);
        for camera in cameras() {
            let j = camera.project_with_jacobians(&x).expect("in front");
            prop_assert!((j.pixel - camera.project(&x).expect("in front")).norm() == 0.0);
            // Central differences: the error of a step h is about h^2 |f'''|, and rounding eps / h.
            for k in 0..3 {
                let h = 1e-6 * z;
                let (mut plus, mut minus) = (x, x);
                plus[k] += h;
                minus[k] -= h;
                let d = (camera.project(&plus).expect("ok") - camera.project(&minus).expect("ok")) / (2.0 * h);
                prop_assert!((d - j.d_point.column(k)).norm() < 1e-4 * (1.0 + d.norm()), "{:?} point {k}", camera.model());
            }
            for k in 0..camera.params().len() {
                let h = 1e-6 * (1.0 + camera.params()[k].abs());
                let (mut plus, mut minus) = (camera, camera);
                plus.params_mut()[k] += h;
                minus.params_mut()[k] -= h;
                let d = (plus.project(&x).expect("ok") - minus.project(&x).expect("ok")) / (2.0 * h);
                prop_assert!((d - j.d_params.column(k)).norm() < 1e-4 * (1.0 + d.norm()), "{:?} parameter {k}", camera.model());
            }
        }
    }
}

#[test]
fn fisheye_is_smooth_at_the_axis() {
    let camera = cameras()[4];
    for r in [0.0, 1e-9, 0.99e-4, 1.01e-4, 1e-3] {
        let x = Vector3::new(r, 0.5 * r, 1.0);
        let j = camera.project_with_jacobians(&x).expect("in front");
        assert!((j.d_point[(0, 0)] - 600.0).abs() < 1e-2, "{r}: {}", j.d_point);
    }
}

#[test]
fn nothing_projects_from_behind_or_beyond_the_fold() {
    for camera in cameras() {
        assert!(camera.project(&Vector3::new(0.1, 0.1, -1.0)).is_none());
        assert!(camera.project(&Vector3::new(0.1, 0.1, 0.0)).is_none());
        assert!(camera.project(&Vector3::new(f64::NAN, 0.1, 1.0)).is_none());
    }
    // 1 + 3 k r2 = 0 at r = 1.667 for k = -0.12.
    assert!(cameras()[1].project(&Vector3::new(1.7, 0.0, 1.0)).is_none());
}

#[test]
fn resized_camera_sees_the_same_field() {
    for camera in cameras() {
        let half = camera.resized(650, 390).expect("valid");
        let x = Vector3::new(0.2, -0.1, 1.0);
        let (full, small) = (camera.project(&x).expect("ok"), half.project(&x).expect("ok"));
        assert!((full / 2.0 - small).norm() < 1e-9);
    }
}

#[test]
fn behind_a_port_derivatives_hold_on_its_normal() {
    let camera = cameras()[6];
    for r in [0.0, 1e-14, 1e-9, 1e-5] {
        let x = Vector3::new(r, -0.5 * r, 2.0);
        let j = camera.project_with_jacobians(&x).expect("seen");
        for k in 0..3 {
            let h = Vector3::ith(k, 1e-6);
            let d = (camera.project(&(x + h)).expect("ok") - camera.project(&(x - h)).expect("ok")) / 2e-6;
            assert!((d - j.d_point.column(k)).norm() < 1e-3, "{r}, {k}: {d} {}", j.d_point);
        }
    }
}

#[test]
fn impossible_ports_are_refused() {
    let camera = cameras()[0];
    let good = port(Vector3::z());
    assert!(camera.behind(Some(good)).is_ok());
    for (bad, word) in [
        (FlatPort { distance_m: -0.01, ..good }, "distance"),
        (FlatPort { thickness_m: f64::NAN, ..good }, "thickness"),
        (FlatPort { index_water: 0.9, ..good }, "water"),
        (FlatPort { object_distance_m: 0.03, ..good }, "object"),
        (port(-Vector3::z()), "normal"),
    ] {
        let error = camera.behind(Some(bad)).expect_err("impossible").to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn impossible_parameters_are_refused() {
    assert!(Camera::new(CameraModel::Pinhole, 10, 10, &[1.0, 1.0, 0.0]).is_err());
    assert!(Camera::new(CameraModel::Pinhole, 10, 10, &[0.0, 1.0, 0.0, 0.0]).is_err());
    assert!(Camera::new(CameraModel::Pinhole, 10, 10, &[1.0, f64::NAN, 0.0, 0.0]).is_err());
    assert!(Camera::from_focal(CameraModel::Brown, 0, 10, 100.0).is_err());
}

#[test]
fn brown_and_opencv_agree_on_shared_terms() {
    let opencv = Camera::new(CameraModel::OpenCv, 100, 100, &[80.0, 80.0, 50.0, 50.0, 0.1, -0.05, 0.003, 0.002]).expect("ok");
    let brown = Camera::new(CameraModel::Brown, 100, 100, &[80.0, 50.0, 50.0, 0.1, -0.05, 0.0, 0.002, 0.003, 0.0, 0.0]).expect("ok");
    let x = Vector3::new(0.3, -0.4, 1.1);
    assert!((opencv.project(&x).expect("ok") - brown.project(&x).expect("ok")).norm() < 1e-12);
}
