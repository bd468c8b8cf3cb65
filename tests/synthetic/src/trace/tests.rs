//! Rays against what can be said of them without a hierarchy.

use super::*;
use crate::random::Random;
use crate::world::{Label, Material, Part, SceneKind, World, WorldOptions};
use nalgebra::Vector3;
use scene::Mesh;

fn world() -> World {
    World::new(&WorldOptions { detail_m: 0.1, stones: 10, ..WorldOptions::default() })
}

fn random_packet(random: &mut Random, origin: impl Fn(&mut Random) -> Vector3<f64>) -> RayPacket {
    let mut rays = RayPacket { origin: [[0.0; 64]; 3], direction: [[0.0; 64]; 3] };
    for i in 0..64 {
        let from = origin(random);
        let direction = Vector3::from_fn(|_, _| random.normal()).normalize();
        for k in 0..3 {
            rays.origin[k][i] = from[k] as f32;
            rays.direction[k][i] = direction[k] as f32;
        }
    }
    rays
}

fn ray(rays: &RayPacket, i: usize) -> (Vector3<f64>, Vector3<f64>) {
    let at = |v: &[[f32; 64]; 3]| Vector3::new(v[0][i], v[1][i], v[2][i]).cast();
    (at(&rays.origin), at(&rays.direction))
}

/// The nearest triangle by testing all of them in double precision.
fn nearest(mesh: &Mesh, origin: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    let distances = mesh.faces.iter().filter_map(|face| {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize].coords);
        let columns = nalgebra::Matrix3::from_columns(&[b - a, c - a, -direction]);
        let x = columns.lu().solve(&(origin - a))?;
        (x.x >= 0.0 && x.y >= 0.0 && x.x + x.y <= 1.0 && x.z > 0.0).then_some(x.z)
    });
    distances.fold(f64::INFINITY, f64::min)
}

#[test]
fn packets_find_what_a_search_over_all_triangles_finds() {
    let world = world();
    let (tracer, mesh) = (Tracer::new(&world.parts), world.mesh());
    let mut random = Random::new(3);
    let mut differ = 0;
    for _ in 0..3 {
        let rays = random_packet(&mut random, |r| Vector3::new(r.range(-4.0, 4.0), r.range(-4.0, 4.0), r.range(0.5, 4.0)));
        let mut hits = HitPacket::default();
        tracer.packet(&rays, &mut hits);
        for i in (0..64).step_by(4) {
            let (origin, direction) = ray(&rays, i);
            let expected = nearest(&mesh, &origin, &direction);
            let found = if hits.triangle[i] == HitPacket::NONE {
                f64::INFINITY
            } else {
                tracer.hit(hits.triangle[i], &origin, &direction).distance
            };
            // A ray through an edge may take either triangle, or pass by a silhouette's edge.
            differ += usize::from(!(found == expected || (found - expected).abs() < 1e-4));
        }
    }
    assert!(differ <= 1, "{differ} of 48 rays differ");
}

#[test]
fn a_ray_alone_meets_what_it_meets_in_company() {
    let world = world();
    let tracer = Tracer::new(&world.parts);
    let rays = random_packet(&mut Random::new(8), |_| Vector3::new(0.0, -4.0, 1.5));
    let mut hits = HitPacket::default();
    tracer.packet(&rays, &mut hits);
    for i in 0..64 {
        let (origin, direction) = ray(&rays, i);
        let alone = tracer.ray(&origin, &direction);
        assert_eq!(alone.is_some(), hits.triangle[i] != HitPacket::NONE);
        if let Some(hit) = alone {
            assert!((hit.distance - f64::from(hits.distance[i])).abs() < 1e-4);
            assert!((hit.normal.norm() - 1.0).abs() < 1e-9 && (hit.shading_normal.norm() - 1.0).abs() < 1e-6);
        }
    }
}

/// From within a closed surface every ray meets it.
#[test]
fn no_ray_leaks_out_of_a_closed_surface() {
    let ball = World::new(&WorldOptions { scene: SceneKind::Hemispheres, ..WorldOptions::default() });
    let plate = ball.parts.iter().find(|p| p.name == "plate").expect("a hemisphere plate");
    let mut closed = crate::world::ball_mesh(5);
    closed.vertices.iter_mut().for_each(|v| *v = (v.coords * 2.0).into());
    let tracer = Tracer::new([&Part::new("ball", Label::Structure, Material::Stone, closed)]);
    let mut random = Random::new(4);
    let mut leaks = 0;
    for _ in 0..3000 {
        let rays = random_packet(&mut random, |r| Vector3::from_fn(|_, _| r.range(-0.8, 0.8)));
        let mut hits = HitPacket::default();
        tracer.packet(&rays, &mut hits);
        leaks += hits.distance.iter().filter(|d| d.is_infinite()).count();
    }
    assert_eq!(leaks, 0, "of 192,000 rays");
    assert_eq!(plate.mesh.faces.len(), 12);
}

#[test]
fn nearer_hits_stay() {
    let world = world();
    let tracer = Tracer::new(&world.parts);
    let rays = random_packet(&mut Random::new(9), |_| Vector3::new(0.0, -4.0, 1.5));
    let mut hits = HitPacket { distance: [0.01; 64], ..HitPacket::default() };
    tracer.packet(&rays, &mut hits);
    assert!(hits.triangle.iter().all(|&t| t == HitPacket::NONE));
}
