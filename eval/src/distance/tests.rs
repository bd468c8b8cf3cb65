use super::*;
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use std::f64::consts::PI;

fn cloud(points: Vec<Point3<f64>>) -> Cloud {
    Cloud { positions: points, ..Cloud::default() }
}

/// A cube from 0 to 1, faces outwards; every face has its own corners where `soup`.
fn cube(soup: bool) -> Mesh {
    let corner = |i: u32| Point3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut mesh = Mesh { vertices: (0..8).map(corner).collect(), ..Mesh::default() };
    for [a, b, c, d] in quads {
        mesh.faces.extend([[a, b, c], [a, c, d]]);
    }
    if soup {
        mesh.vertices = mesh.faces.iter().flatten().map(|&v| corner(v)).collect();
        mesh.faces = (0..12).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    }
    mesh
}

/// Signed distance to the surface of that cube, in closed form.
fn to_cube(p: &Point3<f64>) -> f64 {
    let outside = p.coords.map(|c| (c - 0.5).abs() - 0.5);
    outside.map(|c| c.max(0.0)).norm() + outside.max().min(0.0)
}

proptest! {
    #[test]
    fn cube_has_its_closed_form(points in prop::collection::vec(prop::array::uniform3(-1.0..2.0f64), 1..40), shift in prop::array::uniform3(-5e5..5e5f64), soup in any::<bool>(), snap in any::<bool>()) {
        // Snapped to a lattice, points fall on faces, edges and corners.
        let points: Vec<Point3<f64>> = points.into_iter().map(|p| Point3::from(if snap { p.map(|c| (c * 4.0).round() / 4.0) } else { p })).collect();
        let shift = Vector3::from(shift);
        let mut mesh = cube(soup);
        mesh.vertices.iter_mut().for_each(|v| *v += shift);
        let found = distances(&cloud(points.iter().map(|p| p + shift).collect()), &Reference::Mesh(mesh)).expect("a cube");
        for (p, d) in points.iter().zip(found) {
            // Rounding of coordinates of 5e5 to f64 gives 1e-10; the result is rounded to f32.
            prop_assert!((f64::from(d) - to_cube(p)).abs() < 1e-6, "{p}: {d} against {}", to_cube(p));
        }
    }

    #[test]
    fn nearest_point_is_that_of_brute_force(points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 1..30), others in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 1..30)) {
        let points: Vec<_> = points.into_iter().map(Point3::from).collect();
        let others: Vec<_> = others.into_iter().map(Point3::from).collect();
        let found = distances(&cloud(points.clone()), &Reference::Cloud(cloud(others.clone()))).expect("points");
        for (p, d) in points.iter().zip(found) {
            let expected = others.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
            prop_assert!((f64::from(d) - expected).abs() <= 1e-6 * expected.max(1e-3));
        }
    }
}

/// A sphere of triangles between `rings` circles of latitude, corners on the sphere.
fn sphere(rings: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let around = 2 * rings;
    for i in 0..=rings {
        for j in 0..around {
            let (theta, phi) = (PI * f64::from(i) / f64::from(rings), 2.0 * PI * f64::from(j) / f64::from(around));
            mesh.vertices.push(Point3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()));
        }
    }
    for i in 0..rings {
        for j in 0..around {
            let (a, b) = (i * around + j, i * around + (j + 1) % around);
            mesh.faces.extend([[a, a + around, b], [b, a + around, b + around]]);
        }
    }
    mesh
}

/// Points all over, by the golden angle, at radii around 1.
fn spiral(count: u32) -> Vec<Point3<f64>> {
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (phi, r) = (f64::from(i) * 2.399_963, 1.0 + 0.3 * (f64::from(i) * 0.7).sin());
            Point3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z) * r
        })
        .collect()
}

#[test]
fn sphere_has_its_closed_form() {
    // Its poles are vertices shared by faces without area. Chords of pi / 100 lie up to (pi / 100)^2 / 8 x 2 inside.
    let mesh = sphere(100);
    let points = spiral(5000);
    for (p, d) in points.iter().zip(distances(&cloud(points.clone()), &Reference::Mesh(mesh)).expect("a sphere")) {
        let expected = p.coords.norm() - 1.0;
        assert!(f64::from(d) >= expected - 1e-6 && f64::from(d) <= expected + 2.5e-4, "{p}: {d} against {expected}");
    }
}

#[test]
fn distances_do_not_depend_on_threads() {
    let (mesh, points) = (Reference::Mesh(sphere(40)), cloud(spiral(20_000)));
    let with = |n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool");
        pool.install(|| distances(&points, &mesh).expect("a sphere")).into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    assert_eq!(with(1), with(2));
}

#[test]
fn one_triangle_and_degenerate_ones_have_distances() {
    let at = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
    let cases = [
        (vec![at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0)], at(0.2, 0.2, -3.0), -3.0),
        (vec![at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(2.0, 0.0, 0.0)], at(1.5, 2.0, 0.0), 2.0),
        (vec![at(1.0, 1.0, 1.0); 3], at(1.0, 4.0, 5.0), 5.0),
    ];
    for (vertices, point, expected) in cases {
        let mesh = Mesh { vertices, faces: vec![[0, 1, 2]], colours: vec![] };
        assert_eq!(distances(&cloud(vec![point]), &Reference::Mesh(mesh)), Ok(vec![expected]));
    }
}

#[test]
fn broken_input_is_an_error() {
    let one = cloud(vec![Point3::origin()]);
    let mesh = |change: fn(&mut Mesh)| {
        let mut mesh = cube(false);
        change(&mut mesh);
        Reference::Mesh(mesh)
    };
    assert!(matches!(distances(&one, &mesh(|m| m.faces.clear())), Err(EvalError::EmptyReference(_))));
    assert!(matches!(distances(&one, &mesh(|m| m.faces[3][1] = 8)), Err(EvalError::BadFace { face: 3, count: 8, .. })));
    assert!(matches!(distances(&one, &mesh(|m| m.vertices[7].y = f64::NAN)), Err(EvalError::BadPosition { index: 7, .. })));
    assert!(matches!(distances(&one, &Reference::Cloud(Cloud::default())), Err(EvalError::EmptyReference(_))));
    let nan = cloud(vec![Point3::origin(), Point3::new(0.0, f64::INFINITY, 0.0)]);
    assert!(matches!(distances(&nan, &mesh(|_| ())), Err(EvalError::BadPosition { what: "point", index: 1, .. })));
    assert_eq!(distances(&Cloud::default(), &mesh(|_| ())), Ok(vec![]));
}
