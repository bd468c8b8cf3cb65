//! Reconstructions of shapes whose truth is known.

mod common;

use common::{cloud, cube, random, sphere, uniform};
use nalgebra::{Point3, Vector3};
use scene::{Cloud, Mesh};
use surface::{PoissonOptions, PoissonSurface, Resolution, SurfaceError, closed_volume, reconstruct, surface_area};

fn at_depth(depth: u32) -> PoissonOptions {
    PoissonOptions { resolution: Resolution::Depth(depth), ..PoissonOptions::default() }
}

fn made(cloud: &Cloud, options: &PoissonOptions) -> PoissonSurface {
    reconstruct(cloud, options).expect("a surface")
}

/// Largest and root mean square distance of the vertices from a sphere around the origin.
fn off_sphere(mesh: &Mesh, radius: f64) -> (f64, f64) {
    let off = mesh.vertices.iter().map(|v| (v.coords.norm() - radius).abs());
    (off.clone().fold(0.0, f64::max), (off.map(|d| d * d).sum::<f64>() / mesh.vertices.len() as f64).sqrt())
}

#[test]
fn a_sphere_comes_back_to_a_fraction_of_a_cell_wherever_it_lies() {
    for shift in [Vector3::zeros(), Vector3::new(4.0e5, -7.0e6, 30.0)] {
        let mut points = cloud(sphere(40_000, 2.0), 0.0, 1);
        points.positions.iter_mut().for_each(|p| *p += shift);
        let mut surface = made(&points, &at_depth(6));
        surface.mesh.vertices.iter_mut().for_each(|p| *p -= shift);
        let cell = surface.summary.cell;
        let (max, rms) = off_sphere(&surface.mesh, 2.0);
        // The chord of a cell's edge is off by cell^2 / (8 r), 0.5 % of a cell here; five times that is left to density and solver.
        assert!(max < 0.06 * cell && rms < 0.025 * cell, "{max} {rms} {cell}");
        let volume = closed_volume(&surface.mesh).expect("closed");
        assert!((volume / (32.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3, "{volume}");
        assert!((surface_area(&surface.mesh).expect("faces") / (16.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3);
    }
}

#[test]
fn the_volume_of_a_cube_is_within_a_percent_with_noise_and_within_three_with_holes() {
    // A dense cloud: two points a cell's face, noise a third of the distance between points.
    let spacing = 1.0 / 200.0;
    let noisy = cloud(cube(40_000, 5), spacing / 3.0, 6);
    let surface = made(&noisy, &at_depth(7));
    let volume = closed_volume(&surface.mesh).expect("closed");
    assert!((volume - 1.0).abs() < 0.01, "{volume}");
    // A cut-out of three tenths on each of three faces, and the bottom not seen within a strip.
    let mut cut = Cloud::default();
    for (p, n) in noisy.positions.iter().zip(&noisy.normals) {
        let hole = |a: usize, b: usize, c: usize| p[a] > 0.45 && p[b].abs() < 0.15 && p[c].abs() < 0.15;
        if !(hole(0, 1, 2) || hole(1, 2, 0) || hole(2, 0, 1) || (p.z < -0.45 && p.x.abs() < 0.1)) {
            cut.positions.push(*p);
            cut.normals.push(*n);
        }
    }
    assert!(cut.len() < noisy.len() - 10_000);
    let volume = closed_volume(&made(&cut, &PoissonOptions { closed: true, ..at_depth(7) }).mesh).expect("closed");
    assert!((volume - 1.0).abs() < 0.03, "{volume}");
}

#[test]
fn a_torus_keeps_its_hole() {
    let mut random = random(9);
    let (major, minor) = (1.0, 0.35);
    let points = (0..120_000).filter_map(|_| {
        let (a, b, keep) = (uniform(&mut random), uniform(&mut random), uniform(&mut random));
        let (a, b) = (a * std::f64::consts::TAU, b * std::f64::consts::TAU);
        // Area is proportional to the distance from the axis.
        (keep * (major + minor) < major + minor * b.cos()).then(|| {
            let n = Vector3::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin());
            (Point3::new(a.cos() * major, a.sin() * major, 0.0) + n * minor, n)
        })
    });
    let points: Vec<_> = points.collect();
    let mesh = made(&cloud(points.into_iter(), 0.0, 1), &at_depth(7)).mesh;
    let euler = mesh.vertices.len() as i64 - mesh.faces.len() as i64 / 2;
    assert_eq!(euler, 0, "a torus has vertices - edges + faces = 0");
    let volume = closed_volume(&mesh).expect("closed");
    assert!((volume / (2.0 * (std::f64::consts::PI * minor).powi(2) * major) - 1.0).abs() < 3e-3, "{volume}");
}

#[test]
fn points_of_uneven_density_and_strays_give_one_closed_surface() {
    // One half has 1/64 of the points: its cells are three levels coarser, and the surface has no crack where they meet.
    let points = sphere(200_000, 1.0).enumerate().filter(|(i, (p, _))| p.x > 0.0 || i % 64 == 0).map(|(_, p)| p);
    let mut uneven = cloud(points, 0.0, 1);
    uneven.positions.push(Point3::new(1.3, 1.3, 1.3));
    uneven.normals.push(Vector3::x());
    let surface = made(&uneven, &at_depth(8));
    assert!(surface.summary.coarser > 1000, "{:?}", surface.summary);
    let volume = closed_volume(&surface.mesh).expect("closed");
    assert!((volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 5e-3, "{volume}");
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    let mut noisy = cloud(sphere(30_000, 1.0), 0.01, 3);
    noisy.sigmas = (0..noisy.len()).map(|i| 0.01 + 0.001 * (i % 7) as f32).collect();
    noisy.colours = noisy.positions.iter().map(|p| [(p.x * 100.0 + 120.0) as u8, 7, 200]).collect();
    let options = PoissonOptions { sigma_weights: true, ..at_depth(7) };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| made(&noisy, &options))
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.summary, two.summary);
    assert_eq!(one.mesh, two.mesh);
    assert_eq!(one.density, two.density);
}

#[test]
fn colours_and_density_are_those_of_the_points_nearby() {
    let mut points = cloud(sphere(40_000, 1.0), 0.0, 1);
    points.colours = points.positions.iter().map(|p| if p.z > 0.0 { [200, 10, 30] } else { [20, 90, 250] }).collect();
    let surface = made(&points, &at_depth(6));
    for (vertex, colour) in surface.mesh.vertices.iter().zip(&surface.mesh.colours) {
        if vertex.z.abs() > 3.0 * surface.summary.cell {
            assert_eq!(*colour, if vertex.z > 0.0 { [200, 10, 30] } else { [20, 90, 250] });
        }
    }
    let truth = 40_000.0 / (4.0 * std::f64::consts::PI);
    assert!((surface.median_density / truth - 1.0).abs() < 0.1, "{} {truth}", surface.median_density);
}

#[test]
fn points_that_are_sure_weigh_more() {
    // Two shells: the inner one is ten times surer.
    let mut both = cloud(sphere(40_000, 1.0).chain(sphere(40_000, 1.02)), 0.0, 1);
    both.sigmas = (0..80_000).map(|i| if i < 40_000 { 0.002 } else { 0.02 }).collect();
    let radius = |sigma_weights: bool| {
        let mesh = made(&both, &PoissonOptions { sigma_weights, ..at_depth(6) }).mesh;
        mesh.vertices.iter().map(|v| v.coords.norm()).sum::<f64>() / mesh.vertices.len() as f64
    };
    let (plain, weighted) = (radius(false), radius(true));
    assert!((plain - 1.01).abs() < 2e-3 && (weighted - 1.0).abs() < 3e-3, "{plain} {weighted}");
}

#[test]
fn what_gives_no_surface_is_told() {
    let good = cloud(sphere(100, 1.0), 0.0, 1);
    let refused = |cloud: &Cloud, options: &PoissonOptions| reconstruct(cloud, options).expect_err("refused");
    let plain = Cloud { normals: vec![], ..good.clone() };
    assert_eq!(refused(&plain, &at_depth(6)), SurfaceError::NoNormals { points: 100, normals: 0 });
    let few = Cloud { normals: vec![Vector3::zeros(); 100], ..good.clone() };
    assert!(matches!(refused(&few, &at_depth(6)), SurfaceError::TooFewPoints { usable: 0, .. }));
    let place = Cloud { positions: vec![Point3::new(1.0, 2.0, 3.0); 100], ..good.clone() };
    assert!(matches!(refused(&place, &at_depth(6)), SurfaceError::NoExtent { .. }));
    assert!(matches!(refused(&good, &at_depth(15)), SurfaceError::BadOption { name: "depth", .. }));
    let fine = PoissonOptions { resolution: Resolution::Cell(1e-6), ..PoissonOptions::default() };
    assert!(matches!(refused(&good, &fine), SurfaceError::TooFine { .. }));
    let mut holed = good.clone();
    holed.positions[7].x = f64::NAN;
    holed.normals[9] = Vector3::repeat(f32::NAN);
    let surface = made(&holed, &at_depth(3));
    assert_eq!((surface.summary.points, surface.summary.dropped), (98, 2));
    let cell = PoissonOptions { resolution: Resolution::Cell(0.1), ..PoissonOptions::default() };
    assert!((made(&good, &cell).summary.cell - 0.1).abs() < 1e-12);
}
