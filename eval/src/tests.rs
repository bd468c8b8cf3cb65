//! Figures of clouds whose figures are known.

use crate::*;
use nalgebra::Point3;
use scene::{Cloud, Mesh};
use std::f64::consts::PI;

/// A square of `edge` at height `z` of the xy plane, normal up.
fn square(edge: f64, z: f64) -> Mesh {
    let vertices = [[0.0, 0.0], [edge, 0.0], [edge, edge], [0.0, edge]].map(|[x, y]| Point3::new(x, y, z)).to_vec();
    Mesh { vertices, faces: vec![[0, 1, 2], [0, 2, 3]], colours: vec![] }
}

/// A lattice of step `step` over `edge` x `share` of it, at height `z(k)`.
fn lattice(edge: f64, share: f64, step: f64, z: impl Fn(usize) -> f64) -> Cloud {
    let (nx, ny) = ((edge * share / step).round() as usize, (edge / step).round() as usize);
    let positions = (0..nx * ny).map(|k| Point3::new(((k % nx) as f64 + 0.5) * step, ((k / nx) as f64 + 0.5) * step, z(k))).collect();
    Cloud { positions, ..Cloud::default() }
}

fn options(threshold_m: f64) -> EvalOptions {
    EvalOptions { threshold_m: Some(threshold_m), ..EvalOptions::default() }
}

#[test]
fn two_planes_have_closed_forms() {
    // Three quarters of the points lie 1 cm above the plane, a quarter 20 cm below.
    let height = |k: usize| if k % 4 == 1 { -0.2 } else { 0.01 };
    let cloud = lattice(2.0, 1.0, 0.02, height);
    let m = evaluate(&cloud, &Reference::Mesh(square(2.0, 0.0)), &options(0.05)).expect("valid");
    assert_eq!(m.points, 10_000);
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} against {expected}");
    close(m.c2m_mean_m, 0.75 * 0.01 + 0.25 * 0.2);
    close(m.c2m_signed_mean_m.expect("a mesh has a sign"), 0.75 * 0.01 - 0.25 * 0.2);
    close(m.c2m_rms_m, (0.75 * 1e-4 + 0.25 * 0.04f64).sqrt());
    close(m.c2m_median_m, 0.01);
    close(m.c2m_max_m, 0.2);
    close(m.c2m_percentiles_m.p90_m, 0.2);
    assert_eq!((m.snr, m.accuracy, m.completeness), (0.75, 0.75, 1.0));
    close(m.f_score, 2.0 * 0.75 / 1.75);
    assert_eq!((m.integrity, m.integrity_coverage), (1.0, 1.0));
}

#[test]
fn density_is_that_of_the_lattice() {
    // 10,000 points a square metre; 89 points of the lattice lie within 5.3 steps of one, none at just that distance.
    let radius = 0.053;
    let with = |max_density_samples| EvalOptions { max_density_samples, density_radius_m: Some(radius), ..options(0.05) };
    let cloud = lattice(2.0, 1.0, 0.01, |_| 0.0);
    let reference = Reference::Mesh(square(2.0, 0.0));
    let all = evaluate(&cloud, &reference, &with(usize::MAX)).expect("valid");
    // A border cuts (2/3) R^3 off the discs of a metre of it, out of pi R^2 for each of 2 m across; there are four.
    let border = 1.0 - 4.0 * 2.0 * radius / (3.0 * PI) / 2.0;
    let inside = 89.0 / (PI * radius * radius);
    assert!((all.surface_density_per_m2 / (inside * border) - 1.0).abs() < 0.005, "{}", all.surface_density_per_m2);
    let some = evaluate(&cloud, &reference, &with(2000)).expect("valid");
    assert!((some.surface_density_per_m2 / all.surface_density_per_m2 - 1.0).abs() < 0.01, "{}", some.surface_density_per_m2);
}

#[test]
fn missing_half_shows_in_integrity_and_completeness() {
    let reference = Reference::Mesh(square(2.0, 0.0));
    let m = evaluate(&lattice(2.0, 0.5, 0.01, |_| 0.0), &reference, &options(0.05)).expect("valid");
    assert_eq!(m.snr, 1.0);
    // 20 of 41 columns of cells, or 21; the completeness reaches a threshold, 2.5 %, beyond the border.
    assert!((0.48..0.52).contains(&m.integrity) && m.integrity == m.integrity_coverage, "{} {}", m.integrity, m.integrity_coverage);
    assert!((m.completeness - 0.525).abs() < 0.01, "{}", m.completeness);
    // Noise fills cells above and below: the paper's ratio rises above 1, the coverage cannot.
    let noisy = lattice(2.0, 1.0, 0.01, |k| 0.049 * (k as f64 * 1.7).sin());
    let m = evaluate(&noisy, &reference, &options(0.05)).expect("valid");
    assert!(m.integrity > 2.0 && m.integrity_coverage > 0.99 && m.integrity_coverage <= 1.0, "{} {}", m.integrity, m.integrity_coverage);
}

#[test]
fn a_cloud_is_a_reference_too() {
    let reference = Reference::Cloud(lattice(1.0, 1.0, 0.01, |_| 0.0));
    let same = evaluate(&lattice(1.0, 1.0, 0.01, |_| 0.0), &reference, &options(0.02)).expect("valid");
    assert_eq!((same.c2m_mean_m, same.snr, same.completeness, same.integrity, same.integrity_coverage), (0.0, 1.0, 1.0, 1.0, 1.0));
    assert_eq!(same.c2m_signed_mean_m, None);
    let above = evaluate(&lattice(1.0, 1.0, 0.01, |_| 0.03), &reference, &options(0.02)).expect("valid");
    assert!((above.c2m_mean_m - 0.03).abs() < 1e-12);
    assert_eq!((above.snr, above.completeness, above.f_score, above.integrity), (0.0, 0.0, 0.0, 0.0));
}

#[test]
fn one_point_has_figures() {
    let one = Cloud { positions: vec![Point3::new(0.5, 0.5, 0.25)], ..Cloud::default() };
    let m = evaluate(&one, &Reference::Mesh(square(1.0, 0.0)), &EvalOptions { gsd_m: Some(0.2), ..EvalOptions::default() }).expect("valid");
    assert_eq!((m.points, m.c2m_mean_m, m.c2m_median_m, m.c2m_rms_m, m.snr, m.threshold_m), (1, 0.25, 0.25, 0.25, 1.0, 0.4));
    assert!((m.surface_density_per_m2 - 1.0 / (PI * 0.16)).abs() < 1e-12);
}

#[test]
fn what_cannot_be_measured_is_an_error() {
    let plane = Reference::Mesh(square(1.0, 0.0));
    let cloud = lattice(1.0, 1.0, 0.1, |_| 0.0);
    let with = |o: EvalOptions| evaluate(&cloud, &plane, &o);
    assert_eq!(with(EvalOptions::default()), Err(EvalError::NoThreshold));
    assert!(matches!(with(options(-1.0)), Err(EvalError::BadOption { name: "threshold_m", .. })));
    assert!(matches!(with(options(f64::NAN)), Err(EvalError::BadOption { .. })));
    assert!(matches!(with(EvalOptions { gsd_m: Some(0.0), ..EvalOptions::default() }), Err(EvalError::BadOption { name: "gsd_m", .. })));
    assert!(matches!(with(options(1e-9)), Err(EvalError::TooFine { .. })));
    assert_eq!(evaluate(&Cloud::default(), &plane, &options(0.1)), Err(EvalError::EmptyCloud));
    let mut bad = cloud.clone();
    bad.positions[5].z = f64::NAN;
    assert!(matches!(evaluate(&bad, &plane, &options(0.1)), Err(EvalError::BadPosition { what: "point", index: 5, .. })));
    let line = Mesh { vertices: vec![Point3::origin(); 3], faces: vec![[0, 1, 2]], colours: vec![] };
    assert!(matches!(evaluate(&cloud, &Reference::Mesh(line), &options(0.1)), Err(EvalError::EmptyReference(_))));
}

#[test]
fn figures_do_not_depend_on_threads() {
    let cloud = lattice(2.0, 1.0, 0.01, |k| 0.08 * (k as f64 * 1.7).sin());
    let reference = Reference::Mesh(square(2.0, 0.0));
    let with = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool");
        serde_json::to_string(&pool.install(|| evaluate(&cloud, &reference, &options(0.05)).expect("valid"))).expect("plain values")
    };
    assert_eq!(with(1), with(2));
}
