//! Measures of meshes against closed forms.

mod common;

use common::{cloud, hemispheres, sphere};
use nalgebra::{Point3, Vector3};
use scene::Mesh;
use std::f64::consts::PI;
use surface::{
    Footprint, Plane, PoissonOptions, Resolution, SurfaceError, closed_volume, fit_plane, holes, profile_rugosity, reconstruct, rim_plane,
    rugosity, standing_volume, surface_area, trim, volume_over_plane,
};

/// A height field on `n` x `n` squares over -1 to 1.
fn field(n: u32, height: impl Fn(f64, f64) -> f64) -> Mesh {
    let at = |i: u32| f64::from(i) * 2.0 / f64::from(n) - 1.0;
    let vertices = (0..(n + 1) * (n + 1)).map(|k| (at(k % (n + 1)), at(k / (n + 1)))).map(|(x, y)| Point3::new(x, y, height(x, y)));
    let square = |k: u32| {
        let a = k / n * (n + 1) + k % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    Mesh { vertices: vertices.collect(), faces: (0..n * n).flat_map(square).collect(), colours: vec![] }
}

const GROUND: Plane = Plane { point: Point3::new(0.0, 0.0, 0.0), normal: Vector3::new(0.0, 0.0, 1.0) };

#[test]
fn a_cut_plane_has_exact_volumes_and_a_tilted_one_its_rugosity() {
    // z = x + 0.3: above over x from -0.3 to 1, triangles of the profile with legs 1.3 and 0.7, two wide; not on the mesh's lines.
    let mesh = field(7, |x, _| x + 0.3);
    let volume = volume_over_plane(&mesh, &GROUND).expect("faces");
    assert!(
        (volume.above - 1.69).abs() < 1e-12 && (volume.below - 0.49).abs() < 1e-12 && (volume.footprint - 4.0).abs() < 1e-12,
        "{volume:?}"
    );
    let rough = rugosity(&mesh, &GROUND).expect("faces");
    assert!((rough.ratio - 2f64.sqrt()).abs() < 1e-12, "{rough:?}");
    let own = rim_plane(&mesh).expect("open");
    assert!((rugosity(&mesh, &own).expect("faces").ratio - 1.0).abs() < 1e-9);
    let profiles = profile_rugosity(&mesh, &GROUND, 9).expect("crossed");
    // Half of the profiles run up the slope, half along it.
    assert_eq!(profiles.profiles, 18);
    assert!((profiles.mean - (1.0 + 2f64.sqrt()) / 2.0).abs() < 1e-9 && (profiles.min - 1.0).abs() < 1e-9, "{profiles:?}");
}

#[test]
fn an_overhang_counts_once() {
    // A closed box of 2 x 3 x 4 standing 5 above the plane: its bottom face takes away what is below it.
    let corner = |i: u32| Point3::new(f64::from(i & 1) * 2.0, f64::from(i >> 1 & 1) * 3.0, 5.0 + f64::from(i >> 2) * 4.0);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mut mesh = Mesh { vertices: (0..8).map(corner).collect(), faces, colours: vec![] };
    let volume = volume_over_plane(&mesh, &GROUND).expect("faces");
    assert!((volume.above - 24.0).abs() < 1e-9 && volume.footprint.abs() < 1e-9);
    assert!((closed_volume(&mesh).expect("closed") - 24.0).abs() < 1e-9 && (surface_area(&mesh).expect("faces") - 52.0).abs() < 1e-9);
    assert_eq!(rugosity(&mesh, &GROUND), Err(SurfaceError::NoPlane));
    assert_eq!(rim_plane(&mesh), Err(SurfaceError::NoPlane));
    // Without its lid: one hole of 10 around and 6 of area.
    mesh.faces.drain(2..4);
    let found = holes(&mesh).expect("faces");
    assert_eq!((found.loops.len(), found.odd_edges), (1, 0));
    assert!((found.loops[0].length - 10.0).abs() < 1e-12 && (found.loops[0].area - 6.0).abs() < 1e-12);
    match closed_volume(&mesh) {
        Err(SurfaceError::NotClosed { holes: 1, length, .. }) => assert!((length - 10.0).abs() < 1e-12),
        other => panic!("{other:?}"),
    }
    mesh.faces.push([0, 2, 9]);
    assert!(matches!(surface_area(&mesh), Err(SurfaceError::BadFace { face: 10, .. })));
    assert_eq!(surface_area(&Mesh::default()), Err(SurfaceError::EmptyMesh));
}

#[test]
fn loops_that_touch_and_edges_of_three_faces_are_counted() {
    let points = |list: &[[f64; 3]]| list.iter().map(|&p| Point3::from(p)).collect::<Vec<_>>();
    let vertices = points(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]);
    let bow_tie = Mesh { vertices: vertices.clone(), faces: vec![[0, 1, 2], [0, 3, 4]], colours: vec![] };
    let found = holes(&bow_tie).expect("faces");
    assert!((found.loops.iter().map(|h| h.length).sum::<f64>() - 4.0 - 2.0 * 2f64.sqrt()).abs() < 1e-12);
    let fin = Mesh { vertices, faces: vec![[0, 1, 2], [1, 0, 4], [0, 1, 5]], colours: vec![] };
    assert_eq!(holes(&fin).expect("faces").odd_edges, 1);
}

#[test]
fn a_plane_is_fitted_past_what_stands_on_it() {
    let mut points: Vec<Point3<f64>> =
        (0..400).map(|i| Point3::new(f64::from(i % 20), f64::from(i / 20), 0.001 * f64::from(i % 3))).collect();
    points.extend((0..60).map(|i| Point3::new(2.0 + 0.01 * f64::from(i), 3.0, 4.0)));
    let plane = fit_plane(&points, &Vector3::z()).expect("a plane");
    assert!(plane.normal.z > 0.999_99 && plane.height(&Point3::new(10.0, 10.0, 0.0)).abs() < 0.01, "{plane:?}");
    let line: Vec<_> = (0..9).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
    assert_eq!(fit_plane(&line, &Vector3::z()), Err(SurfaceError::NoPlane));
}

#[test]
fn hemispheres_on_the_ground_have_their_volume_within_a_percent() {
    // As a dense cloud has it: points every 5 mm on domes of 0.3 m, noise of a third of that.
    let (radius, centres, spacing) = (0.3, [[-0.35, -0.2], [0.4, 0.3]], 0.005f64);
    let points = hemispheres(1.0, radius, &centres, 1.0 / (spacing * spacing), 4);
    let noisy = cloud(points.into_iter(), spacing / 3.0, 5);
    let options = PoissonOptions { resolution: Resolution::Cell(2.0 * spacing), ..PoissonOptions::default() };
    let surface = reconstruct(&noisy, &options).expect("a surface");
    let (mesh, density, summary) = trim(&surface.mesh, &surface.density, 0.25 * surface.median_density, 0.01).expect("trimmed");
    assert_eq!(density.len(), mesh.vertices.len());
    assert!(summary.share > 0.05 && summary.area_after < 1.1 * (4.0 + 2.0 * PI * radius * radius), "{summary:?}");
    let volume = volume_over_plane(&mesh, &rim_plane(&mesh).expect("open")).expect("faces");
    let truth = 2.0 * 2.0 / 3.0 * PI * radius.powi(3);
    assert!((volume.above / truth - 1.0).abs() < 0.01, "{volume:?} {truth}");
    let rough = rugosity(&mesh, &GROUND).expect("faces");
    let truth = (rough.projected + 2.0 * PI * radius * radius) / rough.projected;
    assert!((rough.ratio / truth - 1.0).abs() < 0.01, "{rough:?} {truth}");
}

#[test]
fn cutting_by_density_makes_the_rim_where_the_density_is() {
    // A density that falls with x: cut at x = 0.25, between the lines of the mesh.
    let mesh = field(10, |_, _| 0.0);
    let density: Vec<f32> = mesh.vertices.iter().map(|v| (1.0 - v.x) as f32).collect();
    let (cut, densities, summary) = trim(&mesh, &density, 0.75, 0.0).expect("trimmed");
    assert!((surface_area(&cut).expect("faces") - 2.5).abs() < 1e-6 && (summary.share - 0.375).abs() < 1e-6, "{summary:?}");
    assert!(cut.vertices.iter().all(|v| v.x <= 0.25 + 1e-6) && densities.iter().all(|&d| d >= 0.75));
    assert_eq!(holes(&cut).expect("faces").loops.len(), 1);
    // Two pieces: the smaller goes.
    let density: Vec<f32> = mesh.vertices.iter().map(|v| if (v.x - 0.6).abs() < 0.1 { 0.0 } else { 1.0 }).collect();
    let (cut, _, summary) = trim(&mesh, &density, 0.5, 0.3).expect("trimmed");
    assert_eq!(summary.islands, 1);
    assert!(cut.vertices.iter().all(|v| v.x < 0.6));
    let whole = cloud(sphere(20_000, 1.0), 0.0, 1);
    let surface =
        reconstruct(&whole, &PoissonOptions { resolution: Resolution::Depth(6), ..PoissonOptions::default() }).expect("a surface");
    let (kept, _, summary) = trim(&surface.mesh, &surface.density, 0.1 * surface.median_density, 0.01).expect("trimmed");
    assert_eq!((kept, summary.share), (surface.mesh, 0.0), "nothing is cut off where points are everywhere");
}

#[test]
fn domes_whose_tops_nobody_saw_have_their_volume_within_three_percent() {
    // What a camera below four fifths of their height sees: no point above, where 6 % of the volume are. Without their tops the meshes lose a third.
    let (radius, centres, spacing) = (0.3, [[-0.35, -0.2], [0.4, 0.3]], 0.005f64);
    let points = hemispheres(1.0, radius, &centres, 1.0 / (spacing * spacing), 4).into_iter().filter(|(p, _)| p.z < 0.8 * radius);
    let noisy = cloud(points, spacing / 3.0, 5);
    let options = PoissonOptions { resolution: Resolution::Cell(2.0 * spacing), ..PoissonOptions::default() };
    let surface = reconstruct(&noisy, &options).expect("a surface");
    let threshold = 0.25 * surface.median_density;
    let (mesh, ..) = trim(&surface.mesh, &surface.density, threshold, 0.01).expect("trimmed");
    let plane = rim_plane(&mesh).expect("open");
    let footprint = Footprint::new(&mesh, &plane, 4.0 * spacing).expect("faces");
    let volume = standing_volume(&surface.mesh, &surface.density, threshold, &plane, &footprint).expect("faces");
    let truth = 2.0 * 2.0 / 3.0 * PI * radius.powi(3);
    assert!((volume.above / truth - 1.0).abs() < 0.03, "{volume:?} {truth}");
    // The ground is 2 m wide, and reconstructed to a few cells of its edge; missing are the tops, discs of 0.6 of the domes' radius.
    assert!((volume.footprint / 4.0 - 1.0).abs() < 0.06, "{volume:?}");
    let tops = 2.0 * PI * radius * radius * 0.36 / volume.footprint;
    assert!((1.0 - volume.supported - tops).abs() < 0.03, "{volume:?} {tops}");
    let open = volume_over_plane(&mesh, &plane).expect("faces").above;
    assert!(open < 0.75 * truth, "without its tops a mesh has no volume: {open} {truth}");
}

#[test]
fn a_footprint_counts_what_it_encloses_and_the_volume_ends_at_it() {
    // A ring of ground round a well that nobody saw: the well belongs to it. Beside it lies a slab that the footprint has not.
    let ring = field(12, |x, y| if x.abs() < 0.4 && y.abs() < 0.4 { f64::NAN } else { 0.0 });
    let faces = ring.faces.iter().copied().filter(|f| f.iter().all(|&v| ring.vertices[v as usize].z.is_finite())).collect();
    let vertices = ring.vertices.iter().map(|p| if p.z.is_finite() { *p } else { Point3::origin() }).collect();
    let footprint = Footprint::new(&Mesh { vertices, faces, ..ring }, &GROUND, 0.05).expect("faces");
    assert!(footprint.covers(&Point3::new(0.1, 0.1, 9.0)) && !footprint.covers(&Point3::new(1.2, 0.5, 0.0)));
    assert!((footprint.area() / 4.0 - 1.0).abs() < 0.06, "{}", footprint.area());
    let mut slab = field(12, |_, _| 0.2);
    let far: Vec<_> = slab.vertices.iter().map(|p| p + Vector3::new(2.5, 0.0, 5.0)).collect();
    let count = slab.vertices.len() as u32;
    let beside: Vec<_> = slab.faces.iter().map(|f| f.map(|v| v + count)).collect();
    slab.vertices.extend(far);
    slab.faces.extend(beside);
    let density = vec![1.0; slab.vertices.len()];
    let volume = standing_volume(&slab, &density, 1.0, &GROUND, &footprint).expect("faces");
    assert!((volume.above - 0.8).abs() < 1e-12 && volume.below == 0.0 && volume.supported == 1.0, "{volume:?}");
    let none = standing_volume(&slab, &density[1..], 1.0, &GROUND, &footprint);
    assert!(matches!(none, Err(SurfaceError::BadOption { name: "density", .. })));
}
